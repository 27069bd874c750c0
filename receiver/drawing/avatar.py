"""The avatar: a skin that follows the markers.

Parameters come in, vertices of head and hand go out. The asset (``assets/avatar_NAME.npz``, made by
``python -m lab.avatar``) holds, for head and hand each, a linear map from markers to the
vertices of a coarse mesh, a finer surface over that mesh, and its colours; the page computes the
same (``page/avatar.js``).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer.layout import FACE_MARKERS, FOREARM, HAND_MARKERS, RIGID_FACE
from codec.cuer.models.rigid import rigid_motion, rotation_matrices, shared_motion
from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.files.npz import read_arrays
from receiver.drawing._surface_kernels import refine_into
from receiver.drawing.mouth import Mouth
from receiver.drawing.movement import RULES, Expression, lean
from receiver.drawing.skeleton import Pose, Skeleton, between, gaze_in_head, solve

ASSETS = Path(__file__).parents[1] / "assets"

_MAX_BYTES = 1 << 24
"""Bytes of an avatar's file, unpacked, at most: a bound against hostile files."""

SHARE_UNIT = 252
"""Shares are stored as whole parts of this, which 2, 3 and 4 divide."""

OFFSET_UNIT = 256
"""Offsets are stored as whole parts of a millimetre."""

FloatArray = NDArray[np.float64]

_RIGID = {
    "head": [FACE_MARKERS.index(name) for name in RIGID_FACE],
    "hand": [HAND_MARKERS.index(name) for name in FOREARM],
}


@dataclass(frozen=True, slots=True)
class Surface:
    """Head or hand.

    Attributes
    ----------
    markers : ndarray, shape (K, 3)
        Markers at which the coarse mesh is at rest, in the frame of the voice's model.
    rest : ndarray, shape (M, 3)
    coefficients : ndarray, shape (3 K, R)
    basis : ndarray, shape (R, N, 3)
        The coarse mesh is ``rest + (markers - rest markers) @ coefficients @ basis`` for the
        vertices in `moving`, and ``rest`` for the others.
    moving : ndarray of int, shape (N,)
    sources : ndarray of int, shape (V, 3)
        Vertices of the coarse mesh between which each vertex of the surface lies.
    shares : ndarray, shape (V, 3)
        Where between them.
    offsets : ndarray, shape (V, 3)
        And how far from there.
    triangles : ndarray of int, shape (F, 3)
    colours : ndarray of uint8, shape (V, 5)
        Red, green, blue (sRGB), gloss and opacity.
    """

    markers: FloatArray
    rest: FloatArray
    coefficients: FloatArray
    basis: FloatArray
    moving: NDArray[np.int64]
    sources: NDArray[np.int64]
    shares: FloatArray
    offsets: FloatArray
    triangles: NDArray[np.int64]
    colours: NDArray[np.uint8]

    def control(self, markers: FloatArray) -> FloatArray:
        """Return the coarse mesh (T, M, 3) under markers (T, K, 3)."""
        moved = (markers - self.markers).reshape(len(markers), -1) @ self.coefficients
        control = np.repeat(self.rest[None], len(markers), axis=0)
        control[:, self.moving] += np.tensordot(moved, self.basis, axes=1)
        return control

    def refine(self, control: FloatArray) -> FloatArray:
        """Return the surface (T, V, 3) over a coarse mesh (T, M, 3)."""
        places = np.empty((len(control), len(self.offsets), 3))
        refine_into(np.ascontiguousarray(control), self.sources, self.shares, self.offsets, places)
        return places


