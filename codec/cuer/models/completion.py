"""Completion of the hand: where its hidden markers are, from those that are seen.

A folded finger turns its markers away from the cameras for as long as the shape is held; no path
between the moments before and after shows how far it is folded. The way this hand
folds does: seen from the palm, the markers of each digit follow a mixture of normal distributions,
learnt from frames of shapes and their transitions (corpus 1 shows nearly every marker) and from
sentences. Digits are learnt one by one, for a folded finger is folded alike in many shapes: all of
them are examples for it. Hidden markers are the expectation, given the visible ones; where markers
come and go it is blended over time. Twelve parameters drive the
markers afterwards (`codec.cuer.models.inversion`); completion itself is not bound to them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import bridge, invert_hand
from codec.cuer.models.mixture import Mixture, fit_mixture
from codec.errors import CueError

CONFIDENCE = 0.3
"""Weight of a completed marker against a visible one: its error has about thrice the variance."""

_SMOOTHED_S = 0.025
"""Half length in seconds of the smoothing before completion: half a tracker's frame each way."""

_SUSPECT_MM = 12.0
"""Least distance in mm from its expectation of a marker that counts as another one's: a finger's
width."""

_COMPONENTS = 12
"""Normal distributions of a digit: nine shapes and the ways between them."""

_LEAST_FRAMES = 200
"""Frames with a whole palm that a fit needs, four seconds at 50 Hz."""


def _columns(names: tuple[str, ...]) -> NDArray[np.intp]:
    return np.array([layout.HAND_MARKERS.index(name) for name in names])


PALM_COLUMNS = _columns((*layout.PALM, *layout.KNUCKLES[1:]))
"""Markers that carry the fingers."""

DIGIT_COLUMNS = tuple(
    _columns(
        (
            *layout.FINGERS[digit - 1],
            f"S{digit}",
            f"K{digit}",
            *((f"P{digit}",) if digit > 1 else ()),
        )
    )
    for digit in range(1, 6)
)
"""Markers that are completed with each digit: its own and those of the palm at its root."""

COMPLETED_COLUMNS = np.sort(np.concatenate(DIGIT_COLUMNS))
"""Fingers, knuckles and palm: the markers that are completed."""

_CONSIDERED_COLUMNS = tuple(
    np.concatenate([own, np.setdiff1d(PALM_COLUMNS, own)]) for own in DIGIT_COLUMNS
)


