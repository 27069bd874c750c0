"""From the axes, units and size of a laboratory to the coordinates of a voice.

The head gives everything: direction of its markers, its size, and, where the file's unit is
missing or wrong, in which unit. The median pose of the head becomes the voice's head at rest. Which
hand cues follows from the mirror image that the hand model explains better. Contact is kept: who
touches her chin makes the voice touch hers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.inversion import invert_hand
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.points.framing import mirrored
from synth.capture.sources.recording import UNITS_MM

FloatArray = NDArray[np.float64]

LEAST_HEAD_MARKERS = 4
"""Markers of the head that give its turn and place: three, and one to doubt them by."""

_FIRM = layout.marker_indices(layout.RIGID_FACE)
_HALF_FIRM = layout.marker_indices((*layout.BROWS, *layout.CHEEKS, *layout.NASOLABIAL))

_SIZES = (0.7, 1.4)
"""Sizes of heads over the voice's, with room to distinguish units."""

_SAME_SIZE = 0.02
"""Difference of size below which a take counts as in the voice's own size."""

_SAME_TURN_RAD, _SAME_SHIFT_MM = 0.3, 25.0
"""Turn and shift below which it counts as in the voice's own coordinates."""

_MIRROR_GAIN = 0.6
"""Share of the error that the mirror image must fall below to be believed."""

_HAND_FRAMES = 24
"""Frames that decide which hand cues."""

_LEAST_HAND_MARKERS = 8
"""Markers of a hand that such a frame shows at least."""


@dataclass(frozen=True, slots=True)
class Registration:
    """How the points of a recording come to a voice's coordinates and size.

    Attributes
    ----------
    unit_mm : float
        Length of the file's unit, millimetres.
    scale : float
        Size of the speaker's head against the voice's.
    left_axes : bool
        The file's axes are a left-handed system.
    left_handed : bool
        The cuer uses her left hand: she is mirrored, names and all.
    motion : ndarray of float64, shape (6,)
        Rotation vector (radians) about the origin, then translation (mm), after scaling.
    notes : tuple of str
    """

    unit_mm: float
    scale: float
    left_axes: bool
    left_handed: bool
    motion: FloatArray
    notes: tuple[str, ...] = ()

    def apply(self, markers: FloatArray) -> FloatArray:
        """Return markers (T, 113, 3) of the file in the voice's coordinates; NaN stays NaN."""
        x = markers * (self.unit_mm / self.scale)
        if self.left_axes:
            x = x * np.array([-1.0, 1.0, 1.0])
        if self.left_handed:
            x = mirrored(x)
        return rigid.rigid_motion(x, self.motion) if self.motion.any() else x

    def points(self, points: FloatArray) -> FloatArray:
        """Return points that are no markers (T, G, 3) in the voice's coordinates."""
        x = points * (self.unit_mm / self.scale)
        if self.left_axes != self.left_handed:
            x = x * np.array([-1.0, 1.0, 1.0])
        return rigid.rigid_motion(x, self.motion) if self.motion.any() else x


def find_place(markers: FloatArray, unit: str, voice: Voice) -> Registration:
    """Return how a recording comes to the coordinates of `voice`.

    Parameters
    ----------
    markers : ndarray of float64, shape (T, 113, 3)
        Some frames from all over it, in the file's unit; NaN where hidden.
    unit : str
        As the file names it; may be empty.
    voice : Voice

    Raises
    ------
    CueError
        If too little of the head is seen, or it has the size of no head in any unit.
    """
    columns = _head_columns(markers)
    body, shift = median_body(markers[:, columns])
    known = np.isfinite(body).all(-1)
    if known.sum() < LEAST_HEAD_MARKERS:
        raise CueError(
            f"{len(columns)} markers of ears, nose, forehead, brows and cheeks are seen, "
            f"{LEAST_HEAD_MARKERS} needed at a time to know the head"
        )
    columns, body = columns[known], body[known]
    unit_mm, scale, notes = _size(body, columns, unit, voice)
    factor = unit_mm / scale
    # Both kinds of axes are fitted; the left-handed ones have to be clearly better.
    best = _fit(body * factor, columns, voice)
    turned = _fit(body * factor * [-1.0, 1.0, 1.0], columns, voice)
    left_axes = turned[1] < _MIRROR_GAIN * best[1]
    motion = turned[0] if left_axes else best[0]
    centre = shift * factor * ([-1.0, 1.0, 1.0] if left_axes else [1.0, 1.0, 1.0])
    motion = rigid.compose(motion, [0.0, 0.0, 0.0, *-centre])
    if left_axes:
        notes.append("the axes are a left-handed system")
    place = Registration(unit_mm, scale, left_axes, False, motion, tuple(notes))
    if _uses_left_hand(markers, place, voice):
        return _mirror(markers, place, voice)
    return _calm(place)


