"""Places of a face that a hand points at, found in any head.

A mesh with its displacement by an open and by a rounded mouth, and the eyes come in; named places
go out. The same search is done in the built-in head, so that both are compared like with like.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from codec.errors import CueError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


_STEEP = 0.7
"""Share of the way to the outline of a head where its skin begins to fall away."""

_FRONT = 0.7
"""How far behind the eyes the outline of a face is looked for, in units of the distance
of the eyes: ears lie farther back."""


@dataclass(frozen=True)
class Face:
    """A head at rest, x to the viewer's right, y up, z towards the viewer.

    Attributes
    ----------
    points : ndarray, shape (V, 3)
    triangles : ndarray of int, shape (F, 3)
    opened, rounded : ndarray, shape (V, 3)
        Displacement by an open mouth, and by rounded lips.
    eyes : ndarray, shape (2, 3)
        Right and left, her own.
    of_head : ndarray of bool, shape (V,)
        Vertices that follow the head, not the trunk.
    """

    points: FloatArray
    triangles: IntArray
    opened: FloatArray
    rounded: FloatArray
    eyes: FloatArray
    of_head: NDArray[np.bool_]

    @cached_property
    def unit(self) -> float:
        """Distance of the eyes."""
        return float(np.linalg.norm(self.eyes[1] - self.eyes[0]))

    @cached_property
    def skin(self) -> NDArray[np.bool_]:
        """Vertices that hang together with the lips, shape (V,): hair and teeth do not."""
        count = len(self.points)
        edges = self.triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
        graph = coo_matrix((np.ones(len(edges)), edges.T), (count, count))
        _, part = connected_components(graph, directed=False)
        total = np.bincount(part, np.linalg.norm(self.opened, axis=1))
        return np.asarray(part == total.argmax())

    def landmarks(self) -> dict[str, FloatArray]:
        """Return the places (3,) of eyes, lips, corners of the mouth, nose and chin.

        Raises
        ------
        CueError
            If the mouth does not open or is not below the eyes.
        """
        unit, middle = self.unit, self.eyes.mean(axis=0)
        # How far opening the mouth moves each vertex: lower lip and chin move most, the upper lip
        # hardly.
        far = np.linalg.norm(self.opened, axis=1) * self.skin
        if not far.max() > 0.02 * unit:
            raise CueError("the mouth does not open: no face shape jawOpen or aa moves it")
        p = self.points - middle
        front = self.skin & (np.abs(p[:, 0]) < 0.14 * unit) & (p[:, 1] < -0.15 * unit)
        lower = front & (far > 0.5 * far.max())
        if not lower.any():
            raise CueError("the mouth does not open below the eyes")
        lower &= p[:, 2] > p[lower, 2].max() - 0.3 * unit
        low = self._outermost(lower, 1)
        upper = front & (far < 0.25 * far.max()) & (p[:, 2] > low[2] - middle[2] - 0.15 * unit)
        upper &= p[:, 1] > low[1] - middle[1] - 0.1 * unit
        if not upper.any():
            raise CueError("there is no upper lip over the opening mouth")
        top = self._outermost(upper, -1)
        tip = front & (p[:, 1] > top[1] - middle[1])
        nose = self.points[tip][self.points[tip, 2].argmax()] if tip.any() else top
        chin = self._outermost(
            front & (far > 0.6 * far.max()) & (p[:, 2] > p[lower, 2].max() - 0.45 * unit), -1
        )
        found = {"upper": top, "lower": low, "nose": nose, "chin": chin}
        found["eye_R"], found["eye_L"] = self.eyes
        found["corner_R"], found["corner_L"] = self._corners(0.5 * (top + low))
        return found

    def _outermost(self, mask: NDArray[np.bool_], sign: int) -> FloatArray:
        """Return the highest (1) or lowest (-1) of some vertices, in the middle of the face."""
        rows = np.flatnonzero(mask)
        best = self.points[rows[np.argmax(sign * self.points[rows, 1])]].copy()
        best[0] = self.eyes[:, 0].mean()
        return np.asarray(best)

    def _corners(self, mouth: FloatArray) -> list[FloatArray]:
        near = self.skin & (np.abs(self.points[:, 1] - mouth[1]) < 0.3 * self.unit)
        found = []
        for side in (-1, 1):
            inwards = -side * self.rounded[:, 0] * near
            inwards[side * (self.points[:, 0] - mouth[0]) < 0.1 * self.unit] = 0
            if inwards.max() > 0.01 * self.unit:
                found.append(
                    np.average(
                        self.points, axis=0, weights=np.maximum(inwards - 0.85 * inwards.max(), 0)
                    )
                )
            else:
                found.append(mouth + np.array([side * 0.42, 0, -0.1]) * self.unit)
        return found

    def aside(self, place: FloatArray) -> float:
        """Return how far to her right a place lies, 1 on the outline of the head."""
        middle = self.eyes[:, 0].mean()
        return float((place[0] - middle) / (self.edge(place[1]) - middle))

    def at_side(self, share: float, height: float) -> FloatArray:
        """Return the skin (3,) at a share of the way to the outline; x keeps the whole share.

        Towards the outline the skin falls away steeply, so its depth is that of less.
        """
        middle = self.eyes[:, 0].mean()
        way = self.edge(height) - middle
        depth = self.hit(np.array([[middle + min(share, _STEEP) * way, height]]))[1][0]
        return np.array([middle + share * way, height, depth])

    def hit(self, places: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return the front triangle at places (N, 2), its depth, and shares (N, 3) of its corners.

        The triangle is -1 and the depth NaN where there is none.
        """
        use = np.flatnonzero((self.skin | ~self.of_head)[self.triangles].all(axis=1))
        a, b, c = (self.points[self.triangles[use, k]] for k in range(3))
        u, v = b - a, c - a
        area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        safe = np.where(np.abs(area) > 1e-12, area, np.inf)
        number = np.full(len(places), -1)
        depth = np.full(len(places), np.nan)
        shares = np.zeros((len(places), 3))
        for i, place in enumerate(places):
            d = place - a[:, :2]
            # Barycentric shares s, t of the place in every triangle.
            s = (d[:, 0] * v[:, 1] - d[:, 1] * v[:, 0]) / safe
            t = (u[:, 0] * d[:, 1] - u[:, 1] * d[:, 0]) / safe
            inside = np.flatnonzero(
                (s >= -1e-6) & (t >= -1e-6) & (s + t <= 1 + 1e-6) & np.isfinite(safe)
            )
            if len(inside):
                z = a[inside, 2] + s[inside] * u[inside, 2] + t[inside] * v[inside, 2]
                best = inside[z.argmax()]
                number[i], depth[i] = use[best], z.max()
                shares[i] = 1 - s[best] - t[best], s[best], t[best]
        return number, depth, shares

    def edge(self, height: float) -> float:
        """Return the x of the head's outline on her right at a height."""
        near = self.skin & self.of_head & (np.abs(self.points[:, 1] - height) < 0.12 * self.unit)
        near &= self.points[:, 2] > self.eyes[:, 2].mean() - _FRONT * self.unit
        return (
            float(self.points[near, 0].min()) if near.any() else float(self.eyes[0, 0] - self.unit)
        )