@dataclass(frozen=True, slots=True)
class Avatar:
    """A cuer's skin, fitted to a voice.

    Attributes
    ----------
    voice : Voice
    head, hand : Surface
    head_weights : ndarray, shape (V, 2)
        Share of the head's turn and shift that each vertex of the head follows.
    mouth : Mouth
        Lips and teeth of the head.
    shapes : dict of str to (ndarray of int, shape (B,), ndarray, shape (B, 3))
        Vertices of the head's coarse mesh that each blend shape moves, and how far at weight 1.
    eye_ranges : ndarray of int, shape (2, 2)
        First vertex and number of vertices of the right and the left eyeball.
    eye_middles : ndarray, shape (2, 3)
        About which they turn.
    skeleton : Skeleton
        Joints of collar bones and right arm.
    unit_names : tuple of str
        ARKit's names of the units of the face that markers can see.
    unit_rest : ndarray, shape (63, 3)
        The face markers of a neutral face, head at rest.
    units : ndarray, shape (U, 63, 3)
        How each unit moves them at weight 1.
    looks : tuple of str
        The appearances that there are.
    """

    voice: Voice
    head: Surface
    hand: Surface
    head_weights: FloatArray
    mouth: Mouth
    shapes: dict[str, tuple[NDArray[np.int64], FloatArray]]
    eye_ranges: NDArray[np.int64]
    eye_middles: FloatArray
    skeleton: Skeleton
    unit_names: tuple[str, ...]
    unit_rest: FloatArray
    units: FloatArray
    looks: tuple[str, ...]

    @property
    def triangles(self) -> NDArray[np.int64]:
        """Triangles of head and hand over the vertices of `place`, shape (F, 3)."""
        return np.concatenate([self.head.triangles, self.hand.triangles + len(self.head.sources)])

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Colours of the vertices of `place`, shape (V, 5)."""
        return np.concatenate([self.head.colours, self.hand.colours])

    @property
    def casts(self) -> NDArray[np.bool_]:
        """Which triangles cast the shadow that all others receive: the hand's, shape (F,)."""
        return np.arange(len(self.triangles)) >= len(self.head.triangles)

    def place(self, params: ArrayLike, added: Expression | None = None) -> FloatArray:
        """Return the vertices of head, then hand, in the world.

        Parameters
        ----------
        params : ndarray, shape (T, P)
            Parameters of the voice.
        added : Expression, optional
            Movements of the T moments that no parameter holds; a still face otherwise.

        Returns
        -------
        ndarray of float64, shape (T, V, 3)
            Millimetres.
        """
        p = np.asarray(params, dtype=np.float64)
        pose = solve(self.skeleton, self.voice, p, added)
        head, hand = self._place_head(p, pose, added), self._place_hand(p, pose)
        placed = np.concatenate([head, hand], axis=1)
        if added is not None:
            lean(placed, added.trunk, self.voice.face.pivot)
        return placed

    def _place_head(self, params: FloatArray, pose: Pose, added: Expression | None) -> FloatArray:
        pivot = self.voice.face.pivot
        points = self.place_at_rest(params, pose, added) - pivot
        return shared_motion(points, pose.head, np.repeat(self.head_weights, 3, axis=1), pivot)

    def place_at_rest(self, params: FloatArray, pose: Pose, added: Expression | None) -> FloatArray:
        """Return the head's surface (T, V, 3), before its motion."""
        model, columns = self.voice.face, self.voice.face_columns
        control = self.head.control(model.shape(params[:, columns[:7]]))
        weights = {} if added is None else self.shape_weights(added, pose)
        for name, weight in weights.items():
            if weight.any():
                vertices, moved = self.shapes[name]
                control[:, vertices] += weight[:, None, None] * moved
        self.mouth.solve(control)
        self.skeleton.bend(control, pose.joints)
        points = self.head.refine(control)
        if added is not None:
            self.turn_eyes(points, gaze_in_head(added, pose))
        return points

    def shape_weights(self, added: Expression, pose: Pose) -> dict[str, FloatArray]:
        """Return the weights (T,) of the blend shapes, with lids that follow the gaze."""
        up = RULES["lids_per_rad"] * gaze_in_head(added, pose)[:, 1]
        lids = {
            f"eyeLook{way}{side}": np.clip(sign * up, 0, 1)
            for way, sign in (("Up", 1), ("Down", -1))
            for side in ("Left", "Right")
        }
        return added.shapes | lids

    def turn_eyes(self, points: FloatArray, gaze: FloatArray) -> None:
        """Turn the eyeballs in the head's surface (T, V, 3), before its motion, in place.

        Parameters
        ----------
        points : ndarray, shape (T, V, 3)
        gaze : ndarray, shape (T, 2)
            Radians towards the viewer's right, and up.
        """
        turns = rotation_matrices(gaze[:, ::-1, None] * [[-1.0, 0, 0], [0, 1, 0]])
        turn = turns[:, 1] @ turns[:, 0]
        for (first, count), middle in zip(self.eye_ranges, self.eye_middles, strict=True):
            ball = points[:, first : first + count] - middle
            points[:, first : first + count] = ball @ turn.transpose(0, 2, 1) + middle

    def _place_hand(self, params: FloatArray, pose: Pose) -> FloatArray:
        model, columns = self.voice.hand, self.voice.hand_columns
        points = self.hand.refine(self.hand.control(model.shape(params[:, columns[:12]])))
        return np.asarray(rigid_motion(points, pose.hand) + model.pivot)


