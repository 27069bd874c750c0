"""An avatar out of a file of others: the whole way.

A VRM or a glTF with a humanoid's bones, fingers and face shapes comes in, and a voice; out goes an
`Avatar` as the built-in one is, with a report of how well it fits. The head is scaled so that eyes,
mouth and chin lie nearest to the cuer's; the hand takes her lengths, and is shifted to the places
of the foreign face.
"""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, SHAPES
from codec.errors import CueError
from receiver.drawing.avatar import Avatar, Surface, load_avatar
from receiver.drawing.maps import MarkerMap, learn
from receiver.drawing.mouth import Mouth
from receiver.drawing.skeleton import Reach, key_poses
from receiver.drawing.voice_document import neutral_camera
from receiver.foreign.arms import Arms, pose_arms
from receiver.foreign.container import read_container
from receiver.foreign.face import (
    READABLE,
    expression_shapes,
    eye_places,
    fit_face,
    foreign_face,
    mouth_shapes,
    own_face,
)
from receiver.foreign.hand import ForeignHand, joint_map, lesson
from receiver.foreign.landmarks import Face, place_moves
from receiver.foreign.names import RIGHT_FINGERS, terms
from receiver.foreign.paint import Painted, SkinMaterial, paint, read_materials
from receiver.foreign.scene import Scene, read_scene

FloatArray = NDArray[np.float64]

_MOST = 60_000
"""Vertices of a surface at most: 16 bits number them."""

_HAND_RANK = 24
"""Directions of displacement that the map of the hand keeps."""

_RIDGE_MM2 = 0.02
"""Ridge of that map: markers move by millimetres, so it bounds what small ones may cause."""

_SEED = 34
"""Seed number of the poses that maps are learnt from: the same file gives the same avatar."""

_BELOW_MM = 60.0
"""How far below the picture the figure goes on."""

_NECK_SHARE = 0.5
"""Share of the head's motion in the neck's bone."""

_PALM = ("rightHand", *RIGHT_FINGERS)


@dataclass(frozen=True, slots=True)
class Fit:
    """How a foreign figure fits, all lengths in the cuer's millimetres.

    Attributes
    ----------
    readable_lips : bool
        Whether the file has enough shapes of the mouth for lip reading.
    lips_mm : float
        Mean distance of the lips from hers.
    hand_mm : float
        Mean distance of the hand's vertices from where the bones put them, in poses not learnt.
    stretch : float
        Largest change of the upper arm's length over all keys, as a share.
    moves_mm : dict of str to float
        How far the place of each key is shifted.
    terms : str
        Name, author and licence of the figure, as the file states them.
    """

    readable_lips: bool
    lips_mm: float
    hand_mm: float
    stretch: float
    moves_mm: dict[str, float]
    terms: str