def place_moves(own: Face, other: Face, places: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return how far (3,) each place of cueing lies from where the own face has it.

    Parameters
    ----------
    own, other : Face
        Both in one frame.
    places : dict of str to ndarray, shape (3,)
        Where the finger points at the own face.
    """
    a, b = own.landmarks(), other.landmarks()
    found = {}
    for name, place in places.items():
        if name == "mouth":
            found[name] = b["corner_R"] - a["corner_R"]
        elif name == "chin":
            found[name] = b["chin"] - a["chin"]
        elif name == "side":
            there = _likewise(a, b, place)
            found[name] = np.array(
                [other.edge(there[1]) - own.edge(place[1]), there[1] - place[1], 0.0]
            )
        else:
            share, there = own.aside(place), _likewise(a, b, place)
            skin = [own.at_side(share, place[1]), other.at_side(share, there[1])]
            found[name] = np.nan_to_num(skin[1] - skin[0])
    return found


def _likewise(a: dict[str, FloatArray], b: dict[str, FloatArray], place: FloatArray) -> FloatArray:
    """Return where a place of one face lies in another, by eyes, mouth and chin."""
    levels = [
        [x["chin"][1], 0.5 * (x["upper"][1] + x["lower"][1]), 0.5 * (x["eye_R"] + x["eye_L"])[1]]
        for x in (a, b)
    ]
    wide = [x["eye_L"][0] - x["eye_R"][0] for x in (a, b)]
    middle = [0.5 * (x["eye_L"][0] + x["eye_R"][0]) for x in (a, b)]
    y = place[1]
    if y < levels[0][0]:
        height = levels[1][0] + (y - levels[0][0])
    elif y > levels[0][2]:
        height = levels[1][2] + (y - levels[0][2])
    else:
        height = float(np.interp(y, levels[0], levels[1]))
    return np.array([middle[1] + (place[0] - middle[0]) * wide[1] / wide[0], height, place[2]])
