"""The code's rule against a second, independent implementation."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cues.cueing import PLACEMENT_OF, SHAPE_OF, CueingOptions, cue
from codec.cues.phonology import CONSONANTS, PAUSE, PHONES, VOWELS
from codec.cues.score import Key, Phone
from codec.errors import CueError

WORKED = {
    "b ɔ̃ ʒ u ʁ": "4-mouth 1-chin 3-side",
    "f ʁ w a": "5-side 3-side 6-side",
    "j ɛ ʁ": "8-chin 3-side",
    "ɔ b ʒ ɛ k t i f": "5-chin 4-side 1-chin 2-side 5-mouth 5-side",
    "v w a t y ʁ ə": "2-side 6-side 5-throat 3-side",
    "a": "5-side",
    "œ̃": "5-throat",
    "a a": "5-side 5-side",
}


def line(text: str) -> list[Phone]:
    return [Phone(s, i / 10, (i + 1) / 10) for i, s in enumerate(text.split())]


def by_table(text: str) -> str:
    """Cue by string rewriting, from the chart of the Association pour la LPC."""
    symbols = text.split()
    out = []
    while symbols:
        first = symbols.pop(0)
        if first == "_":
            continue
        if first in VOWELS:
            out.append((5, PLACEMENT_OF[first]))
        elif symbols and symbols[0] in VOWELS:
            out.append((SHAPE_OF[first], PLACEMENT_OF[symbols.pop(0)]))
        else:
            out.append((SHAPE_OF[first], "side"))
    return " ".join(f"{shape}-{placement}" for shape, placement in out)


def written(keys: list[Key]) -> str:
    return " ".join(f"{k.shape}-{k.placement}" for k in keys)


@pytest.mark.parametrize(("phones", "keys"), WORKED.items())
def test_worked_examples(phones: str, keys: str) -> None:
    assert written(list(cue(line(phones)))) == keys


@given(st.lists(st.sampled_from(PHONES), max_size=60).map(" ".join))
def test_agrees_with_a_second_implementation(text: str) -> None:
    keys = list(cue(line(text)))
    assert written(keys) == by_table(text)
    cued = itertools.chain.from_iterable(k.phones for k in keys)
    assert list(cued) == [s for s in text.split() if s != PAUSE]


def test_every_phone_has_its_key() -> None:
    assert set(SHAPE_OF.values()) == set(range(1, 9))
    assert len(VOWELS) == 16
    assert len(CONSONANTS) == 21


def test_a_gap_separates_consonant_and_vowel() -> None:
    apart = [Phone("b", 0.0, 0.1), Phone("a", 0.2, 0.3)]
    assert written(list(cue(apart))) == "4-side 5-side"


def test_options_change_the_disputed_vowels_only() -> None:
    merged = CueingOptions(un="cheek", schwa="cheek", oe="cheek")
    for vowel in VOWELS:
        expected = "cheek" if vowel in {"œ̃", "ə", "œ"} else PLACEMENT_OF[vowel]
        assert merged.placement(vowel) == expected
    with pytest.raises(CueError, match="option un: unknown placement 'ear'"):
        CueingOptions(un="ear")
    with pytest.raises(CueError, match="rest_gap_s is -1"):
        CueingOptions(rest_gap_s=-1)
