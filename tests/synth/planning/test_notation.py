"""Keys as teachers write them."""

from codec.cues.score import PLACEMENTS, Key
from synth.planning.scoring.notation import as_taught
from synth.planning.scoring.text_score import score_of_text


def test_bonjour() -> None:
    assert " ".join(map(as_taught, score_of_text("bonjour").keys)) == "4-m 1-c 3-s"


def test_every_key_has_a_word_of_its_own() -> None:
    keys = [Key(0.0, 1.0, (), shape, place) for shape in range(9) for place in PLACEMENTS]
    assert len(set(map(as_taught, keys))) == len(keys)
