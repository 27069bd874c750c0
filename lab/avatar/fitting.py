"""Head and hand of an avatar: maps from the markers, learnt from the cuer's own gestures.

Sentences are cued by the virtual cuer; each frame gives the markers and the true mesh. Head and
face are expressed in the frame of the voice's face model (head at rest), hand and forearm in that
of its hand model (forearm at rest), because that is where the receiver finds the markers before
it moves them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS, FOREARM, HAND_MARKERS, RIGID_FACE
from codec.cuer.voice import Voice
from lab.avatar.parts import FloatArray, IntArray, Part
from lab.body import arm_weights
from receiver.drawing.maps import MarkerMap, learn
from synth.motion.body.anatomy import identity
from synth.motion.body.body import Body, BodyPose, bone_factors, load_asset
from synth.motion.body.mesh import Mesh
from synth.motion.body.skeleton import arm_parents
from synth.motion.body.skin import Skin, stretch
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text

FACE_RANK, HAND_RANK = 10, 16
"""Directions of displacement that the linear maps keep, chosen for the size of the asset."""

_RATE_HZ = 12.5
"""Poses per second of the performance that the maps are learnt from: neighbours are alike."""

_STILL_MM = 0.08
"""Largest movement in mm of a vertex that counts as none."""

RIDGE_MM2 = 0.02
"""Weight of the ridge in mm2: the variance of a marker that is taken for noise."""

LESSON = (
    "Bonjour, nous parlons ici de la météo du jour, avec un grand plaisir et beaucoup de soleil "
    "sur les plages de Bretagne. Le chat gris dort sous la table pendant que Jeanne mange une "
    "pomme verte et joue au piano. Cette femme a vu un film ennuyeux, puis un bon feuilleton."
)
EXAM = "Huit oignons bruns, quatorze agneaux et une guitare, voilà ce que veut Gérard."
"""French sentences, ours: every hand shape, every placement, all vowels."""

RIGID = np.array([FACE_MARKERS.index(name) for name in RIGID_FACE])
CARRIER = np.array([HAND_MARKERS.index(name) for name in FOREARM])


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
            "shares": whole_shares(part.shares),
            "offsets": np.rint(part.offsets * 256).astype(np.int16),
            "triangles": part.triangles.astype(np.uint16),
            "colours": part.colours,
        }
        return {f"{prefix}_{name}": array for name, array in arrays.items()}


def whole_shares(shares: FloatArray) -> NDArray[np.uint8]:
    """Return shares in parts of 252 whose rows still sum to one."""
    parts = np.rint(shares * 252).astype(np.int64)
    largest = parts.argmax(axis=1)
    parts[np.arange(len(parts)), largest] += 252 - parts.sum(axis=1)
    return parts.astype(np.uint8)


def poses(body: Body, text: str) -> BodyPose:
    """Return the poses of a sentence that is cued at rest before and after."""
    synthesiser = GestureSynthesiser(body.name, rate_hz=_RATE_HZ)
    score = score_of_text(text, start_s=1.0)
    return synthesiser.pose(score, 0.0, int((score.keys[-1].end + 1.0) * _RATE_HZ))


def aligned(
    markers: FloatArray, points: FloatArray, reference: FloatArray, rigid: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Move every frame so that its `rigid` markers lie best on the reference (Kabsch 1976)."""
    middle, target = markers[:, rigid].mean(axis=1, keepdims=True), reference[rigid].mean(axis=0)
    products = np.einsum("tki,kj->tij", markers[:, rigid] - middle, reference[rigid] - target)
    u, _, v = np.linalg.svd(products)
    u[..., 2] *= np.sign(np.linalg.det(u @ v))[:, None]
    turn = u @ v
    return (markers - middle) @ turn + target, (points - middle) @ turn + target


