"""Build an avatar: the cuer's mesh, bent by her own gestures, seen through her markers.

Sentences are cued by the virtual cuer; each frame gives the markers and the true mesh. Head and
face are expressed in the frame of the voice's face model (head at rest), hand and forearm in that
of its hand model (forearm at rest), because that is where the receiver finds the markers before
it moves them.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS, FOREARM, HAND_MARKERS, RIGID_FACE
from codec.cuer.voice import Voice, load_voice
from lab.avatar.hair import hair, hair_carriers
from lab.avatar.hand import hand_part
from lab.avatar.head import head_part, read_groups
from lab.avatar.limbs import Limbs, forearm_points, pose_limbs
from lab.avatar.looks import LOOKS
from lab.avatar.maps import MarkerMap, learn
from lab.avatar.morph import morph, targets
from lab.avatar.mouth import lip_rings, mouth_arrays
from lab.avatar.parts import FloatArray, IntArray, Part, join, triangulate
from lab.avatar.shapes import eye_arrays, mesh_shapes, shape_arrays
from lab.body import arm_weights, neck_weights
from synth.motion.body.anatomy import identity
from synth.motion.body.body import Body, BodyPose, bone_factors, load_asset, load_body
from synth.motion.body.mesh import Mesh, read_mesh
from synth.motion.body.placing import face_places, hand_places, sample_skin
from synth.motion.body.skeleton import ARM_BONES, NECK_SHARE, arm_parents
from synth.motion.body.skin import Skin, stretch
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text

FACE_RANK, HAND_RANK = 10, 16
"""Directions of displacement that the linear maps keep, chosen for the size of the asset."""

_RATE_HZ = 12.5
"""Poses per second of the performance that the maps are learnt from: neighbours are alike."""

_STILL_MM = 0.08
"""Largest movement in mm of a vertex that counts as none."""

_INSIDE_MOUTH = ("helper-upper-teeth", "helper-lower-teeth", "helper-tongue")
"""Groups of the mesh inside the mouth."""

_LARYNX = "larynxRaise"

_RIDGE_MM2 = 0.02
"""Weight of the ridge in mm2: the variance of a marker that is taken for noise."""

_LESSON = (
    "Bonjour, nous parlons ici de la météo du jour, avec un grand plaisir et beaucoup de soleil "
    "sur les plages de Bretagne. Le chat gris dort sous la table pendant que Jeanne mange une "
    "pomme verte et joue au piano. Cette femme a vu un film ennuyeux, puis un bon feuilleton."
)
_EXAM = "Huit oignons bruns, quatorze agneaux et une guitare, voilà ce que veut Gérard."
"""French sentences, ours: every hand shape, every placement, all vowels."""

_RIGID = np.array([FACE_MARKERS.index(name) for name in RIGID_FACE])
_CARRIER = np.array([HAND_MARKERS.index(name) for name in FOREARM])


@dataclass(frozen=True, slots=True)
class Limb:
    """One of the two rigidly carried parts: its surface and its map from the markers."""

    part: Part
    control: IntArray
    map: MarkerMap
    moving: IntArray
    error_mm: dict[str, float]

    def arrays(self, prefix: str) -> dict[str, NDArray[Any]]:
        """Return the arrays of the asset."""
        number = np.full(self.control.max() + 1, -1)
        number[self.control] = np.arange(len(self.control))
        basis = self.map.basis.reshape(len(self.map.basis), -1, 3)
        basis = basis[:, self.moving]
        largest = np.abs(basis).max(axis=(1, 2))
        part = self.part
        arrays = {
            "markers": self.map.rest_markers.astype(np.float32),
            "rest": self.map.rest.astype(np.float32),
            "coefficients": (self.map.coefficients * largest / 32767).astype(np.float32),
            "basis": np.rint(basis * 32767 / largest[:, None, None]).astype(np.int16),
            "moving": self.moving.astype(np.uint16),
            "sources": number[part.sources].astype(np.uint16),
            "shares": _whole_shares(part.shares),
            "offsets": np.rint(part.offsets * 256).astype(np.int16),
            "triangles": part.triangles.astype(np.uint16),
            "colours": part.colours,
        }
        return {f"{prefix}_{name}": array for name, array in arrays.items()}


@dataclass(frozen=True, slots=True)
class BuiltAvatar:
    """A built avatar.

    Attributes
    ----------
    head, hand : Limb
    mouth : dict of str to ndarray
        Arrays of the lips and teeth.
    shapes : dict of str to ndarray
        Arrays of the blend shapes and eyes.
    looks : dict of str to ndarray
        Arrays of the appearances.
    joints : dict of str to ndarray
        Arrays of what the arms turn about, and of the vertices that follow.
    head_weights : ndarray, shape (V, 2)
        Share of the head's turn and shift that each control vertex of the head follows.
    unit_names : tuple of str
        Of the face units that ARKit knows and markers see.
    unit_rest : ndarray, shape (63, 3)
        Markers of the neutral face in the frame of the voice's face model.
    units : ndarray, shape (U, 63, 3)
        Displacement of the markers by each unit.
    """

    head: Limb
    hand: Limb
    mouth: dict[str, NDArray[Any]]
    shapes: dict[str, NDArray[Any]]
    looks: dict[str, NDArray[Any]]
    joints: dict[str, NDArray[Any]]
    head_weights: FloatArray
    unit_names: tuple[str, ...]
    unit_rest: FloatArray
    units: FloatArray

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of the asset (`receiver.drawing.avatar` reads them)."""
        return {
            **self.head.arrays("head"), **self.hand.arrays("hand"),
            "head_weights": np.rint(255 * self.head_weights).astype(np.uint8),
            **self.mouth,
            **self.shapes,
            **self.looks,
            **self.joints,
            "unit_names": np.array(self.unit_names),
            "unit_rest": self.unit_rest.astype(np.float32),
            "units": self.units.astype(np.float32),
        }  # fmt: skip


