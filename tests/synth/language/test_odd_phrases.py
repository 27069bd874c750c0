"""Phrases of subtitles: capitals, colloquial forms, names with spaces, foreign names, numbers."""

from collections import Counter
from pathlib import Path

import pytest

from synth.language.text.pronounce import phonemise

LIST = Path(__file__).with_name("odd_phrases.txt")
ALIKE = str.maketrans({"ɔ": "o", "ɛ": "e", "ø": "œ", "ə": None})
"""Vowels that speakers choose between are alike; ɔ̃ keeps its tilde."""

LEAST = {
    "capitals": 0.92,
    "colloquial": 0.92,
    "spaces": 0.92,
    "names": 0.9,
    "numbers": 0.92,
    "links": 0.92,
}
"""Share of exact phrases of each class."""


def said(text: str) -> str:
    return "".join(phone for word in phonemise(text) for phone in word.phones)


def folded(phones: str) -> str:
    return phones.translate(ALIKE)


def wrong(kind: str) -> list[str]:
    found = []
    for line in LIST.read_text(encoding="utf-8").splitlines():
        own, _, rest = line.partition("\t")
        if own != kind:
            continue
        text, reading = rest.split("\t")
        if reading.startswith("/"):
            right = {folded(variant) for variant in reading.strip("/").split("|")}
        else:
            right = {folded(said(variant)) for variant in reading.split("|")}
        if folded(said(text)) not in right:
            found.append(f"{text}: {said(text)}")
    return found


def counts() -> Counter[str]:
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return Counter(line.partition("\t")[0] for line in lines if not line.startswith("#"))


@pytest.mark.parametrize("kind", sorted(LEAST))
def test_odd_phrases_are_read_right(kind: str) -> None:
    mistaken = wrong(kind)
    assert 1 - len(mistaken) / counts()[kind] >= LEAST[kind], mistaken


def test_the_list_has_its_size() -> None:
    assert set(counts()) == set(LEAST)
    assert sum(counts().values()) > 110
