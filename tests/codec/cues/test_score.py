import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cues.phonology import PHONES
from codec.cues.score import PLACEMENTS, Key, Phone, Score
from codec.errors import CueError

TIMES = st.lists(st.integers(0, 500), min_size=2, max_size=40).map(sorted)


@st.composite
def scores(draw: st.DrawFn) -> Score:
    times = [t / 50 for t in draw(TIMES)]
    spans = list(itertools.pairwise(times))
    phones = [Phone(draw(st.sampled_from(PHONES)), a, b) for a, b in spans]
    keys = [
        Key(a, b, ("p",), draw(st.integers(0, 8)), draw(st.sampled_from(PLACEMENTS)))
        for a, b in spans
    ]
    return Score(tuple(phones), tuple(keys))


@given(scores())
def test_json_round_trip(score: Score) -> None:
    assert Score.from_json(score.to_json()) == score


@pytest.mark.parametrize(
    "text", ["", "null", "{}", '{"phones": 3, "keys": []}', "[" * 100000, '{"phones": [["x"]]}']
)
def test_malformed_json(text: str) -> None:
    with pytest.raises(CueError):
        Score.from_json(text)


def test_key_json_has_the_fields_of_the_contract() -> None:
    key = Key(0.5, 0.7, ("b", "ɔ̃"), 4, "mouth")
    assert json.loads(json.dumps(key.as_dict())) == {
        "start": 0.5,
        "end": 0.7,
        "phones": ["b", "ɔ̃"],
        "shape": 4,
        "placement": "mouth",
    }
    assert str(key) == "24"


def test_refusals_name_the_value() -> None:
    with pytest.raises(CueError, match="unknown phone 'q'"):
        Phone("q", 0, 1)
    with pytest.raises(CueError, match="end lies before the start"):
        Phone("p", 1, 0)
    with pytest.raises(CueError, match="end lies before the start"):
        Phone("p", float("nan"), 0)
    with pytest.raises(CueError, match="hand shape 9"):
        Key(0, 1, ("p",), 9, "side")
    with pytest.raises(CueError, match="placement 'ear'"):
        Key(0, 1, ("p",), 1, "ear")
    with pytest.raises(CueError, match="starts before its predecessor"):
        Score((Phone("p", 1, 2), Phone("a", 0, 3)), ())


def test_shift_moves_both_lines() -> None:
    score = Score((Phone("p", 0, 1),), (Key(0, 1, ("p",), 1, "side"),)).shifted(2.0)
    assert (score.phones[0].start, score.keys[0].end) == (2.0, 3.0)
