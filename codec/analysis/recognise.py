"""Gesture recogniser: which shape and which placement the hand shows in each frame.

One Gaussian per hand shape over seven characteristic distances, one per hand placement over the
position of the longest finger's tip in coordinates that move with the head; equal priors.
Source: Gibert, Bailly, Elisei 2004, section 4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cues.score import PLACEMENTS, SHAPES
from codec.errors import CueError

_RIGID_FACE = layout.marker_indices(layout.RIGID_FACE)
_TIPS = layout.marker_indices([finger[-1] for finger in layout.FINGERS])
_FIRST_PHALANGES = layout.marker_indices([finger[0] for finger in layout.FINGERS])
_PALM = layout.marker_indices(layout.PALM)
_LONGEST_TIP = layout.marker_indices([layout.longest_finger_tip(shape) for shape in SHAPES])

_SPREAD_FLOOR_MM = 1.0
"""Scatter in mm that every class has at least, so that few examples do not make it blind."""


def characteristic_distances(markers: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the seven distances that separate the hand shapes.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
        Millimetres.

    Returns
    -------
    ndarray of float64, shape (T, 7)
        First phalange to tip of thumb, index, middle, ring and little finger; tip of the index to
        tip of the middle finger; tip of the thumb to the palm.
    """
    x = np.asarray(markers, dtype=np.float64)
    tips, palm = x[:, _TIPS], x[:, _PALM].mean(1)
    return np.column_stack(
        [
            np.linalg.norm(tips - x[:, _FIRST_PHALANGES], axis=-1),
            np.linalg.norm(tips[:, 1] - tips[:, 2], axis=-1),
            np.linalg.norm(tips[:, 0] - palm, axis=-1),
        ]
    )


