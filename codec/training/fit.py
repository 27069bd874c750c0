"""A voice from three sets of labelled marker frames, the paper's three corpora."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer import layout
from codec.cuer.gestures import N_SHAPES, GestureTable
from codec.cuer.models import rigid
from codec.cuer.models.face import N_FACE_PARAMETERS, FaceModel
from codec.cuer.models.hand import N_HAND_PARAMETERS, HandModel
from codec.cuer.models.inversion import (
    FOREARM_COLUMNS,
    RIGID_FACE_COLUMNS,
    invert_face,
    invert_hand,
)
from codec.cuer.models.pca import single
from codec.cuer.voice import Voice
from codec.cues.phonology import PHONES
from codec.cues.score import PLACEMENTS
from codec.errors import CueError
from codec.training.fit_face import fit_face
from codec.training.fit_hand import LEAST_FRAMES, fit_hand

UNLABELLED = -1
"""Label of a frame that belongs to no class."""

_LEVER_MM = 100.0
"""Millimetres that a radian of turn counts for: a point of the head is about so far from its
pivot."""

_FACE = slice(0, layout.N_FACE)
_HAND = slice(layout.N_FACE, layout.N_FACE + layout.N_HAND)


@dataclass(frozen=True, slots=True)
class TrainingSet:
    """Frames of markers, with labels where a target is held.

    Attributes
    ----------
    markers : ndarray of float32, shape (T, 113, 3)
        World coordinates, millimetres; NaN where hidden.
    shape, placement, phone : ndarray of int64, shape (T,)
        Hand shape 0..8, index in `PLACEMENTS`, index in `PHONES`; `UNLABELLED` where the frame is
        no target. Default: no labels.
    """

    markers: NDArray[np.float32]
    shape: NDArray[np.int64] | None = None
    placement: NDArray[np.int64] | None = None
    phone: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        markers = np.asarray(self.markers, dtype=np.float32)
        if markers.ndim != 3 or markers.shape[1:] != (len(layout.MARKERS), 3):
            raise CueError(f"training markers have shape {markers.shape}, expected (T, 113, 3)")
        object.__setattr__(self, "markers", markers)
        for name, limit in (("shape", N_SHAPES), ("placement", len(PLACEMENTS)), ("phone", 38)):
            given: ArrayLike | None = getattr(self, name)
            if given is None:
                labels = np.full(len(markers), UNLABELLED, dtype=np.int64)
            else:
                labels = np.asarray(given, dtype=np.int64)
            if labels.shape != (len(markers),) or (labels.size and labels.max() >= limit):
                raise CueError(f"training labels {name} do not fit {len(markers)} frames")
            object.__setattr__(self, name, labels)

    def complete(self, group: slice | NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the markers `group` in the frames that show them all."""
        part = self.markers[:, group]
        return part[np.isfinite(part).all((1, 2))].astype(np.float64)


def fit_voice(name: str, *, hand: TrainingSet, face: TrainingSet, joint: TrainingSet) -> Voice:
    """Learn all models of a cuer.

    Parameters
    ----------
    name : str
    hand : TrainingSet
        Corpus 1: transitions between hand shapes in free space.
    face : TrainingSet
        Corpus 2: visemes, no hand shape; phone labels where a viseme is held.
    joint : TrainingSet
        Corpus 3: cued sentences; shape and placement labels where a key is held. Every shape and
        every placement has to be labelled somewhere in the three sets.

    Returns
    -------
    Voice

    Raises
    ------
    CueError
        If hardly any frame shows the whole face or hand, or a shape, placement or phone was
        never labelled.

    Notes
    -----
    Gibert, Bailly, Elisei 2004, sections 2 and 3.
    """
    faces = np.concatenate([face.complete(_FACE), joint.complete(_FACE)])
    if len(faces) < LEAST_FRAMES:
        raise CueError(f"{len(faces)} complete frames of the face, {LEAST_FRAMES} needed")
    hands = np.concatenate([hand.markers, joint.markers])[:, _HAND].astype(np.float64)
    face_model = fit_face(faces, joint.complete(RIGID_FACE_COLUMNS))
    hand_model = fit_hand(hands, joint.complete(layout.N_FACE + FOREARM_COLUMNS))
    gestures = estimate_gestures(face_model, hand_model, [hand, face, joint])
    return Voice(name, face_model, hand_model, gestures)


