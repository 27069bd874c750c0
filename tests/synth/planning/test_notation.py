"""Keys as teachers write them."""

import pytest

from codec.cues.score import PLACEMENTS, Key
from codec.errors import CueError
from synth.planning.scoring.notation import as_taught, read_taught
from synth.planning.scoring.text_score import score_of_text


def test_bonjour() -> None:
    assert " ".join(map(as_taught, score_of_text("bonjour").keys)) == "4-m 1-c 3-s"


def test_every_key_is_read_back() -> None:
    keys = [Key(0.0, 1.0, (), shape, place) for shape in range(9) for place in PLACEMENTS]
    assert read_taught(" ".join(map(as_taught, keys))) == [(k.shape, k.placement) for k in keys]


@pytest.mark.parametrize("text", ["9-s", "4", "4-x", "44-s", "-s", "4m"])
def test_other_words_are_refused(text: str) -> None:
    with pytest.raises(CueError, match=r"is not a shape 0..8, a hyphen and one of nsmcbt"):
        read_taught(text)
