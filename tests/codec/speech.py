"""A sentence in phones, and the score of phones that all last as long: what tests say."""

from codec.cues.cueing import cue
from codec.cues.score import Phone, Score

SENTENCE = "b ɔ̃ ʒ u ʁ _ l ə k ɔ d a ʒ e f ɛ t u ʒ u ʁ v i t _ _ _ _ _ _ _ s u b l ɛ m ɑ̃".split()


def spoken(symbols: list[str], length_s: float = 0.1, start_s: float = 0.5) -> Score:
    """Return the score of phones one after another; ``_`` is silence."""
    phones = [
        Phone(s, round(start_s + i * length_s, 2), round(start_s + (i + 1) * length_s, 2))
        for i, s in enumerate(symbols)
        if s != "_"
    ]
    return Score(tuple(phones), tuple(cue(phones)))