def estimate_gestures(face: FaceModel, hand: HandModel, sets: list[TrainingSet]) -> GestureTable:
    """Average the parameters of labelled targets.

    Placements are taken relative to the head of the moment and given for a head at rest; a shape
    never seen at a placement takes that placement's mean and the shape's mean deviation.

    Parameters
    ----------
    face, hand : FaceModel, HandModel
    sets : list of TrainingSet

    Raises
    ------
    CueError
        If a shape, placement or phone has no target.
    """
    shape, placement, phone = (
        np.concatenate([getattr(one, kind) for one in sets])
        for kind in ("shape", "placement", "phone")
    )
    used = np.flatnonzero((shape >= 0) | (placement >= 0) | (phone >= 0))
    markers = np.concatenate([one.markers for one in sets])[used].astype(np.float64)
    shape, placement, phone = shape[used], placement[used], phone[used]
    seen = np.asarray(np.isfinite(markers).all(-1))
    markers = np.where(seen[..., None], markers, 0.0)
    face_parameters = invert_face(face, markers[:, _FACE], seen[:, _FACE])
    hand_parameters = invert_hand(hand, markers[:, _HAND], seen[:, _HAND])
    head = face_parameters[:, N_FACE_PARAMETERS:]
    # Places are learnt relative to a head at rest; only the hand's own rest does not follow the
    # head.
    forearm = _at_resting_head(face, hand, head, hand_parameters[:, N_HAND_PARAMETERS:])
    forearm[placement == 0] = hand_parameters[placement == 0, N_HAND_PARAMETERS:]
    targets = single(
        _means(hand_parameters[:, :N_HAND_PARAMETERS], shape, N_SHAPES, "shape"),
        _placements(forearm, shape, placement),
        _means(face_parameters[:, :N_FACE_PARAMETERS], phone, len(PHONES), "phone"),
        np.zeros(face.n_motion),
    )
    return GestureTable(*targets)


def _at_resting_head(
    face: FaceModel, hand: HandModel, head: NDArray[np.float64], forearm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the forearm parameters that the same gesture has when the head rests."""
    resting = rigid.about(face.pivot, face.motion(np.zeros((1, face.n_motion))))
    moved = rigid.about(face.pivot, face.motion(head))
    to_rest = rigid.compose(resting, rigid.inverse(moved))
    carried = rigid.compose(to_rest, rigid.about(hand.pivot, hand.motion(forearm)))
    carried = rigid.about(-hand.pivot, carried)
    scale = np.array([_LEVER_MM] * 3 + [1.0] * 3)
    inverse = np.linalg.pinv(hand.motion_directions * scale)
    return np.asarray(((carried - hand.motion_mean) * scale) @ inverse)


def _means(
    parameters: NDArray[np.float64], labels: NDArray[np.int64], count: int, what: str
) -> NDArray[np.float64]:
    missing = np.setdiff1d(np.arange(count), labels)
    if missing.size:
        raise CueError(f"no target of {what} {missing.tolist()} in the training sets")
    return np.stack([parameters[labels == value].mean(0) for value in range(count)])


def _placements(
    forearm: NDArray[np.float64], shape: NDArray[np.int64], placement: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the mean of each shape at each placement, the unseen ones completed additively."""
    overall = _means(forearm, placement, len(PLACEMENTS), "placement")
    both = (shape >= 0) & (placement >= 0)
    deviation = forearm - overall[placement]
    table = np.empty((N_SHAPES, len(PLACEMENTS), forearm.shape[1]))
    for s in range(N_SHAPES):
        of_shape = both & (shape == s)
        offset = deviation[of_shape].mean(0) if of_shape.any() else np.zeros(forearm.shape[1])
        for p in range(len(PLACEMENTS)):
            at = of_shape & (placement == p)
            table[s, p] = forearm[at].mean(0) if at.any() else overall[p] + offset
    return table
