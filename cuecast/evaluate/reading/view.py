"""The reader's view: landmarks of hand and lips, against the head, in widths of it.

Depth is not used. Nothing but the picture's plane comes in, so that films of people, simulated
films and tracked pictures of the avatar are the same to her.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from synth.capture.sources.landmark_maps import FACE_LANDMARKS

FloatArray = NDArray[np.float64]

RATE_HZ = 30.0
"""Frames per second that all takes are brought to."""

_EARS = (234, 454)
"""Landmarks of the face's sides."""

_CORNERS = (61, 291)
"""Landmarks of the corners of the mouth."""

_LIPS = (*_CORNERS, 0, 17, 39, 269, 181, 405, 40, 270, 91, 321)
"""Landmarks of the outer lips, corners first."""

_FINGERS = ((5, 8), (9, 12), (13, 16), (17, 20), (5, 4), (12, 8))
"""Landmarks that give the hand's shape: knuckles and tips, thumb, the spread."""

_PALM = [0, 5, 9, 13, 17]
"""Landmarks whose mean is the palm."""

_SMOOTHED = 5
"""Frames over which positions and speed are smoothed."""

_BRIDGED = 4
"""Frames for which a tracker may lose the hand."""

_STILL = 0.1
"""Speed, in head's widths a second, below which speeds look alike."""

_RAISED = -1.0
"""Height of the finger tip against the mouth above which the hand is up, in head's widths."""


@dataclass(frozen=True, slots=True)
class TakeView:
    """A take of T frames, in widths of the head or lengths of the palm; x to the viewer's right.

    Attributes
    ----------
    fingers : ndarray of float64, shape (T, 12)
        Tips against knuckles, thumb and spread, across the palm and along it, in its lengths.
    tips : ndarray of float64, shape (T, 4)
        Index and middle finger against the resting mouth.
    speed : ndarray of float64, shape (T, 1)
        Natural logarithm of the palm's speed, in head's widths a second.
    lips : ndarray of float64, shape (T, 24)
        Outer lips against the middle of their corners.
    shown : ndarray of bool, shape (T,)
        Whether the hand is seen; elsewhere its values are made up.
    """

    fingers: FloatArray
    tips: FloatArray
    speed: FloatArray
    lips: FloatArray
    shown: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.shown)

    @property
    def raised(self) -> NDArray[np.bool_]:
        """Frames with the hand up, shape (T,)."""
        return np.asarray(self.shown & (self.tips[:, 3] > _RAISED))


def view(face: FloatArray, hand: FloatArray) -> TakeView:
    """Return the reader's view of landmarks.

    Parameters
    ----------
    face : ndarray of float64, shape (T, L, 2)
        Landmarks `synth.capture.sources.landmark_maps.FACE_LANDMARKS`, at `RATE_HZ`; y up, any
        unit that is the same in both directions. NaN where not seen.
    hand : ndarray of float64, shape (T, 21, 2)
        Of the cueing hand, likewise.
    """
    right, left = (_filled(face[:, FACE_LANDMARKS.index(number)]) for number in _EARS)
    across, middle = left - right, 0.5 * (left + right)
    width = float(np.median(np.linalg.norm(across, axis=1)))
    lips = np.stack([_filled(face[:, FACE_LANDMARKS.index(n)]) for n in _LIPS], axis=1)
    hand, lips = (_upright(points, across, middle) / width for points in (hand, lips))
    mouth = lips[:, : len(_CORNERS)].mean(axis=1)
    hand = hand - np.median(mouth, axis=0)
    seen = np.asarray(np.isfinite(hand).all((1, 2)))
    whole = _filled(hand.reshape(len(hand), -1)).reshape(hand.shape)
    whole = savgol_filter(whole, _SMOOTHED, 2, axis=0, mode="nearest")
    moved = savgol_filter(
        whole[:, _PALM].mean(1), _SMOOTHED, 2, deriv=1, delta=1 / RATE_HZ, axis=0, mode="nearest"
    )
    return TakeView(
        _fingers(whole),
        whole[:, [8, 12]].reshape(len(whole), -1),
        np.log(np.linalg.norm(moved, axis=1) + _STILL)[:, None],
        (lips - mouth[:, None]).reshape(len(lips), -1),
        _bridged(seen),
    )


def with_usual_lips(views: Sequence[TakeView], usual: Sequence[TakeView]) -> list[TakeView]:
    """Return the views of one cuer with lips of the mean and spread that the reader is used to.

    Of keys nothing is brought to a usual mean or spread: whoever moves otherwise has to be read so.
    """
    if not any(one.raised.any() for one in views):
        return list(views)
    own, known = (
        np.concatenate([one.lips[one.raised] for one in group]) for group in (views, usual)
    )
    gain = known.std(0) / np.maximum(own.std(0), 1e-9)
    return [replace(one, lips=(one.lips - own.mean(0)) * gain + known.mean(0)) for one in views]


def _upright(points: FloatArray, across: FloatArray, middle: FloatArray) -> FloatArray:
    """Return points (T, N, 2) against the middle of a head that stands upright."""
    along = across / np.linalg.norm(across, axis=1, keepdims=True)
    up = np.stack([-along[:, 1], along[:, 0]], axis=1)
    axes = np.stack([along, up], axis=2)
    return np.asarray((points - middle[:, None]) @ axes)


def _fingers(hand: FloatArray) -> FloatArray:
    palm = 0.5 * (hand[:, 9] + hand[:, 13]) - hand[:, 0]
    length = np.maximum(np.linalg.norm(palm, axis=1, keepdims=True), 1e-6)
    along = palm / length
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    # Towards the thumb, whichever hand it is and however it is turned.
    side = np.sign(((hand[:, 5] - hand[:, 17]) * across).sum(1, keepdims=True))
    axes = np.stack([across * np.where(side == 0, 1.0, side), along], axis=2)
    spans = np.stack([hand[:, tip] - hand[:, knuckle] for knuckle, tip in _FINGERS], axis=1)
    return np.asarray((spans @ axes / length[:, None]).reshape(len(hand), -1))


def _filled(x: FloatArray) -> FloatArray:
    """Return values (T, C) without gaps; zeros where nothing is ever seen."""
    known = np.isfinite(x).all(1)
    if not known.any():
        return np.zeros_like(x)
    frames = np.arange(len(x))
    return np.stack([np.interp(frames, frames[known], column[known]) for column in x.T], axis=1)


def _bridged(seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    out, at = seen.copy(), np.flatnonzero(seen)
    for one, other in itertools.pairwise(at.tolist()):
        if other - one <= _BRIDGED + 1:
            out[one:other] = True
    return out
