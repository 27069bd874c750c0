"""An American cuer for tests: claire's body, the chart of `spec/data/languages`."""

from dataclasses import replace
from functools import cache

import numpy as np

from codec.cuer.gestures import GestureTable
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import DEFAULT_OPTIONS, cue
from codec.cues.language import Language, french, known_languages
from codec.cues.score import Phone, Score
from codec.cues.timeline import TICK_S, TICKS, to_line
from codec.superframe.coding import coding_for
from codec.superframe.merging import join
from codec.superframe.resynthesis.trajectory import Resynthesis
from codec.superframe.score_coding import part_of

LIKE = {
    "ɝ": "ø", "æ": "a", "ɪ": "i", "ʊ": "u", "ʌ": "a", "ə": "ə", "ɑ": "ɑ", "oʊ": "o", "aɪ": "a",
    "aʊ": "a", "eɪ": "e", "ɔɪ": "ɔ", "ð": "z", "θ": "s", "h": "a", "ɹ": "ʁ", "ʍ": "w", "dʒ": "ʒ",
    "tʃ": "ʃ",
}  # fmt: skip
"""French phones whose lips are nearest; all others are written alike."""

ENDS = {
    "side down": ("side", (0.0, -60.0, 0.0)),
    "side forward": ("side", (0.0, 0.0, 60.0)),
    "side to throat": ("throat", (0.0, 0.0, 0.0)),
    "chin to throat": ("throat", (0.0, 0.0, 0.0)),
}
"""Where placements that move end: a placement of French, and mm beside it."""

SENTENCE = (
    "_ ð ə k w ɪ k b ɹ aʊ n f ɑ k s _ dʒ ʌ m p s oʊ v ɝ ð ə l eɪ z i d ɔ g _ b ɔɪ tʃ ɛ ɹ h i ɹ "
    "θ ɪ ŋ ʃ u p aɪ j ɛ s ʍ aɪ m æ ʒ t ʊ"
).split()


def english() -> Language:
    return next(one for one in known_languages() if one.name == "American English")


@cache
def american_voice() -> Voice:
    voice, language = load_voice("claire"), english()
    table, home = voice.gestures, french()
    arm = voice.hand.motion_directions[:, 3:].astype(np.float64)  # translation of each parameter
    placements = np.zeros((language.n_shapes, language.n_placements, arm.shape[0]))
    for number, name in enumerate(language.placements):
        like, off_mm = ENDS.get(name, (name, (0.0, 0.0, 0.0)))
        change = np.linalg.pinv(arm.T) @ np.array(off_mm)
        placements[:, number] = table.placement_targets[:, home.placements.index(like)] + change
    rows = [home.number_of[LIKE.get(symbol, symbol)] for symbol in language.phones]
    gestures = GestureTable(
        table.shape_targets,
        placements.astype(np.float32),
        table.viseme_targets[rows],
        table.neutral_head,
    )
    return replace(voice, name="american", gestures=gestures, language=language)


def spoken(symbols: list[str] = SENTENCE, ticks: int = 7) -> Score:
    """Return a score of phones that last 0.1 to 0.18 s."""
    phones, tick = [], 20
    for i, symbol in enumerate(symbols):
        length = ticks + i % 3 - 1
        if symbol != "_":
            phones.append(Phone(symbol, tick * TICK_S, (tick + length) * TICK_S))
        tick += length
    options = DEFAULT_OPTIONS.in_language(english())
    return Score(tuple(phones), tuple(cue(phones, options)))


def american_motion(score: Score, seed: int = 0) -> Motion:
    """Return what the chart asks of the cuer's hand and lips, with the tremor of a person."""
    voice = american_voice()
    options = DEFAULT_OPTIONS.in_language(voice.language)
    line = to_line(score, options)
    count = line.starts[-1] // TICKS + 2
    joined = join({k: part_of(line, k, options) for k in range(-1, count + 1)})
    params = Resynthesis(joined, coding_for(voice).targets, 0, count * TICKS).params()
    rng = np.random.default_rng(seed)
    tremor = np.cumsum(rng.normal(0, 0.02, params.shape), axis=0)
    params += tremor - tremor.mean(axis=0)
    return Motion(params.astype(np.float32), 1 / TICK_S, 0.0, voice.layout, voice.identity, score)