def head_limb(mesh: Mesh, part: Part, body: Body, voice: Voice, origin: FloatArray) -> Limb:
    """Return the head's `part`, carried by the face markers of the cuer's body."""
    control = np.unique(part.sources)
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    rest = (mesh.vertices[control] - origin) * scale
    units = np.array(
        [
            mesh.units[name][control] * scale if name in mesh.units else np.zeros_like(rest)
            for name in body.unit_names
        ]
    )
    reference = voice.face.mean.astype(np.float64)

    def seen(pose: BodyPose) -> tuple[FloatArray, FloatArray]:
        still = np.zeros_like(pose.head)
        vertices = rest + np.tensordot(pose.units, units, axes=1)
        return aligned(body.face(pose.units, still), vertices, reference, RIGID)

    def decoded(pose: BodyPose) -> FloatArray:
        markers = body.markers(BodyPose(pose.units, 0 * pose.head, pose.angles, pose.forearm))
        params = voice.invert(markers, rate_hz=_RATE_HZ).params
        return voice.face.shape(params[:, :7])

    found, errors = _fit(body, seen, decoded, reference, FACE_RANK)
    # Where no unit of the lessons moves a vertex visibly, the map holds the markers' noise only.
    moved = np.tensordot(np.abs(poses(body, LESSON).units).max(axis=0), np.abs(units), axes=1)
    moving = np.flatnonzero(moved.max(axis=1) > _STILL_MM)
    return Limb(_scaled(part, scale), control, found, moving, errors)


def hand_limb(mesh: Mesh, part: Part, body: Body, voice: Voice, origin: FloatArray) -> Limb:
    """Return the hand's `part`, carried by the hand markers of the cuer's body."""
    control = np.unique(part.sources)
    raw, anatomy, _ = load_asset("hm08_markers"), *identity(body.name)
    weights = arm_weights(mesh)[control]
    lengths = raw["arm_lengths"] * anatomy.scale
    rest, origins = stretch(
        (mesh.vertices[control] - origin) * anatomy.scale,
        weights,
        raw["arm_frames"],
        raw["arm_origins"] * anatomy.scale,
        arm_parents(),
        bone_factors(anatomy, lengths),
    )
    skin = Skin(rest, weights, raw["arm_frames"], origins)
    reference = voice.hand.shape(np.zeros((1, voice.hand.n_shape)))[0]

    def seen(pose: BodyPose) -> tuple[FloatArray, FloatArray]:
        markers = body.hand(pose.angles, pose.forearm)
        vertices = skin.place(*body.arm_bones(pose.angles, pose.forearm))
        return aligned(markers, vertices, reference, CARRIER)

    def decoded(pose: BodyPose) -> FloatArray:
        params = voice.invert(body.markers(pose), rate_hz=_RATE_HZ).params
        return voice.hand.shape(params[:, voice.hand_columns[: voice.hand.n_shape]])

    found, errors = _fit(body, seen, decoded, reference, HAND_RANK)
    return Limb(part, control, found, np.arange(len(control)), errors)


def _fit(body: Body, seen: Any, decoded: Any, reference: FloatArray, rank: int) -> Any:
    """Learn a map from true and from decoded markers alike; measure it on the exam."""
    lesson, exam = poses(body, LESSON), poses(body, EXAM)
    markers, vertices = seen(lesson)
    rest_markers, rest = markers.mean(axis=0), vertices.mean(axis=0)
    found = learn(
        np.concatenate([markers, decoded(lesson)]),
        np.concatenate([vertices, vertices]),
        ridge=RIDGE_MM2,
        rank=rank,
        rest_markers=rest_markers,
        rest=rest,
    )
    markers, vertices = seen(exam)
    errors = {
        what: float(np.linalg.norm(found.vertices(m) - vertices, axis=-1).mean())
        for what, m in (("from true markers", markers), ("from parameters", decoded(exam)))
    }
    return found, errors


def _scaled(part: Part, scale: FloatArray) -> Part:
    return Part(part.sources, part.shares, part.offsets * scale, part.triangles, part.colours)
