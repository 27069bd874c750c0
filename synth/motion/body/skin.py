"""Linear-blend skin: points that follow several bones, with the displacements of the face.

A point that bone ``b`` holds with weight ``w`` lies at ``sum w (place_b + turn_b y_b)``, where
``y_b`` is its rest position in the bone's frame; sums over bones are one matrix product.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Skin:
    """Points on bones.

    Attributes
    ----------
    rest : ndarray, shape (N, 3)
        Rest positions, mm.
    weights : ndarray, shape (N, B)
        Weight of each bone; rows sum to one.
    frames : ndarray, shape (B, 3, 3)
        Rest frames of the bones.
    origins : ndarray, shape (B, 3)
        Rest positions of the bones' base joints, mm.
    """

    rest: FloatArray
    weights: FloatArray
    frames: FloatArray
    origins: FloatArray

    def local(self, points: FloatArray) -> FloatArray:
        """Return (..., N, 3) world points as (..., N, B, 3) in the bones' rest frames."""
        local: FloatArray = np.einsum(
            "...nbj,bjk->...nbk", points[..., None, :] - self.origins, self.frames
        )
        return local

    def place(self, turns: FloatArray, places: FloatArray) -> FloatArray:
        """Return posed points (T, N, 3) for bone frames (T, B, 3, 3) and places (T, B, 3)."""
        t, bones = places.shape[:2]
        carried = self.local(self.rest) * self.weights[..., None]
        n = len(carried)
        matrix = np.concatenate([carried.reshape(n, bones * 3), self.weights], axis=1)
        axes = turns.transpose(0, 2, 1, 3).reshape(t * 3, bones * 3)
        origin = places.transpose(0, 2, 1).reshape(t * 3, bones)
        out = np.concatenate([axes, origin], axis=1) @ matrix.T
        posed: FloatArray = out.reshape(t, 3, n).transpose(0, 2, 1)
        return posed

    def place_moved(self, shift: FloatArray, turns: FloatArray, places: FloatArray) -> FloatArray:
        """Return posed points when each rest point is first moved by `shift` (T, N, 3).

        The shift is turned by the blend of the frames' rotations since rest.
        """
        blend = self._blend(turns)
        moved: FloatArray = np.einsum("tnij,tnj->tni", blend, shift)
        return self.place(turns, places) + moved

    def turned(self, vectors: FloatArray, turns: FloatArray) -> FloatArray:
        """Return vectors (N, 3) that belong to the points, turned with them, (T, N, 3)."""
        turned: FloatArray = np.einsum("tnij,nj->tni", self._blend(turns), vectors)
        return turned

    def _blend(self, turns: FloatArray) -> FloatArray:
        """Return each point's mean rotation since rest, shape (T, N, 3, 3)."""
        since = turns @ self.frames.transpose(0, 2, 1)
        t, bones = turns.shape[:2]
        mixed: FloatArray = self.weights @ since.reshape(t, bones, 9)
        return mixed.reshape(t, len(self.rest), 3, 3)


def stretch(
    points: FloatArray,
    weights: FloatArray,
    frames: FloatArray,
    origins: FloatArray,
    parents: list[int],
    factors: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return points and joint positions after stretching every bone in its own frame.

    Parameters
    ----------
    points : ndarray, shape (N, 3)
    weights : ndarray, shape (N, B)
    frames : ndarray, shape (B, 3, 3)
    origins : ndarray, shape (B, 3)
    parents : list of int
        Parent of each bone, before it in order; -1 for the root.
    factors : ndarray, shape (B, 3)
        Stretch along ulnar, along and dorsal axis.
    """
    maps = np.einsum("bij,bj,bkj->bik", frames, factors, frames)
    moved = origins.copy()
    for bone, parent in enumerate(parents):
        if parent >= 0:
            moved[bone] = moved[parent] + maps[parent] @ (origins[bone] - origins[parent])
    offsets = points[:, None, :] - origins
    out = np.einsum("nb,bij,nbj->ni", weights, maps, offsets) + weights @ moved
    return out, moved
