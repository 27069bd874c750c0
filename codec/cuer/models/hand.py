"""The hand model: 50 markers from twelve shape parameters and the forearm's motion.

Reconstruction is the paper's algorithm for ``P3DH``::

    mvt  = mean_mH + pmH * eigv_mH
    ang  = mean_A + paH * eigv_A
    P    = [1 cos(ang) sin(ang)]
    P3DH = Rigid_Motion(reshape(P * Xang, 3, 50), mvt)

The paper's formula regresses on the angles, its sentence on "2*naH+1 values", that is on the
parameters; the second reading is this same model with ``mean_A = 0`` and ``eigv_A`` a diagonal.
Source: Gibert, Bailly, Elisei 2004, section 3.2. `codec.training.fit_hand` learns the model.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.errors import CueError

_EVERY_MARKER = range(layout.N_HAND)

N_HAND_PARAMETERS = 12
"""Parameters of the hand's shape (Gibert et al. 2004, section 3: naH)."""


@dataclass(frozen=True, slots=True)
class HandModel:
    """Elliptic marker paths driven by joint angles, carried by the forearm.

    Attributes
    ----------
    angle_mean : ndarray of float32, shape (A,)
        Angles at parameters 0, radians (``mean_A``).
    angle_directions : ndarray of float32, shape (naH, A)
        Angles per unit of each parameter (``eigv_A``).
    regression : ndarray of float32, shape (1 + 2 A, 50, 3)
        Markers from 1, cosines and sines, millimetres from the pivot (``Xang``).
    pivot : ndarray of float32, shape (3,)
        Point about which the forearm's rotation vector turns, millimetres.
    motion_mean : ndarray of float32, shape (6,)
        Rotation vector (radians) and translation (mm) at forearm parameters 0 (``mean_mH``).
    motion_directions : ndarray of float32, shape (nmH, 6)
        Motion per unit of each forearm parameter (``eigv_mH``).
    deviations : ndarray of float32, shape (S, 50, 3)
        Residual of the model, as independent displacements of one standard deviation each:
        sliding skin moves neighbouring markers together. Inversion expects them, they are never
        drawn.

    Examples
    --------
    >>> from codec import load_voice
    >>> hand = load_voice("claire").hand
    >>> hand.n_shape, hand.regression.shape[1:]
    (12, (50, 3))
    """

    angle_mean: NDArray[np.float32]
    angle_directions: NDArray[np.float32]
    regression: NDArray[np.float32]
    pivot: NDArray[np.float32]
    motion_mean: NDArray[np.float32]
    motion_directions: NDArray[np.float32]
    deviations: NDArray[np.float32]

    def __post_init__(self) -> None:
        angles = self.angle_mean.size
        expected = {
            "angle_mean": (angles,),
            "angle_directions": (self.n_shape, angles),
            "regression": (1 + 2 * angles, layout.N_HAND, 3),
            "pivot": (3,),
            "motion_mean": (6,),
            "motion_directions": (self.n_motion, 6),
            "deviations": (len(self.deviations), layout.N_HAND, 3),
        }
        for name, shape in expected.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            if array.shape != shape or not np.isfinite(array).all():
                raise CueError(f"hand model: {name} has shape {array.shape}, expected {shape}")
            object.__setattr__(self, name, array)
        if not 1 <= self.n_motion <= 6:
            raise CueError(f"hand model: {self.n_motion} forearm parameters, not within 1..6")

    @property
    def n_shape(self) -> int:
        """Number of shape parameters naH: 12, fewer in negative controls."""
        return len(self.angle_directions)

    @property
    def n_motion(self) -> int:
        """Number of forearm parameters nmH."""
        return len(self.motion_directions)

    @property
    def n_parameters(self) -> int:
        """Number of all parameters: naH of the shape, then nmH of the forearm."""
        return self.n_shape + self.n_motion

    def motion(self, forearm: ArrayLike) -> NDArray[np.float64]:
        """Return the forearm's motion ``mvt`` of parameters (T, nmH), shape (T, 6)."""
        return self.motion_mean + np.asarray(forearm, dtype=np.float64) @ self.motion_directions

    def angles(self, shape: ArrayLike) -> NDArray[np.float64]:
        """Return the angles ``ang`` of shape parameters (T, naH), shape (T, A), radians."""
        return self.angle_mean + np.asarray(shape, dtype=np.float64) @ self.angle_directions

    def shape(self, shape: ArrayLike) -> NDArray[np.float64]:
        """Return the markers about the pivot, forearm at rest, shape (T, 50, 3)."""
        flat = regressors(self.angles(shape)) @ self.regression.reshape(len(self.regression), -1)
        return np.asarray(flat.reshape(-1, layout.N_HAND, 3))

    def reconstruct(
        self, parameters: ArrayLike, markers: Sequence[int] = _EVERY_MARKER
    ) -> NDArray[np.float64]:
        """Return the markers ``P3DH``.

        Parameters
        ----------
        parameters : array_like, shape (T, naH + nmH)
        markers : sequence of int
            Which ones, by default all 50.

        Returns
        -------
        ndarray of float64, shape (T, markers, 3)
            World coordinates, millimetres.
        """
        p = np.asarray(parameters, dtype=np.float64)
        motion = self.motion(p[:, self.n_shape :])
        wanted = self.regression[:, list(markers)].reshape(len(self.regression), -1)
        points = regressors(self.angles(p[:, : self.n_shape])) @ wanted
        still = np.asarray(points.reshape(len(p), -1, 3))
        return rigid.shared_motion(still, motion, np.ones((still.shape[1], 6)), self.pivot)

    def residual(
        self, parameters: NDArray[np.float64], markers: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the model's residual of world markers, in the forearm's frame, (T, 50, 3)."""
        motion = self.motion(parameters[:, self.n_shape :])
        still = rigid.inverse_rigid_motion(markers - self.pivot, motion)
        return still - self.shape(parameters[:, : self.n_shape])

    def slopes(self, parameters: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the derivatives of the markers in the forearm's frame, (T, P, 50, 3)."""
        n, frames = self.n_shape, len(parameters)
        motion = self.motion(parameters[:, n:])
        angle = self.angles(parameters[:, :n])
        flat = self.regression.reshape(len(self.regression), -1)
        regressor = regressors(angle)
        points = (regressor @ flat).reshape(frames, layout.N_HAND, 3)
        cosine, sine = np.split(regressor[:, 1:], 2, axis=1)
        by_angle = np.concatenate([-sine, cosine], axis=1).astype(np.float32)
        twice = np.concatenate([self.angle_directions, self.angle_directions], axis=1)
        by_shape = (by_angle[:, None] * twice).reshape(-1, twice.shape[1]) @ flat[1:]
        out = np.empty((frames, self.n_parameters, layout.N_HAND, 3), dtype=np.float32)
        out[:, :n] = by_shape.reshape(frames, n, layout.N_HAND, 3)
        out[:, n:] = rigid.motion_slopes(points, motion[:, None], self.motion_directions[:, None])
        return out


def regressors(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``P = [1 cos(ang) sin(ang)]`` of angles (T, A), shape (T, 1 + 2 A)."""
    return np.concatenate([np.ones((len(angles), 1)), np.cos(angles), np.sin(angles)], axis=1)
