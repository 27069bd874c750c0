"""Build an avatar: the cuer's mesh, bent by her own gestures, seen through her markers."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS
from codec.cuer.voice import Voice, load_voice
from lab.avatar.dressing import Wardrobe, draped
from lab.avatar.fitting import RIGID, Limb, aligned, hand_limb, head_limb
from lab.avatar.frames import joint_arrays, mean_forearm, motion_shares
from lab.avatar.hair import hair, hair_carriers
from lab.avatar.hand import hand_part
from lab.avatar.head import head_part, read_groups
from lab.avatar.limbs import pose_limbs
from lab.avatar.looks import LOOKS
from lab.avatar.mouth import lip_rings, mouth_arrays, rounded_units
from lab.avatar.parts import FloatArray, IntArray, join, triangulate
from lab.avatar.shapes import eye_arrays, mesh_shapes, shape_arrays
from synth.motion.body.body import Body, load_asset, load_body
from synth.motion.body.mesh import Mesh, read_mesh
from synth.motion.body.placing import face_places, hand_places, sample_skin
from synth.motion.body.skeleton import ARM_BONES

_LARYNX = "larynxRaise"


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
            **self.head.arrays("head"),
            **self.hand.arrays("hand"),
            "head_weights": np.rint(255 * self.head_weights).astype(np.uint8),
            **self.mouth,
            **self.shapes,
            **self.looks,
            **self.joints,
            "unit_names": np.array(self.unit_names),
            "unit_rest": self.unit_rest.astype(np.float32),
            "units": self.units.astype(np.float32),
        }


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
    rings = lip_rings(groups["body"], mesh.vertices)
    mesh = replace(mesh, units=rounded_units(mesh.units, rings))
    voice, body = load_voice(cuer), load_body(cuer)
    surface = sample_skin(mesh)
    places = face_places(mesh, surface, folder / "face63_hm08.json")
    face = places.of(mesh.vertices)
    origin = 0.5 * (face[FACE_MARKERS.index("EAR_R")] + face[FACE_MARKERS.index("EAR_L")])
    hand = hand_places(mesh, surface, load_asset("hm08_markers")["arm_frames"]).of(mesh.vertices)
    arm = _arm_share(mesh)
    in_world, in_hand = mean_forearm(mesh, body, voice, origin)
    skin = triangulate(groups["body"])
    limbs = pose_limbs(replace(mesh, vertices=draped(mesh.vertices, skin)), in_world)
    posed = limbs.mesh
    look = next(iter(LOOKS.values()))
    common = head_part(limbs, groups, face, arm, look)
    carriers = hair_carriers(posed.vertices)
    own = join([common, hair(posed.vertices, skin, carriers, look)])
    head = head_limb(posed, own, body, voice, origin)
    quads = groups["body"][(arm[groups["body"]] > 0.5).all(axis=1)]
    wrist = np.array([mesh.joints["wrist.R"][0], mesh.joints["lowerarm01.R"][0]])
    part = hand_part(quads, mesh.vertices, hand, wrist, look)
    limb = hand_limb(mesh, part, body, voice, origin)
    mouth, shapes, change = _mouth_and_shapes(posed, groups, head, body, origin)
    looks: dict[str, NDArray[Any]] = {
        "look_names": np.array(list(LOOKS)),
        "look_common": np.array([len(common.sources), len(common.triangles)], dtype=np.uint16),
    }
    wardrobe = Wardrobe(mesh, limbs, groups, in_world, places, target_folder)
    for name, other in list(LOOKS.items())[1:]:
        moved, dressed = wardrobe.wear(other)
        of_look = hair(posed.vertices + moved, skin, carriers, other)
        painted = head_part(limbs, groups, face, arm, other).colours
        scale = np.array(body.anatomy.face) * body.anatomy.scale
        joints = joint_arrays(dressed, head, body, voice, origin)
        looks |= {
            f"look_{name}_rest": np.rint(256 * moved[head.control] @ change).astype(np.int16),
            f"look_{name}_colours": np.concatenate([painted, of_look.colours]),
            f"look_{name}_offsets": np.rint(256 * of_look.offsets * scale).astype(np.int16),
            f"look_{name}_triangles": of_look.triangles.astype(np.uint16),
            f"look_{name}_hand": hand_part(quads, mesh.vertices, hand, wrist, other).colours,
            f"look_{name}_places": joints["joint_places"],
        }
    bones = joint_arrays(limbs, head, body, voice, origin) | {
        "joint_forearm": in_hand.astype(np.float32)
    }
    shares = motion_shares(posed, head.control, body, voice)
    return BuiltAvatar(head, limb, mouth, shapes, looks, bones, shares, *_arkit_units(body, voice))


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
    return (
        mouth,
        {
            **shape_arrays(found, head.control, np.diag(scale) @ turn),
            **eye_arrays(part, place, [number[ball[0]] for ball in balls]),
        },
        np.diag(scale) @ turn,
    )


def _arkit_units(body: Body, voice: Voice) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Return names, neutral markers and displacements of the units that ARKit knows."""
    known = [i for i, name in enumerate(body.unit_names) if name != _LARYNX]
    poses = np.concatenate([np.zeros((1, len(body.unit_names))), np.eye(len(body.unit_names))])
    markers = body.face_skin.rest + np.tensordot(poses, body.units, axes=1)
    reference = voice.face.mean.astype(np.float64)
    rest = markers[:1]
    _, seen = aligned(np.repeat(rest, len(poses), axis=0), markers, reference, RIGID)
    names = tuple(body.unit_names[i] for i in known)
    return names, seen[0], seen[1:][known] - seen[0]


def _arm_share(mesh: Mesh) -> FloatArray:
    """Return how far each vertex belongs to the right hand or forearm."""
    return np.asarray(sum(mesh.weights[f"{bone}.R"] for bone in ARM_BONES))
