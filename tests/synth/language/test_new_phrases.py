"""Five hundred phrases by class, written with their phones before the front end was looked at."""

from collections import defaultdict
from pathlib import Path

import pytest

from codec.cues.cueing import cue
from codec.cues.phonology import PHONES
from codec.cues.score import Phone
from cuecast.evaluate.intelligibility import errors
from synth.language.text.pronounce import phonemise

LIST = Path(__file__).with_name("new_phrases.txt")
ALIKE = str.maketrans({"ɔ": "o", "ɛ": "e", "ø": "œ", "ɑ": "a", "ə": None})
"""Vowels that speakers choose between are alike; a tilde keeps ɔ̃ apart from ɔ."""

LEAST = {"capitals": 0.92, "colloquial": 0.92, "spaces": 0.92}
"""Share of exact phrases that these classes must have."""


def folded(phones: str) -> str:
    return phones.translate(ALIKE)


def symbols(line: str) -> list[str]:
    """Split a line of phones."""
    found, at = [], 0
    while at < len(line):
        length = 2 if line[at : at + 2] in PHONES else 1
        found.append(line[at : at + length])
        at += length
    return found


def keys(line: list[str]) -> list[str]:
    alike = [s.translate(ALIKE) if len(s) == 1 else s for s in line]
    phones = [Phone(s, float(i), i + 1.0) for i, s in enumerate(alike) if s]
    return [f"{key.shape}{key.placement}" for key in cue(phones)]


def measured() -> tuple[dict[str, list[str]], dict[str, int], float]:
    """Return by class what is not exact, the number of phrases, and the share of wrong keys."""
    wrong: dict[str, list[str]] = defaultdict(list)
    count: dict[str, int] = defaultdict(int)
    off = total = 0
    for line in LIST.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        kind, text, right = line.split("\t")
        said = [phone for word in phonemise(text) for phone in word.phones]
        variants = [variant.replace(" ", "") for variant in right.split("|")]
        count[kind] += 1
        if folded("".join(said)) not in map(folded, variants):
            wrong[kind].append(f"{text}: {''.join(said)} not {right}")
        away = min(errors(keys(symbols(variant)), keys(said)) for variant in variants)
        off, total = off + away[0], total + away[1]
    return wrong, count, off / total


@pytest.mark.slow
def test_new_phrases_are_read_right() -> None:
    wrong, count, off = measured()
    assert len(count) == 25
    assert set(count.values()) == {20}
    exact = 1 - sum(map(len, wrong.values())) / sum(count.values())
    assert exact >= 0.96, wrong
    assert off <= 0.01, wrong
    for kind, least in LEAST.items():
        assert 1 - len(wrong[kind]) / count[kind] >= least, wrong[kind]
