"""How far each finger is closed: a feature of hand shapes that holds for any hand.

Seen from the palm, each finger lies between where it is in the open hand and where it is in the
fist: 0 to 1. Six numbers, with the distance between the tips of index and middle finger. Image
trackers read folded fingers as half open, each person's in another way; over a take that shows
fingers open and closed the scale can be found.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.hand import HandModel
from codec.cuer.voice import Voice

FloatArray = NDArray[np.float64]

N_FEATURES = 6
"""Closures of the five digits, and the spread of index and middle finger."""

_OPEN, _FIST = 5, 0
"""Shapes whose closures are 0 and 1."""

_SPREAD_MM = 125.0
"""Distance in mm between two finger tips that counts as 1."""

_EDGES = (0.1, 0.9)
"""Quantiles that a take's closures are stretched between."""

_LEAST_RANGE = 0.4
"""Range of closures (0 open, 1 closed) of a finger: with less over a take it has not been both."""

_LEAST_FRAMES = 50
"""Frames that such quantiles need."""

_RIDGE = 1e-2
"""Weight of the ridge, for features of unit spread."""

_PIECE = 4096
"""Frames that are looked at at once, for constant memory."""

_PALM = np.array([layout.HAND_MARKERS.index(n) for n in (*layout.KNUCKLES[1:], *layout.PALM)])
_FINGERS = np.array(
    [[layout.HAND_MARKERS.index(n) for n in finger[1:]] for finger in layout.FINGERS]
)


def closures(voice: Voice, shape: NDArray[np.floating]) -> FloatArray:
    """Return the closures of hand parameters.

    Parameters
    ----------
    voice : Voice
    shape : ndarray, shape (T, 12)

    Returns
    -------
    ndarray of float64, shape (T, 6)
        Of thumb to little finger, 0 open to 1 as in the fist; then the distance of index and
        middle finger's tips, in units of that between a straight and a folded one.

    Examples
    --------
    >>> from codec.cuer.voice import load_voice
    >>> voice = load_voice()
    >>> closures(voice, voice.gestures.shape_targets[[5, 0, 1]])[:, 1:3].round(1) + 0
    array([[0., 0.],
           [1., 1.],
           [0., 1.]])
    """
    out = np.empty((len(shape), N_FEATURES))
    for begin in range(0, len(shape), _PIECE):
        part = slice(begin, begin + _PIECE)
        out[part] = _of_markers(voice, voice.hand.shape(shape[part]))
    return out


def _of_markers(voice: Voice, markers: FloatArray) -> FloatArray:
    ends = _ends(voice)
    fingers = _in_palm(voice.hand, markers, ends[0])
    away = ends[2] - ends[1]
    closed = np.einsum("tfmc,fmc->tf", fingers - ends[1], away) / (away**2).sum((1, 2))
    apart = np.linalg.norm(fingers[:, 1, -1] - fingers[:, 2, -1], axis=-1) / _SPREAD_MM
    return np.column_stack([closed, apart])


def _ends(voice: Voice) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the palm (8, 3) at rest, and the fingers (5, 3, 3) of open hand and fist in it."""
    markers = voice.hand.shape(voice.gestures.shape_targets[[_OPEN, _FIST]])
    palm = markers[0, _PALM] - markers[0, _PALM].mean(0)
    opened, closed = _in_palm(voice.hand, markers, palm)
    return palm, opened, closed


def _in_palm(model: HandModel, markers: FloatArray, palm: FloatArray) -> FloatArray:
    """Return the markers of the fingers in the palm's frame, shape (T, 5, 3, 3)."""
    motion, _ = rigid.estimate_motion(palm, markers[:, _PALM])
    flat = rigid.inverse_rigid_motion(markers[:, _FINGERS.ravel()], motion)
    return flat.reshape(len(markers), *_FINGERS.shape, 3)


def rescaled(voice: Voice, shape: FloatArray, told: NDArray[np.bool_]) -> FloatArray:
    """Return hand parameters whose fingers open and close as far as the voice's.

    Parameters
    ----------
    voice : Voice
    shape : ndarray of float64, shape (T, 12)
    told : ndarray of bool, shape (T,)
        Frames that show the hand.

    Notes
    -----
    The tenths of the frames with a finger most open and most closed are taken for as open
    and as closed as it gets among the voice's shapes. A finger that does not move enough for that
    keeps its scale.
    """
    if told.sum() < _LEAST_FRAMES:
        return shape
    found = closures(voice, shape)
    targets = closures(voice, voice.gestures.shape_targets)
    low, high = np.quantile(found[told, :5], _EDGES, axis=0)
    least, most = np.quantile(targets[:, :5], _EDGES, axis=0)
    wide = high - low >= _LEAST_RANGE * (most - least)
    gain = np.where(wide, (most - least) / np.where(wide, high - low, 1.0), 1.0)
    wanted = np.where(wide, least + (found[:, :5] - low) * gain, found[:, :5])
    # What a change of closures means in parameters is told by the voice's own shapes.
    system = np.column_stack([np.ones(len(targets)), targets])
    gram = system.T @ system + _RIDGE * np.eye(system.shape[1])
    by_closure = np.linalg.solve(gram, system.T @ voice.gestures.shape_targets)[1:6]
    moved = (np.clip(wanted, -0.3, 1.3) - found[:, :5]) @ by_closure
    return np.asarray(shape + np.where(wide.any(), moved, 0.0))