def shows_head(markers: FloatArray) -> bool:
    """Return whether frames (T, 113, 3) ever show enough of a head to know where it is."""
    body, _ = median_body(markers[:, _head_columns(markers)])
    return bool(np.isfinite(body).all(-1).sum() >= LEAST_HEAD_MARKERS)


def hand_error(hand: FloatArray, voice: Voice) -> float:
    """Return the median distance in mm of some frames (T, 50, 3) from the hand model."""
    count = np.isfinite(hand).all(-1).sum(1)
    best = np.argsort(-count, kind="stable")[:_HAND_FRAMES]
    best = best[count[best] >= _LEAST_HAND_MARKERS]
    if not len(best):
        return float("inf")
    seen = np.asarray(np.isfinite(hand[best]).all(-1))
    x = np.where(seen[..., None], hand[best], 0.0)
    gap = np.linalg.norm(voice.hand.reconstruct(invert_hand(voice.hand, x, seen)) - x, axis=-1)
    return float(np.median(gap[seen]))


def _calm(place: Registration) -> Registration:
    """Return `place` without a change if the recording is in the voice's coordinates already."""
    small = (
        np.linalg.norm(place.motion[:3]) < _SAME_TURN_RAD
        and np.linalg.norm(place.motion[3:]) < _SAME_SHIFT_MM
        and abs(place.scale - 1.0) < _SAME_SIZE
    )
    if not small or place.left_axes or place.left_handed:
        return place
    return Registration(place.unit_mm, 1.0, False, False, np.zeros(6), place.notes)


def _mirror(markers: FloatArray, place: Registration, voice: Voice) -> Registration:
    """Return the place of the mirror image."""
    plain = Registration(place.unit_mm, place.scale, place.left_axes, True, np.zeros(6))
    flipped = plain.apply(markers)
    columns = _head_columns(flipped)
    body, shift = median_body(flipped[:, columns])
    known = np.isfinite(body).all(-1)
    motion, _ = _fit(body[known], columns[known], voice)
    motion = rigid.compose(motion, [0.0, 0.0, 0.0, *-shift])
    notes = (*place.notes, "the left hand cues: mirrored")
    return Registration(place.unit_mm, place.scale, place.left_axes, True, motion, notes)


def _head_columns(markers: FloatArray) -> NDArray[np.intp]:
    """Return the markers that give the head's pose: firm ones, if need be half firm ones too."""
    seen = np.isfinite(markers).all(-1).mean(0)
    firm = _FIRM[seen[_FIRM] > 0.05]
    if len(firm) > LEAST_HEAD_MARKERS:
        return np.asarray(firm)
    half = _HALF_FIRM[seen[_HALF_FIRM] > 0.05]
    return np.concatenate([firm, half])


def median_body(x: FloatArray, *, rounds: int = 4) -> tuple[FloatArray, FloatArray]:
    """Return the shape of a body in its middle pose, about the origin, and where that is.

    Parameters
    ----------
    x : ndarray of float64, shape (T, K, 3)
        NaN where hidden.

    Returns
    -------
    body : ndarray of float64, shape (K, 3)
        NaN for a marker that is never seen beside enough others.
    shift : ndarray of float64, shape (3,)
        Middle position of its centre.
    """
    seen = np.asarray(np.isfinite(x).all(-1))
    filled = np.where(seen[..., None], x, 0.0)
    if not seen.sum(1).max(initial=0) >= 3:
        return np.full(x.shape[1:], np.nan), np.zeros(3)
    body = x[seen.sum(1).argmax()].copy()
    body -= np.nanmean(body, axis=0)
    shift = np.zeros(3)
    for _ in range(rounds):
        known = np.isfinite(body).all(-1)
        size = float(np.linalg.norm(np.nan_to_num(body), axis=1).max())
        # In turns: every frame's motion of the body so far; the body as the median of the frames
        # when they are moved back.
        motion, solved = rigid.estimate_motion(
            np.nan_to_num(body), filled, (seen & known).astype(float), outlier_mm=0.05 * size
        )
        local = rigid.inverse_rigid_motion(filled[solved], motion[solved])
        hidden = ~seen[solved]
        local[hidden] = np.nan
        shown = ~hidden.all(0)
        body = np.full(body.shape, np.nan)
        body[shown] = np.nanmedian(local[:, shown], axis=0)
        turn = geometric_median(motion[solved, :3])
        centre = np.nanmean(body, axis=0)
        shift = geometric_median(rigid.rigid_motion(centre[None, None], motion[solved])[:, 0])
        body = rigid.rigid_motion(body - centre, [*turn, 0.0, 0.0, 0.0])
    return body, shift


