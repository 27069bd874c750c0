"""Two thousand phrases by class: figures read as words, liaison, elision, homographs, cries."""

from collections import Counter
from pathlib import Path

import pytest

from synth.language.text.pronounce import phonemise

LIST = Path(__file__).with_name("phrases.txt")


def phrases() -> list[list[str]]:
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return [line.split("\t") for line in lines if not line.startswith("#")]


def said(text: str) -> str:
    return "".join(phone for word in phonemise(text) for phone in word.phones).rstrip("ə")


def expected(reading: str) -> list[str]:
    if reading.startswith("/"):
        return [variant.rstrip("ə") for variant in reading.strip("/").split("|")]
    return [said(reading)]


def test_the_list_has_its_size() -> None:
    counts = Counter(kind for kind, *_ in phrases())
    assert sum(counts.values()) > 2000
    assert len(counts) == 19


@pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_phrases_are_read_right(every: int) -> None:
    wrong = [
        f"{kind}: {text}"
        for kind, text, reading in phrases()[::every]
        if said(text) not in expected(reading)
    ]
    assert wrong == []


def test_roman_ordinals_are_no_cries() -> None:
    assert said("au XVIIIe siècle") == said("au dix-huitième siècle")
    assert said("la IIIe République") == said("la troisième République")


def test_wrong_readings_are_seen() -> None:
    assert said("le numéro 47") not in expected("le numéro quarante-huit")
    assert said("les amis") not in expected("/leami/")