def has_avatar(voice: Voice) -> bool:
    """Return whether there is an avatar of the voice's cuer."""
    return (ASSETS / f"avatar_{voice.name}.npz").is_file()


def load_avatar(voice: Voice, look: str | None = None) -> Avatar:
    """Return the avatar of a voice's cuer, fitted to the voice.

    Parameters
    ----------
    voice : Voice
    look : str, optional
        One of the appearances in `Avatar.looks`; the first by default. Markers are the same.

    Raises
    ------
    CueError
        If there is none, or not in this look, or the asset is damaged.
    """
    path = ASSETS / f"avatar_{voice.name}.npz"
    if not has_avatar(voice):
        raise CueError(f"voice {voice.name} has no avatar")
    arrays = read_arrays(path, max_bytes=_MAX_BYTES)
    try:
        looks = tuple(map(str, arrays["look_names"]))
        if look is not None and look not in looks:
            raise CueError(f"unknown look {look!r}: {', '.join(looks)} are known")
        if look not in (None, looks[0]):
            arrays = _dressed(arrays, str(look))
        head = _surface(arrays, "head", voice.face.mean)
        still = np.zeros((1, voice.hand.n_shape))
        hand = _surface(arrays, "hand", voice.hand.shape(still)[0])
        weights = arrays["head_weights"][head.sources] / 255
        # The asset is in its own pose and place: fit head and hand to the voice's mean markers.
        turn, shift = _fit(arrays["head_markers"], voice.face.mean, "head")
        of_hand = _fit(arrays["hand_markers"], voice.hand.shape(still)[0], "hand")
        return Avatar(
            voice, head, hand, (weights * head.shares[..., None]).sum(axis=1),
            _mouth(arrays, turn, shift), _shapes(arrays, turn),
            arrays["eye_ranges"].astype(np.int64), arrays["eye_middles"] @ turn + shift,
            _skeleton(arrays, (turn, shift), of_hand),
            tuple(map(str, arrays["unit_names"])), arrays["unit_rest"] @ turn + shift,
            arrays["units"] @ turn, looks,
        )  # fmt: skip
    except (KeyError, ValueError, IndexError) as error:
        raise CueError(f"{path}: damaged avatar: {error!r}") from error