def foreign_avatar(path: str | os.PathLike[str], voice: Voice) -> tuple[Avatar, Fit]:
    """Build an avatar from a VRM or glTF file.

    Parameters
    ----------
    path : str or path
        A ``.vrm`` (0 or 1) or ``.glb`` file.
    voice : Voice
        Whose parameters drive it; it has a built-in avatar.

    Raises
    ------
    CueError
        If the file is damaged, too large, or lacks bones, fingers, eyes or a mouth that opens.
    """
    file = read_container(path)
    scene, materials = read_scene(file), read_materials(file)
    rng = np.random.default_rng(_SEED)
    avatar = load_avatar(voice)
    own, eyes = own_face(avatar), eye_places(scene)
    try:
        # 1. Place the figure so that eyes and mouth are the cuer's. 2. Pose the arms so that hands
        # reach its own face. 3. Learn the face's map. 4. Cut out what the camera sees.
        scale, shift = _placing(own, scene, eyes)
        points = scale * scene.points + shift
        place = {bone: scale * scene.place(bone) + shift for bone in scene.bones}
        other = foreign_face(scene, points, scale * eyes + shift, scale)
        _, motions, tips = key_poses(voice)
        joints = joint_map(voice)
        cueing = np.tile(PLACEMENTS, len(SHAPES)) != "rest"
        moves = place_moves(own, other, _mean_places(tips))
        reach = Reach.to(
            np.array(list(_mean_places(tips).values())), np.array(list(moves.values()))
        )
        arms = pose_arms(scene, points, place, voice, motions[cueing], joints.rest, reach)
        face = fit_face(scene, scale, (avatar, own), other, rng)
    except (CueError, np.linalg.LinAlgError) as error:
        raise CueError(f"{scene.name}: {str(error).removeprefix(scene.name + ': ')}") from error
    bottom = neutral_camera(voice)
    low = bottom.centre[1] - 0.5 * bottom.height_mm - _BELOW_MM
    seen = (arms.points[scene.triangles, 1] > low).any(axis=1)
    of_hand = (scene.share(*_PALM) > 0.01)[scene.triangles].any(axis=1)
    hand = ForeignHand.of(scene, points, place)
    palm, hand_mm = _hand_surface(
        scene, points, arms, hand, joints, voice, (seen & of_hand, materials), rng
    )
    head, control = _head_surface(scene, arms, face.map, face.moving, (seen & ~of_hand, materials))
    avatar = _assembled(scene, scale, eyes * scale + shift, head, control, palm, arms, voice)
    readable = mouth_shapes(scene).keys() >= READABLE
    far = {name: float(np.linalg.norm(move)) for name, move in moves.items()}
    return avatar, Fit(readable, face.lips_mm, hand_mm, arms.stretch, far, terms(file))


def _mean_places(tips: FloatArray) -> dict[str, FloatArray]:
    """Return where the finger points, head at rest, for each placement but rest: (3,) each."""
    every = tips.reshape(len(SHAPES), len(PLACEMENTS), 3)[1:].mean(axis=0)
    return {name: every[k] for k, name in enumerate(PLACEMENTS) if name != "rest"}


def _placing(own: Face, scene: Scene, eyes: FloatArray) -> tuple[float, FloatArray]:
    """Return scale and shift (3,) that bring eyes, mouth and chin nearest to the cuer's."""
    a = own.landmarks()
    b = foreign_face(scene, scene.points, eyes, 1.0).landmarks()
    names = ("eye_R", "eye_L", "corner_R", "corner_L", "upper", "lower", "chin")
    p, q = (np.array([found[name] for name in names]) for found in (b, a))
    middle, goal = p.mean(axis=0), q.mean(axis=0)
    scale = float(((p - middle) * (q - goal)).sum() / ((p - middle) ** 2).sum())
    return scale, goal - scale * middle


def _surface(
    control: NDArray[np.int64],
    rest: FloatArray,
    found: MarkerMap,
    moving: NDArray[np.int64],
    painted: Painted,
) -> Surface:
    """Return a surface over the vertices `control`; `moving` of them follow the markers."""
    number = np.zeros(len(rest), dtype=np.int64)
    number[control] = np.arange(len(control))
    keep = np.isin(moving, control)
    basis = found.basis.reshape(len(found.basis), -1, 3)[:, keep]
    return Surface(
        found.rest_markers, rest[control], found.coefficients, basis, number[moving[keep]],
        number[painted.sources], painted.shares, np.zeros_like(painted.shares),
        painted.triangles, painted.colours,
    )  # fmt: skip


def _head_surface(
    scene: Scene,
    arms: Arms,
    found: MarkerMap,
    moving: NDArray[np.int64],
    paints: tuple[NDArray[np.bool_], list[SkinMaterial]],
) -> tuple[Surface, NDArray[np.int64]]:
    """Return the surface of all but the hand, eyeballs last, and the scene's vertices under it."""
    balls = [scene.share(name) > 0.5 for name in ("rightEye", "leftEye")]
    painted = paint(scene, arms.points, *paints, _MOST)
    kind = balls[0][painted.sources[:, 0]] + 2 * balls[1][painted.sources[:, 0]]
    order = np.argsort(kind, kind="stable")
    back = np.argsort(order)
    painted = Painted(
        painted.sources[order],
        painted.shares[order],
        back[painted.triangles],
        painted.colours[order],
    )
    control = np.unique(painted.sources)
    return _surface(control, arms.points, found, moving, painted), control


