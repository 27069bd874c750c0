"""Linear maps from markers to the vertices of a mesh, learned once, small enough to send.

Displacements of markers come in, displacements of vertices go out: ridge regression, then the
few directions of the mesh that matter. This is the paper's "high definition model mapped onto the
parameter space" (Gibert, Bailly, Elisei 2004, section 5.2), on markers so that no voice is needed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MarkerMap:
    """``vertices = rest + (markers - rest_markers) @ coefficients @ basis``.

    Attributes
    ----------
    rest_markers : ndarray, shape (K, 3)
    rest : ndarray, shape (V, 3)
    coefficients : ndarray, shape (3 K, R)
    basis : ndarray, shape (R, 3 V)
    """

    rest_markers: FloatArray
    rest: FloatArray
    coefficients: FloatArray
    basis: FloatArray

    def vertices(self, markers: FloatArray) -> FloatArray:
        """Return the vertices (T, V, 3) for markers (T, K, 3)."""
        moved = (markers - self.rest_markers).reshape(len(markers), -1)
        out = self.rest.ravel() + moved @ self.coefficients @ self.basis
        return np.asarray(out.reshape(len(markers), -1, 3))


def learn(
    markers: FloatArray,
    vertices: FloatArray,
    *,
    ridge: float,
    rank: int,
    rest_markers: FloatArray,
    rest: FloatArray,
) -> MarkerMap:
    """Fit a map to samples.

    Parameters
    ----------
    markers : ndarray, shape (T, K, 3)
    vertices : ndarray, shape (T, V, 3)
    ridge : float
        Square of the marker error, in millimetres, that the map shall not amplify.
    rank : int
        Number of directions kept.
    rest_markers, rest : ndarray
        The sample that must come out exactly.
    """
    x = (markers - rest_markers).reshape(len(markers), -1)
    y = (vertices - rest).reshape(len(vertices), -1)
    gram = x.T @ x / len(x) + ridge * np.eye(x.shape[1])
    weights = np.linalg.solve(gram, x.T @ y / len(x))
    predicted = x @ weights
    _, _, directions = np.linalg.svd(predicted, full_matrices=False)
    basis = directions[:rank]
    return MarkerMap(rest_markers, rest, weights @ basis.T, basis)
