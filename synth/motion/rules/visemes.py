"""What each phone wants from the face: unit weights and how strongly it insists on each.

Weights belong to the face units of the mesh (named after the ARKit units); jaw opening at weight
1 is 39 mm, so speech stays below 0.45. A phone's *dominance* says how much it resists its
neighbours: lips of p, b, m must close whatever comes next, the jaw of k does not care.

The numbers are ours, set by looking at the result; which gestures belong to a phone is common
phonetic knowledge of French (Badin et al. 2002 for the roles of jaw, lips and larynx).
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONES, VOWELS

FloatArray = NDArray[np.float64]

ARTICULATORS = (
    "jaw", "close", "pucker", "funnel", "stretch", "smile", "upper", "lower", "roll_lower",
    "press", "corner_down", "cheek", "larynx", "jaw_forward",
)  # fmt: skip
"""Articulators of a viseme; each drives one or two face units."""

UNITS_OF = {
    "jaw": ("jawOpen",),
    "close": ("mouthClose",),
    "pucker": ("mouthPucker",),
    "funnel": ("mouthFunnel",),
    "stretch": ("mouthStretchLeft", "mouthStretchRight"),
    "smile": ("mouthSmileLeft", "mouthSmileRight"),
    "upper": ("mouthUpperUpLeft", "mouthUpperUpRight"),
    "lower": ("mouthLowerDownLeft", "mouthLowerDownRight"),
    "roll_lower": ("mouthRollLower",),
    "press": ("mouthPressLeft", "mouthPressRight"),
    "corner_down": ("mouthFrownLeft", "mouthFrownRight"),
    "cheek": ("cheekPuff",),
    "larynx": ("larynxRaise",),
    "jaw_forward": ("jawForward",),
}

_VOWEL = {
    "a": {"jaw": 0.30, "stretch": 0.08, "lower": 0.22, "upper": 0.18, "larynx": -0.5},
    "ɑ": {"jaw": 0.33, "lower": 0.20, "upper": 0.10, "larynx": -1.2},
    "o": {"jaw": 0.12, "pucker": 0.55, "funnel": 0.35, "larynx": -2.2},
    "œ": {"jaw": 0.22, "pucker": 0.18, "funnel": 0.42, "lower": 0.15, "larynx": -0.8},
    "ə": {"jaw": 0.14, "pucker": 0.20, "funnel": 0.28, "larynx": -0.4},
    "i": {"jaw": 0.07, "stretch": 0.35, "smile": 0.32, "lower": 0.15, "upper": 0.15, "larynx": 2.2},
    "ɔ̃": {"jaw": 0.14, "pucker": 0.62, "funnel": 0.30, "larynx": -1.6},
    "ɑ̃": {"jaw": 0.26, "funnel": 0.22, "pucker": 0.10, "larynx": -1.2},
    "ɛ": {"jaw": 0.23, "stretch": 0.22, "smile": 0.14, "lower": 0.25, "upper": 0.15, "larynx": 0.6},
    "ɔ": {"jaw": 0.23, "pucker": 0.30, "funnel": 0.35, "larynx": -1.2},
    "u": {"jaw": 0.06, "pucker": 0.85, "funnel": 0.20, "larynx": -3.0},
    "ɛ̃": {"jaw": 0.27, "stretch": 0.24, "smile": 0.14, "lower": 0.22, "larynx": 0.0},
    "ø": {"jaw": 0.12, "pucker": 0.50, "funnel": 0.35, "larynx": -0.4},
    "e": {"jaw": 0.13, "stretch": 0.30, "smile": 0.26, "lower": 0.18, "upper": 0.12, "larynx": 1.5},
    "y": {"jaw": 0.06, "pucker": 0.80, "funnel": 0.15, "larynx": 1.0},
    "œ̃": {"jaw": 0.23, "funnel": 0.32, "pucker": 0.12, "stretch": 0.05, "larynx": -0.2},
}

_BILABIAL = {"jaw": 0.05, "close": 0.06, "press": 0.30, "upper": -0.12, "lower": -0.10}
_LABIODENTAL = {"jaw": 0.05, "roll_lower": 1.05, "upper": 0.55, "lower": -0.10}
_ALVEOLAR = {"jaw": 0.10, "lower": 0.12}
_SIBILANT = {"jaw": 0.035, "stretch": 0.12, "lower": 0.15, "upper": 0.10, "jaw_forward": 0.25}
_HUSHING = {"jaw": 0.06, "funnel": 0.55, "pucker": 0.22, "jaw_forward": 0.3}
_VELAR = {"jaw": 0.13, "larynx": -0.6}

_CONSONANT = {
    "p": _BILABIAL | {"cheek": 0.08}, "b": _BILABIAL | {"cheek": 0.05, "larynx": -1.0},
    "m": _BILABIAL,
    "f": _LABIODENTAL, "v": _LABIODENTAL | {"larynx": -0.5},
    "t": _ALVEOLAR, "d": _ALVEOLAR | {"larynx": -0.8}, "n": _ALVEOLAR | {"jaw": 0.12},
    "l": _ALVEOLAR | {"jaw": 0.15},
    "s": _SIBILANT, "z": _SIBILANT | {"larynx": -0.5},
    "ʃ": _HUSHING, "ʒ": _HUSHING | {"larynx": -0.5},
    "k": _VELAR, "g": _VELAR | {"larynx": -1.2}, "ŋ": _VELAR, "ʁ": {"jaw": 0.14, "larynx": -0.9},
    "j": {"jaw": 0.08, "stretch": 0.22, "smile": 0.18, "larynx": 1.2},
    "ɲ": {"jaw": 0.08, "stretch": 0.14, "smile": 0.10, "larynx": 0.5},
    "w": {"jaw": 0.07, "pucker": 0.75, "funnel": 0.15, "larynx": -2.0},
    "ɥ": {"jaw": 0.07, "pucker": 0.70, "funnel": 0.12, "larynx": 0.6},
}  # fmt: skip

_LIPS = ("close", "pucker", "funnel", "stretch", "smile", "upper", "lower", "roll_lower", "press")
_INSISTS = {
    "p": {"jaw": 6.0, "close": 14.0, "press": 14.0, "upper": 14.0, "lower": 14.0, "funnel": 4.0},
    "f": {
        "jaw": 5.0,
        "roll_lower": 14.0,
        "upper": 12.0,
        "lower": 12.0,
        "pucker": 1.2,
        "funnel": 4.0,
    },
    "s": {"jaw": 7.0, "lower": 1.5, "upper": 1.5, "jaw_forward": 3.0},
    "ʃ": {"jaw": 6.0, "funnel": 5.0, "pucker": 3.0, "jaw_forward": 3.0},
    "w": {"pucker": 4.0, "funnel": 3.0, "jaw": 2.5},
    "j": {"stretch": 1.5, "smile": 1.5, "jaw": 2.5},
    "t": {"jaw": 3.0, "lower": 0.8},
    "k": {"jaw": 2.5},
}
_LIKE = {
    "b": "p", "m": "p", "v": "f", "z": "s", "ʒ": "ʃ", "ɥ": "w", "ɲ": "j",
    "d": "t", "n": "t", "l": "t", "g": "k", "ŋ": "k", "ʁ": "k",
}  # fmt: skip


@cache
def viseme_table() -> tuple[FloatArray, FloatArray]:
    """Return targets and dominances of all phones.

    Returns
    -------
    targets : ndarray, shape (38, 14)
        Articulator weights per phone number, columns as `ARTICULATORS`; larynx in mm.
    dominance : ndarray, shape (38, 14)
        Positive strengths.

    Examples
    --------
    >>> targets, _ = viseme_table()
    >>> bool(targets[:, 0].max() <= 0.45)
    True
    """
    targets = np.zeros((len(PHONES), len(ARTICULATORS)))
    dominance = np.full(targets.shape, 0.8)
    for number, phone in enumerate(PHONES):
        wants = _VOWEL.get(phone) or _CONSONANT.get(phone, {})
        for name, value in wants.items():
            targets[number, ARTICULATORS.index(name)] = value
        if phone in VOWELS:
            dominance[number] = 2.6
        elif phone != PAUSE:
            _insist(dominance[number], _INSISTS.get(_LIKE.get(phone, phone), {}))
    return targets, dominance


def _insist(row: FloatArray, strengths: dict[str, float]) -> None:
    for name in _LIPS:
        row[ARTICULATORS.index(name)] = 0.25
    for name, value in strengths.items():
        row[ARTICULATORS.index(name)] = value
