"""Face and hand models seen as landmarks in a picture.

A model of markers becomes one of landmarks: weighted means of its markers, each with a displacement
of its own, seen from far away along z. The inversion of markers then serves landmarks too; depth
counts little, for a single camera only guesses it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models import rigid
from codec.cuer.models.face import N_FACE_PARAMETERS, FaceModel
from codec.cuer.models.hand import HandModel
from synth.capture.sources.landmark_maps import LandmarkMap

FloatArray = NDArray[np.float64]

FACE_TRUST = np.array([0.7, 0.7, 0.05])
"""How much x, y and z of a face landmark count, against a marker's coordinate."""

HAND_TRUST = np.array([0.2, 0.2, 0.03])
"""The same for a hand: 3 mm of error count like half a millimetre of a marker."""


@dataclass(frozen=True, slots=True)
class LandmarkModel:
    """What `codec.cuer.models.inversion.invert` needs, of landmarks.

    Attributes
    ----------
    model : FaceModel or HandModel
    map : LandmarkMap
    offsets : ndarray of float64, shape (L, 3)
        Of each landmark from its markers' mean, in the frame of the head; zeros for a hand.
    trust : ndarray of float64, shape (3,)
        Factors of the coordinates.
    """

    model: FaceModel | HandModel
    map: LandmarkMap
    offsets: FloatArray
    trust: FloatArray

    @property
    def n_shape(self) -> int:
        """Number of parameters before those of the motion."""
        return N_FACE_PARAMETERS if isinstance(self.model, FaceModel) else self.model.n_shape

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""
        return self.model.n_parameters

    @property
    def deviations(self) -> NDArray[np.float32]:
        """The residual is taken for white noise."""
        return np.zeros((0, len(self.offsets), 3), dtype=np.float32)

    def resting(self, parameters: FloatArray) -> FloatArray:
        """Return the landmarks about the pivot, head or forearm at rest, shape (T, L, 3)."""
        shape = self.model.shape(parameters[:, : self.n_shape])
        if isinstance(self.model, FaceModel):
            shape = shape - self.model.pivot
        return np.asarray(self.map.weights @ shape + self.offsets)

    def landmarks(self, parameters: FloatArray) -> FloatArray:
        """Return the landmarks in the voice's coordinates, shape (T, L, 3), mm."""
        motion = self.model.motion(parameters[:, self.n_shape :])
        return rigid.rigid_motion(self.resting(parameters), motion) + self.model.pivot

    def residual(self, parameters: FloatArray, markers: FloatArray) -> FloatArray:
        """Return landmarks minus model, as far as they are trusted, (T, L, 3)."""
        return np.asarray((markers - self.landmarks(parameters)) * self.trust)

    def slopes(self, parameters: FloatArray) -> NDArray[np.float32]:
        """Return the derivatives of the trusted landmarks, shape (T, P, L, 3)."""
        n, frames = self.n_shape, len(parameters)
        motion = self.model.motion(parameters[:, n:])
        out = np.empty((frames, self.n_parameters, len(self.offsets), 3), dtype=np.float32)
        weights = self.map.weights.astype(np.float32)
        out[:, :n] = weights @ self._shape_slopes(parameters)
        out[:, n:] = rigid.motion_slopes(
            self.resting(parameters), motion[:, None], self.model.motion_directions[:, None]
        )
        turn = rigid.rotation_matrices(motion[:, :3]).astype(np.float32)
        turned = out @ turn[:, None].transpose(0, 1, 3, 2)
        return np.asarray(turned * self.trust.astype(np.float32))

    def _shape_slopes(self, parameters: FloatArray) -> NDArray[np.float32]:
        """Return how markers at rest change with the shape, (T, n, K, 3); (1, ...) if always so."""
        if isinstance(self.model, FaceModel):
            return np.asarray(self.model.directions[None])
        return self.model.slopes(parameters)[:, : self.n_shape]
