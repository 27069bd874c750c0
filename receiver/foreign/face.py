"""A foreign face under the cuer's markers: lips and jaw, brows, lids and eyes.

Face shapes of the file come in. The weights of its mouth's shapes are fitted to the displacement of
the lips' and the chin's markers, scaled to its mouth, within 0..1; a linear map from the markers to
the vertices is learnt from the result. A file with VRM's five visemes only is fitted in the same
way, but has too few shapes for lips to be read.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import CHIN, FACE_MARKERS, LIP_CORNERS, LOWER_LIP, UPPER_LIP
from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.drawing.avatar import Avatar
from receiver.drawing.maps import MarkerMap, learn
from receiver.drawing.units import unit_weights
from receiver.foreign.landmarks import Face
from receiver.foreign.names import VISEMES
from receiver.foreign.scene import Scene

FloatArray = NDArray[np.float64]

OPEN, ROUND = ("jawOpen", "aa", "oh"), ("mouthPucker", "mouthFunnel", "ou", "oh")
"""Shapes that open the mouth and that round it, the best first."""

READABLE = {"jawOpen", "mouthPucker", "mouthStretchLeft", "mouthStretchRight"}
"""Shapes without which lips cannot be read: open, round and spread have to be apart."""

_RANK = 10
"""Directions of displacement that the linear map keeps."""

_RIDGE_MM2 = 0.02
"""Ridge of that map: markers move by millimetres, so it bounds what small ones may cause."""

_LESSONS = 400
"""Mouths that the map is learnt from."""

_MARKERS = (*UPPER_LIP, *LOWER_LIP, *LIP_CORNERS, *CHIN)

_NEAR_MM = 6.0
"""How far a marker is moved at most until the skin lies under it."""

_GAZE = tuple(f"eyeLook{way}{side}" for way in ("Up", "Down") for side in ("Left", "Right"))


def own_face(avatar: Avatar) -> Face:
    """Return the built-in head as a `Face`, for comparison."""

    def surface(markers: FloatArray) -> FloatArray:
        return np.asarray(avatar.head.refine(avatar.head.control(markers[None]))[0])

    still = surface(avatar.unit_rest)
    opened, rounded = (
        surface(avatar.unit_rest + avatar.units[avatar.unit_names.index(name)]) - still
        for name in ("jawOpen", "mouthPucker")
    )
    # Its parts share no vertices: those that lie and move together are one.
    key = np.rint(20 * np.concatenate([still, opened], axis=1)).astype(np.int64)
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Face(
        still[first],
        number.ravel()[avatar.head.triangles],
        opened[first],
        rounded[first],
        avatar.eye_middles,
        avatar.head_weights[first, 0] > 0.5,
    )


def eye_places(scene: Scene) -> FloatArray:
    """Return the eyes (2, 3), right and left: of their bones, or of the lids that blink.

    Raises
    ------
    CueError
        If there are neither.
    """
    if {"rightEye", "leftEye"} <= set(scene.bones):
        return np.array([scene.place("rightEye"), scene.place("leftEye")])
    both = sum(
        (
            scene.shapes[name]
            for name in ("blink", "eyeBlinkRight", "eyeBlinkLeft")
            if name in scene.shapes
        ),
        np.zeros_like(scene.points),
    )
    far = np.linalg.norm(both, axis=1)
    middle = scene.points[far > 0, 0].mean() if far.any() else 0.0
    found = []
    for side in (-1, 1):
        own = far * (side * (scene.points[:, 0] - middle) > 0)
        if not own.any():
            raise CueError(f"{scene.name}: has no eyes: neither bones nor a shape that blinks")
        found.append(np.average(scene.points, axis=0, weights=own))
    return np.array(found)


def foreign_face(scene: Scene, points: FloatArray, eyes: FloatArray, scale: float) -> Face:
    """Return the head of a scene as a `Face`: points (V, 3) and eyes (2, 3) are placed, in mm.

    Raises
    ------
    CueError
        If no shape opens the mouth.
    """
    still = np.zeros_like(points)
    opened, rounded = (
        next((scene.shapes[name] for name in names if name in scene.shapes), still) * scale
        for names in (OPEN, ROUND)
    )
    return Face(points, scene.triangles, opened, rounded, eyes, scene.share("head") > 0.5)


def mouth_shapes(scene: Scene) -> dict[str, FloatArray]:
    """Return the shapes of mouth and jaw; VRM's visemes only where there are no others."""
    found = {
        name: moved for name, moved in scene.shapes.items() if name.startswith(("jaw", "mouth"))
    }
    return found or {name: scene.shapes[name] for name in VISEMES if name in scene.shapes}


@dataclass(frozen=True, slots=True)
class FaceMap:
    """How a foreign mouth follows the markers.

    Attributes
    ----------
    map : MarkerMap
        To the `moving` vertices.
    moving : ndarray of int, shape (N,)
    error_mm : float
        Mean distance between the linear map's lips and those of the weights within 0..1.
    lips_mm : float
        Mean distance of the lips of these weights from the cuer's, in her millimetres.
    """

    map: MarkerMap
    moving: NDArray[np.int64]
    error_mm: float
    lips_mm: float


