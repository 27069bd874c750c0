"""How wide a picture is against its height, when landmarks are given in parts of both.

A face alone does not suffice: faces differ by more than pictures do. A hand that cues does: at the
right aspect its fingers and placements are those of keys. All usual aspects are tried, and the one
at which face and keys together are likeliest is taken.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from synth.capture.cues.features import HandFeatures, see
from synth.capture.cues.lattice import FRAME_SHARE
from synth.capture.cues.line import line_value
from synth.capture.sources.landmark_table import LandmarkTable
from synth.capture.sources.resample import evenly
from synth.capture.tracker.picture import Picture, find_picture, unlike_face

FloatArray = NDArray[np.float64]

ASPECTS = (16 / 9, 4 / 3, 1.0, 3 / 4, 9 / 16)
"""Width by height of usual pictures: television, older television, square, and both upright."""

_FACES_DIFFER = 0.10
"""Standard deviation of the logarithm of faces' width against height, trackers' points included."""

_LOOKED_AT_S = 15.0
"""Seconds of a film that are tried under each aspect."""

_CERTAIN = 20.0
"""Natural logarithm of the least odds against a stated aspect that is doubted."""


@dataclass(frozen=True, slots=True)
class Aspect:
    """The chosen aspect, and why.

    Attributes
    ----------
    value : float
        Width over height; 1 if coordinates are pixels.
    notes : tuple of str
    """

    value: float
    notes: tuple[str, ...] = ()


def find_aspect(table: LandmarkTable, voice: Voice, *, told: float | None = None) -> Aspect:
    """Return the aspect of a table's picture.

    Parameters
    ----------
    table : LandmarkTable
    voice : Voice
    told : float, optional
        Taken as it is, but doubted if another one is far likelier.

    Raises
    ------
    CueError
        If too little of a face is seen.
    """
    if table.in_pixels:
        return Aspect(1.0)
    values = {aspect: _value(table, voice, aspect) for aspect in (*ASPECTS, *_also(told))}
    best = max(values, key=lambda aspect: values[aspect])
    if told is None:
        return Aspect(best, (f"the picture is taken to be {best:.3g} times as wide as high",))
    if values[best] - values[told] < _CERTAIN:
        return Aspect(told)
    return Aspect(
        told,
        (
            f"the picture is said to be {told:.3g} times as wide as high; the hand looks as if it "
            f"were {best:.3g}",
        ),
    )


def _also(told: float | None) -> tuple[float, ...]:
    return () if told is None else (told,)


def _value(table: LandmarkTable, voice: Voice, aspect: float) -> float:
    """Return the log likelihood of face and keys at an aspect, but for a constant."""
    value = -0.5 * (unlike_face(table, voice, aspect) / _FACES_DIFFER) ** 2
    seen = _glimpse(table, find_picture(table, voice, aspect=aspect))
    if seen is None:
        return value
    # Heights in the picture count in its own units, whatever they are taken to be in mm.
    squeezed = FRAME_SHARE * float(seen.steady().shown.sum()) * np.log(aspect)
    return float(value + line_value(seen) - squeezed)


def _glimpse(table: LandmarkTable, picture: Picture) -> HandFeatures | None:
    """Return the part of a take that shows the hand most; None if it shows none."""
    hand, face = picture.hand(table), picture.face(table)
    if hand is None:
        return None
    flat = np.concatenate([part.reshape(len(part), -1) for part in (face, hand)], axis=1)
    even, rate_hz = evenly(table.times, flat, name="landmarks")
    face = even[:, : face.shape[1] * 3].reshape(len(even), -1, 3)
    hand = even[:, face.shape[1] * 3 :].reshape(len(even), -1, 3)
    shown = np.concatenate([[0], np.cumsum(np.isfinite(hand[..., 0]).all(1))])
    size = min(len(even), round(_LOOKED_AT_S * rate_hz))
    first = int((shown[size:] - shown[: len(shown) - size]).argmax())
    part = slice(first, first + size)
    return see(face[part], hand[part], rate_hz=rate_hz)