def _hand_surface(
    scene: Scene, points: FloatArray, arms: Arms, hand: ForeignHand, joints: MarkerMap,
    voice: Voice, paints: tuple[NDArray[np.bool_], list[SkinMaterial]], rng: np.random.Generator,
) -> tuple[Surface, float]:  # fmt: skip
    """Return the hand's surface, and the error of its map on poses that it was not learnt from."""
    painted = paint(scene, arms.points, *paints, _MOST)
    control = np.unique(painted.sources)

    # Linear blend skinning under the bones that the markers imply; what is no part of the hand
    # follows the forearm.
    def posed(markers: FloatArray) -> FloatArray:
        maps = hand.bones(joints.vertices(markers))
        share = scene.share(*_PALM)[control]
        still = (1 - share)[:, None] * arms.in_hand[control]
        out = np.repeat(still[None], len(markers), axis=0)
        for bone, found in maps.items():
            own = np.flatnonzero(scene.share(bone)[control])
            moved = points[control[own]] @ found[:, :, :3].transpose(0, 2, 1)
            moved += found[:, None, :, 3]
            out[:, own] += scene.share(bone)[control[own], None] * moved
        return np.asarray(out)

    def repeat(markers: FloatArray) -> FloatArray:
        return np.concatenate([posed(some) for some in np.array_split(markers, 8)])

    markers = voice.hand.shape(lesson(voice, rng))
    vertices = repeat(markers)
    # The receiver draws with a low-rank linear map from markers: learn it from many postures.
    found = learn(
        markers,
        vertices,
        ridge=_RIDGE_MM2,
        rank=_HAND_RANK,
        rest_markers=markers.mean(axis=0),
        rest=vertices.mean(axis=0),
    )
    unseen = voice.hand.shape(lesson(voice, rng)[-24:])
    error = float(np.linalg.norm(found.vertices(unseen) - repeat(unseen), axis=2).mean())
    rest = np.zeros_like(points)
    rest[control] = found.rest
    return _surface(control, rest, found, control, painted), error


def _assembled(
    scene: Scene, scale: float, eyes: FloatArray, head: Surface, control: NDArray[np.int64],
    palm: Surface, arms: Arms, voice: Voice,
) -> Avatar:  # fmt: skip
    # Only vertices that are drawn remain: renumber shapes and skeleton.
    number = np.full(len(scene.points), -1)
    number[control] = np.arange(len(control))
    shapes = {}
    for name, (vertices, moved) in expression_shapes(
        scene, scale, "rightEye" in scene.bones
    ).items():
        kept = number[vertices] >= 0
        shapes[name] = number[vertices[kept]], moved[kept]
    skeleton = arms.skeleton
    kept = number[skeleton.vertices] >= 0
    skeleton = type(skeleton)(
        number[skeleton.vertices[kept]],
        skeleton.weights[kept],
        skeleton.roots,
        skeleton.shoulders,
        skeleton.elbow,
        skeleton.forearm,
        skeleton.reach,
    )
    follow = scene.share("head", "jaw", "leftEye", "rightEye") + _NECK_SHARE * scene.share("neck")
    follow = (np.clip(follow, 0, 1)[control][head.sources] * head.shares).sum(axis=1)
    ranges = []
    for name in ("rightEye", "leftEye"):
        own = np.flatnonzero(scene.share(name)[control][head.sources[:, 0]] > 0.5)
        ranges.append([own[0] if len(own) else 0, len(own)])
    nothing = np.zeros((0, len(voice.face.mean), 3))
    return Avatar(
        voice, head, palm, np.stack([follow, follow], axis=1), no_mouth(), shapes,
        np.array(ranges), eyes, skeleton, (), voice.face.mean.astype(np.float64), nothing,
        ("own",),
    )  # fmt: skip


def no_mouth() -> Mouth:
    """Return the rule of lips that leaves all lips as they are."""
    none = np.zeros(0, dtype=np.int64)
    return Mouth(
        np.zeros((13, 0), dtype=np.int64), none, none, none, np.zeros(0), np.zeros((6, 0, 3)),
        np.zeros((2, 5)), 0, np.zeros(3),
    )  # fmt: skip