def fit_face(
    scene: Scene, scale: float, own: tuple[Avatar, Face], other: Face, rng: np.random.Generator
) -> FaceMap:
    """Learn how the vertices of a foreign face follow the cuer's markers.

    Parameters
    ----------
    scene : Scene
    scale : float
        Millimetres in the scene's unit, as it is placed.
    own : tuple of Avatar and Face
        The built-in head.
    other : Face
        The foreign one, placed.
    rng : numpy.random.Generator
    """
    avatar, face = own
    shapes = mouth_shapes(scene)
    names = tuple(shapes)
    moved = scale * np.array([shapes[name] for name in names])
    rows = [FACE_MARKERS.index(name) for name in _MARKERS]
    a, b = face.landmarks(), other.landmarks()
    size = float(
        (b["corner_L"][0] - b["corner_R"][0]) / max(a["corner_L"][0] - a["corner_R"][0], 1)
    )
    at = _places(avatar.unit_rest[rows], a, b, size, other)
    corner, _, shares = other.hit(at)
    units = np.einsum("ukci,kc->uki", moved[:, other.triangles[corner]], shares)
    markers = _mouths(avatar.voice, rng)
    goal = (markers - avatar.unit_rest)[:, rows]
    # Mouths of the cuer as sums of the avatar's own shapes; what her markers then do to its
    # vertices is learned by ridge regression.
    weights = unit_weights(goal, units / size, names)
    lips = np.linalg.norm(np.tensordot(weights, units / size, axes=1) - goal, axis=2)
    largest = np.linalg.norm(moved, axis=2).max(axis=0)
    moving = np.flatnonzero(largest > 0.05)
    vertices = np.tensordot(weights, moved[:, moving], axes=1)
    still = np.zeros((1, len(moving), 3))
    found = learn(
        np.concatenate([markers, avatar.unit_rest[None]]),
        np.concatenate([vertices, still]),
        ridge=_RIDGE_MM2,
        rank=min(_RANK, len(names)),
        rest_markers=avatar.unit_rest,
        rest=still[0],
    )
    near = np.isin(moving, other.triangles[corner])
    error = np.linalg.norm((found.vertices(markers) - vertices)[:, near], axis=2)
    return FaceMap(found, moving, float(error.mean()), float(lips.mean()))


def _places(
    markers: FloatArray, a: dict[str, FloatArray], b: dict[str, FloatArray], size: float, face: Face
) -> FloatArray:
    """Return where the markers (K, 3) of the own mouth lie on another, x and y, shape (K, 2)."""
    middle = [0.5 * (x["upper"] + x["lower"]) for x in (a, b)]
    ratio = (middle[1][1] - b["chin"][1]) / (middle[0][1] - a["chin"][1])
    offset = markers - middle[0]
    high = np.where(offset[:, 1] < -15, ratio, size)
    at = middle[1][:2] + np.stack([size * offset[:, 0], high * offset[:, 1]], axis=1)
    missing = face.hit(at)[0] < 0
    for share in np.linspace(0.95, 0.3, 14):
        if not missing.any():
            break
        at[missing] = middle[1][:2] + share * (at[missing] - middle[1][:2])
        missing = face.hit(at)[0] < 0
    if missing.any():
        raise CueError("there is no skin around the mouth")
    return at


def _mouths(voice: Voice, rng: np.random.Generator) -> FloatArray:
    """Return the face markers (T, 63, 3) of many mouths, head at rest."""
    params = rng.standard_normal((_LESSONS, 7))
    return voice.face.shape(params)


def expression_shapes(
    scene: Scene, scale: float, has_eye_bones: bool
) -> dict[str, tuple[NDArray[np.int64], FloatArray]]:
    """Return the blend shapes of brows, lids and cheeks: vertices, and displacements in mm.

    A file that blinks with both eyes at once gives each lid its half.
    """
    found = {}
    wanted = [*_GAZE, "browInnerUp", "breath"]
    for stem in ("eyeBlink", "eyeSquint", "eyeWide", "browDown", "browOuterUp", "cheekSquint"):
        wanted += [f"{stem}Left", f"{stem}Right"]
    for name in wanted:
        moved = scene.shapes.get(name)
        if moved is None and name.startswith("eyeBlink") and "blink" in scene.shapes:
            middle = eye_places(scene)[:, 0].mean()
            side = 1 if name.endswith("Left") else -1
            moved = scene.shapes["blink"] * (side * (scene.points[:, 0] - middle) > 0)[:, None]
        if moved is None:
            moved = np.zeros_like(scene.points)
        if name in _GAZE and has_eye_bones:
            eyes = scene.share("leftEye", "rightEye") > 0.5
            moved = np.where(eyes[:, None], 0, moved)
        vertices = np.flatnonzero(np.linalg.norm(scale * moved, axis=1) > 0.02)
        found[name] = vertices, scale * moved[vertices]
    return found
