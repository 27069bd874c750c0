"""The face model: 63 markers from seven articulatory parameters and the head's motion.

Reconstruction is the paper's algorithm for ``P3DF``, word for word::

    mvt  = mean_mF + pmF * eigv_mF
    P3D  = reshape(mean_F + paF * eigv_F, 3, 63)
    P3DF(:, i) = Rigid_Motion(P3D(:, i), mvt .* wmF(:, i))      for every marker i

Source: Gibert, Bailly, Elisei 2004, section 3.1. `codec.training.fit_face` learns the model.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.errors import CueError

N_FACE_PARAMETERS = 7
"""Articulatory parameters of the face (Gibert et al. 2004, section 3: naF)."""

THROAT_COLUMNS = np.array([layout.FACE_MARKERS.index(name) for name in layout.THROAT])
HEAD_COLUMNS = np.setdiff1d(np.arange(layout.N_FACE), THROAT_COLUMNS)


@dataclass(frozen=True, slots=True)
class FaceModel:
    """Linear face under a weighted rigid head motion.

    Attributes
    ----------
    mean : ndarray of float32, shape (63, 3)
        Markers at parameters 0, head at rest, millimetres (``mean_F``).
    directions : ndarray of float32, shape (7, 63, 3)
        Displacement per unit of each parameter (``eigv_F``).
    pivot : ndarray of float32, shape (3,)
        Point about which the head's rotation vector turns.
    motion_mean : ndarray of float32, shape (6,)
        Rotation vector (radians) and translation (mm) at head parameters 0 (``mean_mF``).
    motion_directions : ndarray of float32, shape (nmF, 6)
        Motion per unit of each head parameter (``eigv_mF``).
    weights : ndarray of float32, shape (63, 6)
        Share of the head's motion that each marker follows (``wmF``): 1, on the throat less.

    Examples
    --------
    >>> from codec import load_voice
    >>> face = load_voice("claire").face
    >>> face.mean.shape, face.n_motion
    ((63, 3), 6)
    """

    mean: NDArray[np.float32]
    directions: NDArray[np.float32]
    pivot: NDArray[np.float32]
    motion_mean: NDArray[np.float32]
    motion_directions: NDArray[np.float32]
    weights: NDArray[np.float32]

    def __post_init__(self) -> None:
        expected = {
            "mean": (layout.N_FACE, 3),
            "directions": (N_FACE_PARAMETERS, layout.N_FACE, 3),
            "pivot": (3,),
            "motion_mean": (6,),
            "motion_directions": (self.n_motion, 6),
            "weights": (layout.N_FACE, 6),
        }
        for name, shape in expected.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            if array.shape != shape or not np.isfinite(array).all():
                raise CueError(f"face model: {name} has shape {array.shape}, expected {shape}")
            object.__setattr__(self, name, array)
        if not 1 <= self.n_motion <= 6:
            raise CueError(f"face model: {self.n_motion} head parameters, not within 1..6")
        if not (self.weights[HEAD_COLUMNS] == 1).all():
            raise CueError("face model: a marker of the head does not follow the head fully")

    @property
    def n_motion(self) -> int:
        """Number of head parameters nmF."""
        return len(self.motion_directions)

    @property
    def n_parameters(self) -> int:
        """Number of all parameters: seven of the face, then nmF of the head."""
        return N_FACE_PARAMETERS + self.n_motion

    @property
    def deviations(self) -> NDArray[np.float32]:
        """The residual of the model is taken for white noise: no common displacements."""
        return np.zeros((0, layout.N_FACE, 3), dtype=np.float32)

    def motion(self, head: ArrayLike) -> NDArray[np.float64]:
        """Return the head's motion ``mvt`` of head parameters (T, nmF), shape (T, 6)."""
        return self.motion_mean + np.asarray(head, dtype=np.float64) @ self.motion_directions

    def shape(self, face: ArrayLike) -> NDArray[np.float64]:
        """Return the markers under a head at rest of face parameters (T, 7), shape (T, 63, 3)."""
        flat = self.directions.reshape(N_FACE_PARAMETERS, -1)
        moved = np.asarray(face, dtype=np.float64) @ flat
        return (moved + self.mean.reshape(-1)).reshape(-1, layout.N_FACE, 3)

    def reconstruct(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Return the markers ``P3DF``.

        Parameters
        ----------
        parameters : array_like, shape (T, 7 + nmF)

        Returns
        -------
        ndarray of float64, shape (T, 63, 3)
            World coordinates, millimetres.
        """
        p = np.asarray(parameters, dtype=np.float64)
        motion = self.motion(p[:, N_FACE_PARAMETERS:])
        points = self.shape(p[:, :N_FACE_PARAMETERS]) - self.pivot
        return rigid.shared_motion(points, motion, self.weights, self.pivot)

    def residual(
        self, parameters: NDArray[np.float64], markers: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the model's residual of world markers, each in its resting frame, (T, 63, 3).

        Markers are moved back by their share of the head's motion: distances are the same as in
        the world, and the face's directions need no turning.
        """
        motion = self.motion(parameters[:, N_FACE_PARAMETERS:])
        points = markers - motion[:, None, 3:] * self.weights[:, 3:] - self.pivot
        back = np.concatenate([-motion[:, :3], np.zeros((len(motion), 3))], axis=1)
        still = rigid.shared_motion(points, back, self.weights, self.pivot)
        still -= self.shape(parameters[:, :N_FACE_PARAMETERS])
        return still

    def slopes(self, parameters: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the derivatives of the markers, each in its resting frame, (T, P, 63, 3)."""
        motion = self.motion(parameters[:, N_FACE_PARAMETERS:])
        points = self.shape(parameters[:, :N_FACE_PARAMETERS]) - self.pivot
        out = np.empty((len(parameters), self.n_parameters, layout.N_FACE, 3), dtype=np.float32)
        out[:, :N_FACE_PARAMETERS] = self.directions
        by_motion = out[:, N_FACE_PARAMETERS:]
        by_motion[:, :, HEAD_COLUMNS] = rigid.motion_slopes(
            points[:, HEAD_COLUMNS], motion[:, None], self.motion_directions[:, None]
        )
        weights = self.weights[THROAT_COLUMNS]
        by_motion[:, :, THROAT_COLUMNS] = rigid.motion_slopes(
            points[:, THROAT_COLUMNS],
            motion[:, None] * weights,
            self.motion_directions[:, None] * weights,
        )
        return out
