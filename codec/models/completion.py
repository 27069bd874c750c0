"""Completion of the hand: where its hidden markers are, from those that are seen.

A folded finger turns its markers away from the cameras for as long as the shape is held; no path
between the moments before and after tells how far it is folded. What does tell is how this hand
folds: seen from the palm, the markers of all fingers follow a mixture of normal distributions,
learnt from frames of shapes and their transitions (corpus 1 shows nearly every marker) and from
sentences. Hidden markers are its expectation, given the visible ones. Twelve parameters drive
the markers afterwards (`codec.models.inversion`); completion itself is not bound to them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d
from scipy.signal import savgol_filter

from codec import layout
from codec.errors import CueError
from codec.models import rigid
from codec.models.bridging import bridge
from codec.models.hand import HandModel
from codec.models.inversion import invert_hand
from codec.models.mixture import Mixture, fit_mixture

CONFIDENCE = 0.3
"""Weight of a completed marker against a visible one: its error has about thrice the variance."""

_SMOOTHED_S = 0.025
_SUSPECT_MM = 12.0
_COMPONENTS = 28
_THINNED_S = 0.03
_LEAST_FRAMES = 200


def _columns(names: tuple[str, ...]) -> NDArray[np.intp]:
    return np.array([layout.HAND_MARKERS.index(name) for name in names])


PALM_COLUMNS = _columns((*layout.PALM, *layout.KNUCKLES[1:]))
"""Markers that carry the fingers."""

COMPLETED_COLUMNS = np.setdiff1d(
    np.arange(layout.N_HAND), _columns((*layout.WRIST, *layout.FOREARM))
)
"""Fingers, knuckles and palm: the markers that are completed."""


@dataclass(frozen=True, slots=True)
class HandCompletion:
    """What is known of one cuer's fingers.

    Attributes
    ----------
    palm : ndarray of float64, shape (8, 3)
        The palm's markers about their centre, millimetres.
    fingers : Mixture
        Of the coordinates of `COMPLETED_COLUMNS` in the palm's frame.
    """

    palm: NDArray[np.float64]
    fingers: Mixture

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
        calm = _smoothed(markers, visible, rate_hz)
        motion, solved = _palm_motion(self.palm, calm, visible)
        local = rigid.inverse_rigid_motion(calm, motion)[:, COMPLETED_COLUMNS]
        seen = visible[:, COMPLETED_COLUMNS] & solved[:, None]
        values = local.reshape(len(local), -1)
        share = self._share(values, np.repeat(seen, 3, axis=1), rate_hz)
        filled, surprise = self.fingers.complete(values, np.repeat(seen, 3, axis=1), share)
        off = np.linalg.norm(surprise.reshape(local.shape), axis=-1)
        # Only the worst of a frame is surely wrong: it makes its neighbours look wrong too.
        wrong = (off > _SUSPECT_MM) & (off >= 0.7 * off.max(1, keepdims=True))
        again = wrong.any(1)
        if again.any():
            seen = seen & ~wrong
            known = np.repeat(seen[again], 3, axis=1)
            share = self.fingers.responsibilities(values[again], known)
            filled[again], _ = self.fingers.complete(values[again], known, share)
        world = rigid.rigid_motion(filled.reshape(local.shape), motion)
        out, confidence = markers.copy(), visible.astype(np.float64)
        kept = np.where(seen[..., None], markers[:, COMPLETED_COLUMNS], world)
        use = solved[:, None] & np.ones_like(seen)
        out[:, COMPLETED_COLUMNS] = np.where(use[..., None], kept, markers[:, COMPLETED_COLUMNS])
        confidence[:, COMPLETED_COLUMNS] = np.where(
            use, np.where(seen, 1.0, CONFIDENCE), visible[:, COMPLETED_COLUMNS]
        )
        return out, confidence

    def _share(
        self, values: NDArray[np.float64], known: NDArray[np.bool_], rate_hz: float
    ) -> NDArray[np.float64]:
        """Return the responsibilities of each frame; between frames apart they change evenly."""
        step = max(1, round(_THINNED_S * rate_hz))
        at = np.unique(np.append(np.arange(0, len(values), step), len(values) - 1))
        share = self.fingers.responsibilities(values[at], known[at])
        place = np.interp(np.arange(len(values)), at, np.arange(len(at)))
        before = place.astype(int)
        after = np.minimum(before + 1, len(at) - 1)
        part = (place - before)[:, None]
        return np.asarray((1 - part) * share[before] + part * share[after])


def fit_completion(markers: NDArray[np.float64]) -> HandCompletion:
    """Learn how the fingers of a hand move together.

    Parameters
    ----------
    markers : ndarray of float64, shape (N, 50, 3)
        World coordinates, millimetres; NaN where hidden. Any frames, better of many shapes; every
        marker of fingers and palm has to be seen in some.

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
    motion, solved = _palm_motion(palm, x, visible)
    local = rigid.inverse_rigid_motion(x, motion)[solved][:, COMPLETED_COLUMNS]
    known = np.repeat(visible[solved][:, COMPLETED_COLUMNS], 3, axis=1)
    values = np.where(known, local.reshape(len(local), -1), 0.0)
    return HandCompletion(palm, fit_mixture(values, known, components=_COMPONENTS))


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


def _palm_motion(
    palm: NDArray[np.float64], markers: NDArray[np.float64], visible: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    return rigid.estimate_motion(palm, markers[:, PALM_COLUMNS], visible[:, PALM_COLUMNS])


def _smoothed(
    markers: NDArray[np.float64], visible: NDArray[np.bool_], rate_hz: float
) -> NDArray[np.float64]:
    """Return the markers without the noise of single frames, where enough frames show them.

    Parabolas over 50 ms follow the quickest gesture (Savitzky and Golay 1964); a far marker of a
    finger is expected from near ones, and their noise would grow with the lever.
    """
    window = 2 * round(_SMOOTHED_S * rate_hz) + 1
    if window <= 3 or len(markers) < window:
        return markers
    smooth = savgol_filter(markers, window, 2, axis=0)
    shown = minimum_filter1d(visible.astype(np.int8), window, axis=0, mode="constant") > 0
    return np.where(shown[..., None], smooth, markers)