@dataclass(frozen=True, slots=True)
class HandCompletion:
    """A model of one cuer's fingers.

    Attributes
    ----------
    palm : ndarray of float64, shape (8, 3)
        The palm's markers about their centre, millimetres.
    digits : tuple of Mixture
        Per digit, of the coordinates of its own markers (`DIGIT_COLUMNS`), then of the rest of the
        palm, in the palm's frame.
    """

    palm: NDArray[np.float64]
    digits: tuple[Mixture, ...]

    def complete(
        self, markers: NDArray[np.float64], visible: NDArray[np.bool_], *, rate_hz: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the markers of the hand with its fingers and palm completed.

        Markers that contradict all others (swapped neighbours, ghosts) count as hidden.

        Parameters
        ----------
        markers : ndarray of float64, shape (T, 50, 3)
            Consecutive frames, world coordinates, millimetres; hidden markers may hold anything
            finite.
        visible : ndarray of bool, shape (T, 50)
        rate_hz : float

        Returns
        -------
        completed : ndarray of float64, shape (T, 50, 3)
        confidence : ndarray of float64, shape (T, 50)
            1 where a marker was seen, `CONFIDENCE` where it was completed, 0 where it stays
            unknown: on wrist and forearm, and where the palm itself is hidden.
        """
        local, motion, solved = _in_palm(
            self.palm, smoothed(markers, visible, rate_hz=rate_hz), visible
        )
        seen = visible & solved[:, None]
        filled, surprise = self._expected(local, seen)
        off = np.linalg.norm(surprise, axis=-1)
        # Only the worst of a frame is surely wrong: it makes its neighbours look wrong too.
        wrong = (off > _SUSPECT_MM) & (off >= 0.7 * off.max(1, keepdims=True))
        if wrong.any():
            seen &= ~wrong
            again = wrong.any(1)
            filled[again], _ = self._expected(local[again], seen[again])
        filled += blend(self._steps(local, filled, seen), seen, rate_hz=rate_hz)
        columns = COMPLETED_COLUMNS
        out, confidence = markers.copy(), visible.astype(np.float64)
        use = solved[:, None] & ~seen[:, columns]
        world = rigid.rigid_motion(filled[:, columns], motion)
        out[:, columns] = np.where(use[..., None], world, markers[:, columns])
        confidence[:, columns] = np.where(use, CONFIDENCE, confidence[:, columns])
        return out, confidence

    def _expected(
        self, local: NDArray[np.float64], seen: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the markers with hidden ones expected, and how far seen ones are off, (T, 50, 3).

        Both in the palm's frame.
        """
        filled, surprise = local.copy(), np.zeros_like(local)
        for digit, own in enumerate(DIGIT_COLUMNS):
            filled[:, own], surprise[:, own] = self._expected_digit(digit, local, seen)
        return filled, surprise

    def _steps(
        self, local: NDArray[np.float64], filled: NDArray[np.float64], seen: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return how `filled` (T, 50, 3) steps where the markers that are seen change.

        The displacement explained by markers visible on both sides of the step is subtracted.
        """
        both, change = seen[1:] & seen[:-1], seen[1:] != seen[:-1]
        steps = np.zeros((len(both), *local.shape[1:]))
        for digit, own in enumerate(DIGIT_COLUMNS):
            at = np.flatnonzero(change[:, _CONSIDERED_COLUMNS[digit]].any(1))
            for side, sign in ((0, -1.0), (1, 1.0)):
                expected, _ = self._expected_digit(digit, local[at + side], both[at])
                steps[np.ix_(at, own)] += sign * (filled[np.ix_(at + side, own)] - expected)
        return steps

    def _expected_digit(
        self, digit: int, local: NDArray[np.float64], seen: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the same for the markers of a digit, shape (T, number of markers, 3)."""
        mixture, own = self.digits[digit], len(DIGIT_COLUMNS[digit])
        values, known = _rows(local, seen, _CONSIDERED_COLUMNS[digit])
        filled, surprise = mixture.complete(values, known, mixture.responsibilities(values, known))
        shape = (len(local), own, 3)
        return filled[:, : 3 * own].reshape(shape), surprise[:, : 3 * own].reshape(shape)


def _rows(
    local: NDArray[np.float64], seen: NDArray[np.bool_], columns: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the coordinates of some markers in rows (T, 3 n), and which are known."""
    values = local[:, columns].reshape(len(local), 3 * len(columns))
    return values, np.repeat(seen[:, columns], 3, axis=1)


def fit_completion(markers: NDArray[np.float64]) -> HandCompletion:
    """Learn how the fingers of a hand move together.

    Parameters
    ----------
    markers : ndarray of float64, shape (N, 50, 3)
        World coordinates, millimetres; NaN where hidden. Any frames, better of many shapes, and
        `smoothed`, as they are when markers are completed; every marker of fingers and palm has to
        be seen in some.

    Raises
    ------
    CueError
        If hardly any frame shows the palm, or a marker is never seen.
    """
    visible = np.asarray(np.isfinite(markers).all(-1))
    x = np.where(visible[..., None], markers, 0.0)
    whole = visible[:, PALM_COLUMNS].all(1)
    if whole.sum() < _LEAST_FRAMES:
        raise CueError(f"{whole.sum()} frames show the whole palm, {_LEAST_FRAMES} needed")
    palm, _ = rigid.mean_body(x[whole][:, PALM_COLUMNS])
    local, _, solved = _in_palm(palm, x, visible)
    local, visible = local[solved], visible[solved]
    digits = []
    for columns in _CONSIDERED_COLUMNS:
        values, known = _rows(local, visible, columns)
        digits.append(fit_mixture(np.where(known, values, 0.0), known, components=_COMPONENTS))
    return HandCompletion(palm, tuple(digits))


def recover_hand(
    model: HandModel,
    completion: HandCompletion,
    markers: NDArray[np.float64],
    visible: NDArray[np.bool_],
    *,
    rate_hz: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the parameters of a recording with gaps, and its markers without them.

    Parameters
    ----------
    model : HandModel
    completion : HandCompletion
    markers, visible, rate_hz
        As for `HandCompletion.complete`.

    Returns
    -------
    parameters : ndarray of float64, shape (T, naH + nmH)
    recovered : ndarray of float64, shape (T, 50, 3)
        Seen markers as they were seen, hidden ones completed; what completion leaves unknown is
        the model's.
    """
    completed, confidence = completion.complete(markers, visible, rate_hz=rate_hz)
    found = invert_hand(model, completed, confidence)
    if not confidence[:, COMPLETED_COLUMNS].all():
        found = bridge(model, completed, confidence, found, rate_hz=rate_hz)
    unknown = confidence == 0
    if unknown.any():
        completed[unknown] = model.reconstruct(found)[unknown]
    return found, completed


def smoothed(
    markers: NDArray[np.float64], visible: NDArray[np.bool_], *, rate_hz: float
) -> NDArray[np.float64]:
    """Return the markers without the noise of single frames, where enough frames show them.

    Parabolas over 50 ms follow the quickest gesture (Savitzky and Golay 1964); a far marker of a
    finger is expected from near ones, and their noise would grow with the lever.

    Parameters
    ----------
    markers, visible, rate_hz
        As for `HandCompletion.complete`.
    """
    window = 2 * round(_SMOOTHED_S * rate_hz) + 1
    if window <= 3 or len(markers) < window:
        return markers
    from scipy.signal import savgol_filter  # 2 s and 50 MB, needed only here

    smooth = savgol_filter(markers, window, 2, axis=0)
    shown = minimum_filter1d(visible.astype(np.int8), window, axis=0, mode="constant") > 0
    return np.where(shown[..., None], smooth, markers)


def _in_palm(
    palm: NDArray[np.float64], markers: NDArray[np.float64], visible: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return the markers in the palm's frame, its motion, and where that is known."""
    motion, solved = rigid.estimate_motion(palm, markers[:, PALM_COLUMNS], visible[:, PALM_COLUMNS])
    return rigid.inverse_rigid_motion(markers, motion), motion, solved


MEMORY_S = 0.02
"""Time constant in seconds: knowledge of a hidden marker fades."""


def blend(
    steps: NDArray[np.float64], seen: NDArray[np.bool_], *, rate_hz: float
) -> NDArray[np.float64]:
    """Return the corrections of the expected positions of hidden markers.

    Parameters
    ----------
    steps : ndarray of float64, shape (T - 1, K, C)
        How much more a marker moves from frame to frame than the same known markers account for:
        zero unless the known ones change.
    seen : ndarray of bool, shape (T, K)
        Nothing is added where a marker is seen.
    rate_hz : float

    Returns
    -------
    ndarray of float64, shape (T, K, C)

    Examples
    --------
    A marker seen at 5 is expected at 1 when it is hidden for a moment.

    >>> seen = np.array([[True], [False], [True]])
    >>> steps = np.array([-4.0, 4.0]).reshape(2, 1, 1)
    >>> blend(steps, seen, rate_hz=100.0)[:, 0, 0].round(1).tolist()
    [0.0, 3.6, 0.0]
    """
    from codec.cuer.models import _kernels

    out = np.zeros((len(seen), *steps.shape[1:]))
    stiffness = 1.0 / (MEMORY_S * rate_hz) ** 2
    _kernels.blend_into(
        np.ascontiguousarray(steps), np.ascontiguousarray(seen), stiffness, np.empty(len(seen)), out
    )
    return out