def pointing_tip(
    markers: NDArray[np.floating], shape: NDArray[np.integer], head: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the tip of the longest finger in coordinates that move with the head.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
    shape : ndarray of int, shape (T,)
        Hand shape of each frame: it decides which finger is the longest.
    head : ndarray of float64, shape (10, 3)
        Ears, nose and forehead of the head at rest, millimetres.

    Returns
    -------
    ndarray of float64, shape (T, 3)
        Millimetres; NaN where too few markers of the head are seen.
    """
    x = np.asarray(markers, dtype=np.float64)
    skull = x[:, _RIGID_FACE]
    motion, solved = rigid.estimate_motion(head, skull, np.isfinite(skull).all(-1))
    tip = x[np.arange(len(x)), _LONGEST_TIP[shape]]
    local = rigid.inverse_rigid_motion(tip[:, None], motion)[:, 0]
    return np.where(solved[:, None], local, np.nan)


@dataclass(frozen=True, slots=True)
class Gaussians:
    """One normal distribution per class.

    Attributes
    ----------
    means : ndarray of float64, shape (C, D)
        NaN for a class without examples: it is never recognised.
    covariances : ndarray of float64, shape (C, D, D)
    """

    means: NDArray[np.float64]
    covariances: NDArray[np.float64]

    @property
    def missing(self) -> tuple[int, ...]:
        """Classes without examples."""
        return tuple(np.flatnonzero(np.isnan(self.means).any(1)).tolist())

    def posteriors(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probability of each class, equal priors, shape (T, C); rows sum to 1.

        Frames that are not finite get equal probabilities: nothing is known of them.
        """
        known = np.asarray(np.isfinite(x).all(1))
        learnt = np.isfinite(self.means).all(1)
        deviation = np.where(known[:, None], x, 0.0)[:, None] - np.nan_to_num(self.means)
        precision = np.linalg.inv(self.covariances)
        _, volume = np.linalg.slogdet(self.covariances)
        log_density = -0.5 * (
            np.einsum("tci,cij,tcj->tc", deviation, precision, deviation, optimize=True) + volume
        )
        log_density[:, ~learnt] = -np.inf
        log_density[~known] = 0.0
        density = np.exp(log_density - log_density.max(1, keepdims=True))
        return np.asarray(density / density.sum(1, keepdims=True))


def fit_gaussians(
    x: NDArray[np.float64], labels: NDArray[np.integer], classes: int, *, what: str
) -> Gaussians:
    """Estimate one Gaussian per class.

    A class of few examples borrows the spread of all; one of none is `Gaussians.missing`.

    Raises
    ------
    CueError
        If fewer than two classes have examples, or none has two; `what` names the classes.
    """
    finite = np.isfinite(x).all(1)
    groups = [x[finite & (labels == label)] for label in range(classes)]
    if sum(len(own) > 0 for own in groups) < 2 or max(map(len, groups)) < 2:
        counts = ", ".join(f"{label}: {len(own)}" for label, own in enumerate(groups))
        raise CueError(f"too few targets to tell one {what} from another ({counts})")
    means = np.array([own.mean(0) if len(own) else np.full(x.shape[1], np.nan) for own in groups])
    scatters = [(own - mean).T @ (own - mean) for own, mean in zip(groups, means, strict=True)]
    size = np.array([len(own) for own in groups])
    common = sum(scatters, start=np.zeros((x.shape[1],) * 2)) / size.sum()
    # Few targets do not tell a covariance: that of all classes stands in for what is missing. The
    # floor is about a marker's own error: no class is surer than that.
    prior = float(x.shape[1])
    covariances = [
        (scatter + prior * common) / (count + prior) + _SPREAD_FLOOR_MM**2 * np.eye(x.shape[1])
        for scatter, count in zip(scatters, size, strict=True)
    ]
    return Gaussians(means, np.array(covariances))


@dataclass(frozen=True, slots=True)
class Recogniser:
    """Gaussians of shapes and placements of one cuer.

    Attributes
    ----------
    shapes : Gaussians
        Nine classes over seven distances.
    placements : Gaussians
        Six classes over the pointing tip.
    head : ndarray of float64, shape (10, 3)
        Rigid markers of the head at rest.
    """

    shapes: Gaussians
    placements: Gaussians
    head: NDArray[np.float64]

    def shape_posteriors(self, markers: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the probability of each hand shape in each frame, shape (T, 9)."""
        return self.shapes.posteriors(characteristic_distances(markers))

    def placement_posteriors(
        self, markers: NDArray[np.floating], shape: NDArray[np.integer] | None = None
    ) -> NDArray[np.float64]:
        """Return the probability of each placement in each frame, shape (T, 6).

        Parameters
        ----------
        markers : ndarray, shape (T, 113, 3)
        shape : ndarray of int, shape (T,), optional
            Hand shapes; default: the likeliest.
        """
        known = self.shape_posteriors(markers).argmax(1) if shape is None else shape
        return self.placements.posteriors(pointing_tip(markers, known, self.head))


def fit_recogniser(
    markers: NDArray[np.floating], shape: NDArray[np.integer], placement: NDArray[np.integer]
) -> Recogniser:
    """Learn a recogniser from labelled targets.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
        Frames with shape and placement held; hidden markers recovered.
    shape, placement : ndarray of int, shape (T,)
        Hand shape and index in `codec.cues.score.PLACEMENTS`.

    Raises
    ------
    CueError
        If no frame shows the head, or there are too few targets to separate classes.
    """
    skull = np.asarray(markers[:, _RIGID_FACE], dtype=np.float64)
    seen = np.isfinite(skull).all((1, 2))
    if not seen.any():
        raise CueError("no training frame shows all rigid markers of the head")
    head, motion = rigid.mean_body(skull[seen])
    head = head + motion[:, 3:].mean(0)
    return Recogniser(
        fit_gaussians(characteristic_distances(markers), shape, len(SHAPES), what="hand shape"),
        fit_gaussians(
            pointing_tip(markers, shape, head), placement, len(PLACEMENTS), what="placement"
        ),
        head,
    )