def _dressed(arrays: Mapping[str, NDArray[Any]], look: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of the asset with the rest, the hair and the colours of a look."""
    own = {key.removeprefix(f"look_{look}_"): value for key, value in arrays.items()}
    vertices, triangles = arrays["look_common"].astype(np.int64)
    count = len(own["offsets"])
    last = slice(vertices, vertices + 1)
    changed = {
        "head_rest": arrays["head_rest"] + own["rest"] / OFFSET_UNIT,
        "head_colours": own["colours"],
        "hand_colours": own["hand"],
        "joint_places": own["places"],
        "head_triangles": np.concatenate(
            [arrays["head_triangles"][:triangles], own["triangles"] + vertices]
        ),
    }
    for name in ("sources", "shares"):
        whole = arrays[f"head_{name}"]
        hair = np.repeat(whole[last], count, axis=0)
        changed[f"head_{name}"] = np.concatenate([whole[:vertices], hair])
    changed["head_offsets"] = np.concatenate([arrays["head_offsets"][:vertices], own["offsets"]])
    return {**arrays, **changed}


def _mouth(arrays: Mapping[str, NDArray[Any]], turn: FloatArray, shift: FloatArray) -> Mouth:
    """Return lips and teeth; the arch's own shift is that of the frame, whose turn is slight."""
    a = {key.removeprefix("mouth_"): value for key, value in arrays.items()}
    arch = a["arch"].astype(np.float64)
    arch[:, [4, 3, 0]] = arch[:, [4, 3, 0]] @ turn + shift
    return Mouth(
        a["rings"].astype(np.int64), a["upper"].astype(np.int64), a["lower"].astype(np.int64),
        a["beside"].astype(np.int64), a["between"].astype(np.float64), a["lining"] @ turn, arch,
        int(a["jaw"][0]), a["jaw_rest"] @ turn + shift,
    )  # fmt: skip


def _skeleton(
    arrays: Mapping[str, NDArray[Any]],
    of_head: tuple[FloatArray, FloatArray],
    of_hand: tuple[FloatArray, FloatArray],
) -> Skeleton:
    places = arrays["joint_places"].astype(np.float64) @ of_head[0] + of_head[1]
    in_hand = arrays["joint_forearm"].astype(np.float64) @ of_hand[0] + of_hand[1]
    vertices = np.flatnonzero(arrays["joint_weights"].any(axis=1))
    return Skeleton(
        vertices,
        arrays["joint_weights"][vertices] / 255,
        places[:2],
        places[2:4],
        places[4],
        between(places[4:], in_hand),
    )


def _shapes(
    arrays: Mapping[str, NDArray[Any]], turn: FloatArray
) -> dict[str, tuple[NDArray[np.int64], FloatArray]]:
    ends = np.cumsum(arrays["shape_counts"].astype(np.int64))[:-1]
    vertices = np.split(arrays["shape_vertices"].astype(np.int64), ends)
    deltas = np.split(arrays["shape_deltas"] @ turn / OFFSET_UNIT, ends)
    names = map(str, arrays["shape_names"])
    return dict(zip(names, zip(vertices, deltas, strict=True), strict=True))


def _fit(
    markers: NDArray[Any], reference: NDArray[Any], name: str
) -> tuple[FloatArray, FloatArray]:
    """Return turn (3, 3) and shift (3,) with ``markers @ turn + shift`` nearest to reference."""
    a = markers[_RIGID[name]].astype(np.float64)
    b = np.asarray(reference, dtype=np.float64)[_RIGID[name]]
    u, _, v = np.linalg.svd((a - a.mean(0)).T @ (b - b.mean(0)))
    u[:, 2] *= np.sign(np.linalg.det(u @ v))
    turn = u @ v
    return turn, b.mean(0) - a.mean(0) @ turn


def _surface(arrays: Mapping[str, NDArray[Any]], name: str, reference: NDArray[Any]) -> Surface:
    """Return head or hand, turned and shifted into the frame of the voice's model."""
    a = {key.removeprefix(f"{name}_"): value for key, value in arrays.items()}
    turn, shift = _fit(a["markers"], reference, name)
    moving = a["moving"].astype(np.int64)
    coefficients = a["coefficients"].astype(np.float64).reshape(len(a["markers"]), 3, -1)
    return Surface(
        a["markers"] @ turn + shift,
        a["rest"] @ turn + shift,
        np.einsum("kir,ij->kjr", coefficients, turn).reshape(-1, coefficients.shape[2]),
        a["basis"].astype(np.float64).reshape(-1, len(moving), 3) @ turn,
        moving,
        a["sources"].astype(np.int64),
        a["shares"] / SHARE_UNIT,
        a["offsets"] @ turn / OFFSET_UNIT,
        a["triangles"].astype(np.int64),
        a["colours"],
    )


def vertex_normals(points: FloatArray, triangles: NDArray[np.int64]) -> FloatArray:
    """Return the normals of a surface, shape (V, 3): sums of its triangles' area vectors."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = triangles.ravel()
    repeated = np.repeat(across, 3, axis=0)
    normals = np.stack(
        [np.bincount(flat, repeated[:, k], minlength=len(points)) for k in range(3)], axis=1
    )
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9))