def geometric_median(x: FloatArray, *, rounds: int = 30) -> FloatArray:
    """Return the point of least summed distance from points (N, 3), whatever their axes.

    Weiszfeld's iteration (1937).
    """
    middle = x.mean(0)
    for _ in range(rounds):
        weight = 1.0 / np.maximum(np.linalg.norm(x - middle, axis=1), 1e-6)
        middle = weight @ x / weight.sum()
    return np.asarray(middle)


def _size(
    body: FloatArray, columns: NDArray[np.intp], unit: str, voice: Voice
) -> tuple[float, float, list[str]]:
    """Return the unit in millimetres, the head's size against the voice's, and remarks."""
    reference = voice.face.mean[columns].astype(np.float64)
    ratio = distance_ratio(body, reference)
    unit_mm = unit_of(ratio, unit, "head")
    if unit in UNITS_MM and UNITS_MM[unit] == unit_mm:
        return unit_mm, ratio * unit_mm, []
    name = next(name for name, mm in UNITS_MM.items() if mm == unit_mm)
    said = f"the file says {unit!r}" if unit else "the file names none"
    return unit_mm, ratio * unit_mm, [f"unit {name} by the size of the head; {said}"]


def unit_of(ratio: float, unit: str, what: str) -> float:
    """Return the unit in mm that makes distances those of a head or hand."""
    low, high = _SIZES
    units = (UNITS_MM[unit],) if unit in UNITS_MM else ()
    for mm in (*units, 1.0, 1000.0, 10.0, 100.0):
        if low <= ratio * mm <= high:
            return float(mm)
    raise CueError(
        f"the {what}'s markers have {ratio:.3g} times the distances of a {what} in millimetres: "
        "other points under these names, or an unknown unit"
    )


def distance_ratio(a: FloatArray, b: FloatArray) -> float:
    """Return how much farther apart the points of `a` are than those of `b`, both (N, 3)."""
    rows, columns = np.triu_indices(len(a), 1)
    of_a, of_b = (np.linalg.norm(x[rows] - x[columns], axis=1) for x in (a, b))
    return float(np.median(of_a / of_b))


def _fit(body: FloatArray, columns: NDArray[np.intp], voice: Voice) -> tuple[FloatArray, float]:
    """Return the motion of a body of the voice's size to the head at rest, and the error, mm."""
    rest = voice.face.reconstruct(np.zeros((1, voice.face.n_parameters)))[0, columns]
    motion, _ = rigid.estimate_motion(body, rest[None], outlier_mm=25.0)
    gap = np.linalg.norm(rigid.rigid_motion(body, motion)[0] - rest, axis=1)
    return motion[0], float(np.sqrt((gap**2).mean()))


def _uses_left_hand(markers: FloatArray, place: Registration, voice: Voice) -> bool:
    """Return whether the hand model explains the mirror image of the hand better."""
    upright = place.apply(markers)[:, layout.N_FACE :]
    as_it_is, mirror = (hand_error(upright * [flip, 1.0, 1.0], voice) for flip in (1.0, -1.0))
    return bool(mirror < as_it_is)


_REACH_MM = 30.0
"""Distance in mm over which what touches a point of the face follows it less and less."""


@dataclass(frozen=True, slots=True)
class Contact:
    """Where points of the speaker's face lie against the voice's, head at rest.

    Attributes
    ----------
    at : ndarray of float64, shape (N, 3)
        On the speaker, in the voice's coordinates and size, mm.
    gap : ndarray of float64, shape (N, 3)
        From the voice's point to the speaker's.
    """

    at: FloatArray
    gap: FloatArray

    def to_voice(self, points: FloatArray) -> FloatArray:
        """Return how points (T, 3) near the resting face have to move, shape (T, 3), mm.

        Examples
        --------
        >>> chin = Contact(np.array([[0.0, -90.0, 90.0]]), np.array([[0.0, 4.0, 0.0]]))
        >>> chin.to_voice(np.array([[-10.0, -95.0, 95.0]])).tolist()
        [[0.0, -4.0, 0.0]]
        """
        if not len(self.at):
            return np.zeros_like(points)
        away = ((points[:, None] - self.at) ** 2).sum(-1)
        # The nearest point always counts, however far it is.
        share = np.exp(-0.5 * (away - away.min(1, keepdims=True)) / _REACH_MM**2)
        share /= share.sum(1, keepdims=True)
        return np.asarray(-share @ self.gap)


NO_CONTACT = Contact(np.zeros((0, 3)), np.zeros((0, 3)))
"""Of the voice herself."""