def _whole_shares(shares: FloatArray) -> NDArray[np.uint8]:
    """Return shares in parts of 252 whose rows still sum to one."""
    parts = np.rint(shares * 252).astype(np.int64)
    largest = parts.argmax(axis=1)
    parts[np.arange(len(parts)), largest] += 252 - parts.sum(axis=1)
    return parts.astype(np.uint8)


def error_mm(avatar: BuiltAvatar) -> dict[str, float]:
    """Return the errors of the maps on the sentence that they did not learn from."""
    return {
        f"{name} {what}": value
        for name, limb in (("face", avatar.head), ("hand", avatar.hand))
        for what, value in limb.error_mm.items()
    }


def build_avatar(folder: Path, target_folder: Path, cuer: str) -> BuiltAvatar:
    """Build the avatar of a cuer from the mesh in `folder`; her voice has to be built in.

    The appearances are built from the targets of hm08 in `target_folder`.

    Raises
    ------
    CueError
        If mesh or voice are missing.
    """
    mesh = read_mesh(folder)
    groups = read_groups(folder / "base.obj")
    voice, body = load_voice(cuer), load_body(cuer)
    surface = sample_skin(mesh)
    face = face_places(mesh, surface, folder / "face63_hm08.json").of(mesh.vertices)
    origin = 0.5 * (face[FACE_MARKERS.index("EAR_R")] + face[FACE_MARKERS.index("EAR_L")])
    hand = hand_places(mesh, surface, load_asset("hm08_markers")["arm_frames"]).of(mesh.vertices)
    arm = _arm_share(mesh)
    in_world, in_hand = _mean_forearm(mesh, body, voice, origin)
    limbs = pose_limbs(mesh, in_world)
    posed = limbs.mesh
    look = next(iter(LOOKS.values()))
    common = head_part(limbs, groups, face, arm, look)
    carriers = hair_carriers(posed.vertices)
    triangles = triangulate(groups["body"])
    own = join([common, hair(posed.vertices, triangles, carriers, look)])
    head = _head(posed, own, body, voice, origin)
    quads = groups["body"][(arm[groups["body"]] > 0.5).all(axis=1)]
    joints = np.array([mesh.joints["wrist.R"][0], mesh.joints["lowerarm01.R"][0]])
    part = hand_part(quads, mesh.vertices, hand, joints, look)
    weights = _weights(posed, head.control, body, voice)
    limb = _hand(mesh, part, body, voice, origin)
    mouth, shapes, change = _mouth_and_shapes(posed, groups, head, body, origin)
    looks: dict[str, NDArray[Any]] = {
        "look_names": np.array(list(LOOKS)),
        "look_common": np.array([len(common.sources), len(common.triangles)], dtype=np.uint16),
    }
    places = face_places(mesh, surface, folder / "face63_hm08.json")
    inside = np.unique(np.concatenate([
        groups[name].ravel() for name in _INSIDE_MOUTH
    ]))  # fmt: skip
    balls = [np.unique(groups[f"helper-{side}-eye"]) for side in "rl"]
    for name, other in list(LOOKS.items())[1:]:
        added = mesh.vertices + targets(other, target_folder, len(mesh.vertices))
        rings = lip_rings(groups["body"], mesh.vertices)
        moved = morph(mesh, other, target_folder, (face, places.of(added)), rings, inside, balls)
        # The targets are those of spread arms: the arm that is held up keeps its own.
        moved *= 1 - np.clip(limbs.weights[:, 1:3].sum(axis=1, keepdims=True), 0, 1)
        of_look = hair(posed.vertices + moved, triangles, carriers, other)
        painted = head_part(limbs, groups, face, arm, other).colours
        scale = np.array(body.anatomy.face) * body.anatomy.scale
        looks |= {
            f"look_{name}_rest": np.rint(256 * moved[head.control] @ change).astype(np.int16),
            f"look_{name}_colours": np.concatenate([painted, of_look.colours]),
            f"look_{name}_offsets": np.rint(256 * of_look.offsets * scale).astype(np.int16),
            f"look_{name}_triangles": of_look.triangles.astype(np.uint16),
            f"look_{name}_hand": hand_part(quads, mesh.vertices, hand, joints, other).colours,
        }
    bones = _joint_arrays(limbs, head, body, voice, origin) | {
        "joint_forearm": in_hand.astype(np.float32)
    }
    return BuiltAvatar(head, limb, mouth, shapes, looks, bones, weights, *_arkit_units(body, voice))


def _head_frame(body: Body, voice: Voice) -> tuple[FloatArray, FloatArray]:
    """Return turn and shift that take the body at rest into the frame of the voice's face."""
    rest = body.face_skin.rest[None]
    probe = np.concatenate([np.zeros((1, 3)), np.eye(3)])[None]
    _, (found,) = _aligned(rest, probe, voice.face.mean.astype(np.float64), _RIGID)
    return found[1:] - found[0], found[0]


def _mean_forearm(
    mesh: Mesh, body: Body, voice: Voice, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the points of `forearm_points` as she cues on average: (4, 3), and (4, 3).

    First in the coordinates of the mesh, as the bust shows them; then in the frame of the voice's
    hand model, where the hand is at rest.
    """
    pose = _poses(body, _LESSON)
    turns, places = body.arm_bones(pose.angles, pose.forearm)
    mesh_points = forearm_points(mesh)
    rest = load_asset("hm08_markers")["arm_frames"][1]
    beside = (mesh_points[2:] - mesh_points[0]) @ rest @ turns[:, 1].transpose(0, 2, 1)
    elbow = places[:, :1]
    world = np.concatenate([elbow, places[:, 2:3], elbow + beside], axis=1)
    reference = voice.hand.shape(np.zeros((1, voice.hand.n_shape)))[0]
    hand = _aligned(body.markers(pose)[:, len(FACE_MARKERS) :], world, reference, _CARRIER)[1]
    turn, shift = _head_frame(body, voice)
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    return (world.mean(axis=0) - shift) @ turn.T / scale + origin, hand.mean(axis=0)


def _joint_arrays(
    limbs: Limbs, head: Limb, body: Body, voice: Voice, origin: FloatArray
) -> dict[str, NDArray[Any]]:
    """Return weights of the head's control vertices, and places of joints in the face's frame."""
    turn, shift = _head_frame(body, voice)
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    places = np.concatenate([limbs.roots, limbs.shoulders, limbs.forearm])
    return {
        "joint_weights": np.rint(255 * limbs.weights[head.control]).astype(np.uint8),
        "joint_places": ((places - origin) * scale @ turn + shift).astype(np.float32),
    }


def _mouth_and_shapes(
    mesh: Mesh, groups: dict[str, IntArray], head: Limb, body: Body, origin: FloatArray
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]], FloatArray]:
    """Return the arrays of lips and teeth, those of blend shapes and eyes, and the frame.

    The frame (3, 3) takes millimetres of the mesh to those of the asset.
    """
    number = np.full(len(mesh.vertices), -1)
    number[head.control] = np.arange(len(head.control))
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    balls = [np.unique(groups[f"helper-{side}-eye"]) for side in "rl"]
    upper, lower = (groups[f"helper-{row}-teeth"] for row in ("upper", "lower"))
    # The frame of the asset: what is rigid shows where the mesh came to lie.
    rigid = number[np.unique(np.concatenate([*balls, upper.ravel()]))]
    rigid = rigid[rigid >= 0]
    before, after = mesh.vertices[head.control[rigid]] * scale, head.map.rest[rigid]
    u, _, v = np.linalg.svd((before - before.mean(0)).T @ (after - after.mean(0)))
    u[:, 2] *= np.sign(np.linalg.det(u @ v))
    turn = u @ v
    place = (mesh.vertices[head.control] * scale - before.mean(0)) @ turn + after.mean(0)
    used = np.unique(lower)
    front = used[number[used] >= 0]
    jaw = front[np.argmax(mesh.vertices[front, 2] + mesh.vertices[front, 1])]
    frame = (scale, turn, after.mean(0) - before.mean(0) @ turn)
    mouth = mouth_arrays(
        number[lip_rings(groups["body"], mesh.vertices)], place, number[jaw], frame
    )
    found = mesh_shapes(mesh, np.unique(groups["helper-tongue"]), np.concatenate(balls))
    part = replace(head.part, sources=number[head.part.sources])
    return mouth, {
        **shape_arrays(found, head.control, np.diag(scale) @ turn),
        **eye_arrays(part, place, [number[ball[0]] for ball in balls]),
    }, np.diag(scale) @ turn  # fmt: skip


def _arkit_units(body: Body, voice: Voice) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Return names, neutral markers and displacements of the units that ARKit knows."""
    known = [i for i, name in enumerate(body.unit_names) if name != _LARYNX]
    poses = np.concatenate([np.zeros((1, len(body.unit_names))), np.eye(len(body.unit_names))])
    markers = body.face_skin.rest + np.tensordot(poses, body.units, axes=1)
    reference = voice.face.mean.astype(np.float64)
    rest = markers[:1]
    _, seen = _aligned(np.repeat(rest, len(poses), axis=0), markers, reference, _RIGID)
    names = tuple(body.unit_names[i] for i in known)
    return names, seen[0], seen[1:][known] - seen[0]


def _arm_share(mesh: Mesh) -> FloatArray:
    """Return how far each vertex belongs to the right hand or forearm."""
    return np.asarray(sum(mesh.weights[f"{bone}.R"] for bone in ARM_BONES))


def _poses(body: Body, text: str) -> BodyPose:
    synthesiser = GestureSynthesiser(body.name, rate_hz=_RATE_HZ)
    score = score_of_text(text, start_s=1.0)
    return synthesiser.pose(score, 0.0, int((score.keys[-1].end + 1.0) * _RATE_HZ))


def _aligned(
    markers: FloatArray, points: FloatArray, reference: FloatArray, rigid: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Move every frame so that its `rigid` markers lie best on the reference (Kabsch 1976)."""
    middle, target = markers[:, rigid].mean(axis=1, keepdims=True), reference[rigid].mean(axis=0)
    products = np.einsum("tki,kj->tij", markers[:, rigid] - middle, reference[rigid] - target)
    u, _, v = np.linalg.svd(products)
    u[..., 2] *= np.sign(np.linalg.det(u @ v))[:, None]
    turn = u @ v
    return (markers - middle) @ turn + target, (points - middle) @ turn + target


def _head(mesh: Mesh, part: Part, body: Body, voice: Voice, origin: FloatArray) -> Limb:
    control = np.unique(part.sources)
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    rest = (mesh.vertices[control] - origin) * scale
    units = np.array([
        mesh.units[name][control] * scale if name in mesh.units else np.zeros_like(rest)
        for name in body.unit_names
    ])  # fmt: skip
    reference = voice.face.mean.astype(np.float64)

    def seen(pose: BodyPose) -> tuple[FloatArray, FloatArray]:
        still = np.zeros_like(pose.head)
        vertices = rest + np.tensordot(pose.units, units, axes=1)
        return _aligned(body.face(pose.units, still), vertices, reference, _RIGID)

    def decoded(pose: BodyPose) -> FloatArray:
        markers = body.markers(BodyPose(pose.units, 0 * pose.head, pose.angles, pose.forearm))
        params = voice.invert(markers, rate_hz=_RATE_HZ).params
        return voice.face.shape(params[:, :7])

    found, errors = _fit(body, seen, decoded, reference, FACE_RANK)
    # Where no unit of the lessons moves a vertex visibly, the map holds the markers' noise only.
    moved = np.tensordot(np.abs(_poses(body, _LESSON).units).max(axis=0), np.abs(units), axes=1)
    moving = np.flatnonzero(moved.max(axis=1) > _STILL_MM)
    return Limb(_scaled(part, scale), control, found, moving, errors)


def _hand(mesh: Mesh, part: Part, body: Body, voice: Voice, origin: FloatArray) -> Limb:
    control = np.unique(part.sources)
    raw, anatomy, _ = load_asset("hm08_markers"), *identity(body.name)
    weights = arm_weights(mesh)[control]
    lengths = raw["arm_lengths"] * anatomy.scale
    rest, origins = stretch(
        (mesh.vertices[control] - origin) * anatomy.scale, weights, raw["arm_frames"],
        raw["arm_origins"] * anatomy.scale, arm_parents(), bone_factors(anatomy, lengths),
    )  # fmt: skip
    skin = Skin(rest, weights, raw["arm_frames"], origins)
    reference = voice.hand.shape(np.zeros((1, voice.hand.n_shape)))[0]

    def seen(pose: BodyPose) -> tuple[FloatArray, FloatArray]:
        markers = body.hand(pose.angles, pose.forearm)
        vertices = skin.place(*body.arm_bones(pose.angles, pose.forearm))
        return _aligned(markers, vertices, reference, _CARRIER)

    def decoded(pose: BodyPose) -> FloatArray:
        params = voice.invert(body.markers(pose), rate_hz=_RATE_HZ).params
        return voice.hand.shape(params[:, voice.hand_columns[: voice.hand.n_shape]])

    found, errors = _fit(body, seen, decoded, reference, HAND_RANK)
    return Limb(part, control, found, np.arange(len(control)), errors)


def _fit(body: Body, seen: Any, decoded: Any, reference: FloatArray, rank: int) -> Any:
    """Learn a map from true and from decoded markers alike; measure it on the exam."""
    lesson, exam = _poses(body, _LESSON), _poses(body, _EXAM)
    markers, vertices = seen(lesson)
    rest_markers, rest = markers.mean(axis=0), vertices.mean(axis=0)
    found = learn(
        np.concatenate([markers, decoded(lesson)]), np.concatenate([vertices, vertices]),
        ridge=_RIDGE_MM2, rank=rank, rest_markers=rest_markers, rest=rest,
    )  # fmt: skip
    markers, vertices = seen(exam)
    errors = {
        what: float(np.linalg.norm(found.vertices(m) - vertices, axis=-1).mean())
        for what, m in (("from true markers", markers), ("from parameters", decoded(exam)))
    }
    return found, errors


def _scaled(part: Part, scale: FloatArray) -> Part:
    return Part(part.sources, part.shares, part.offsets * scale, part.triangles, part.colours)


def _weights(mesh: Mesh, control: IntArray, body: Body, voice: Voice) -> FloatArray:
    """Return the share of the head's turn and shift per vertex, shape (M, 2).

    The voice's weights of the throat markers say what share of the head's motion belongs to a
    share of neck in the skin; vertices follow the same curve.
    """
    share = np.cumsum(NECK_SHARE)
    at_markers = body.face_skin.weights @ share
    order = np.argsort(at_markers)
    at_control = neck_weights(mesh)[control] @ share
    weights = np.stack([
        np.interp(at_control, [0, *at_markers[order], 1], [0, *values[order], 1])
        for values in (voice.face.weights[:, :3].mean(1), voice.face.weights[:, 3:].mean(1))
    ], axis=1)  # fmt: skip
    return np.asarray(np.clip(weights, 0, 1))
