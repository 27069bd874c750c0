"""Where a cuer's bust is beside her markers: frames, joints, and what follows the head's motion."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import FACE_MARKERS
from codec.cuer.voice import Voice
from lab.avatar.fitting import CARRIER, LESSON, RIGID, Limb, aligned, poses
from lab.avatar.limbs import Limbs, forearm_points
from lab.avatar.parts import FloatArray, IntArray
from lab.body import neck_weights
from synth.motion.body.body import Body, load_asset
from synth.motion.body.mesh import Mesh
from synth.motion.body.skeleton import NECK_SHARE


def head_frame(body: Body, voice: Voice) -> tuple[FloatArray, FloatArray]:
    """Return turn and shift that take the body at rest into the frame of the voice's face."""
    rest = body.face_skin.rest[None]
    probe = np.concatenate([np.zeros((1, 3)), np.eye(3)])[None]
    _, (found,) = aligned(rest, probe, voice.face.mean.astype(np.float64), RIGID)
    return found[1:] - found[0], found[0]


def mean_forearm(
    mesh: Mesh, body: Body, voice: Voice, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the points of `forearm_points` as she cues on average: (4, 3), and (4, 3).

    First in the coordinates of the mesh, as the bust shows them; then in the frame of the voice's
    hand model, where the hand is at rest.
    """
    pose = poses(body, LESSON)
    turns, places = body.arm_bones(pose.angles, pose.forearm)
    mesh_points = forearm_points(mesh)
    rest = load_asset("hm08_markers")["arm_frames"][1]
    beside = (mesh_points[2:] - mesh_points[0]) @ rest @ turns[:, 1].transpose(0, 2, 1)
    elbow = places[:, :1]
    world = np.concatenate([elbow, places[:, 2:3], elbow + beside], axis=1)
    reference = voice.hand.shape(np.zeros((1, voice.hand.n_shape)))[0]
    hand = aligned(body.markers(pose)[:, len(FACE_MARKERS) :], world, reference, CARRIER)[1]
    turn, shift = head_frame(body, voice)
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    return (world.mean(axis=0) - shift) @ turn.T / scale + origin, hand.mean(axis=0)


def joint_arrays(
    limbs: Limbs, head: Limb, body: Body, voice: Voice, origin: FloatArray
) -> dict[str, NDArray[Any]]:
    """Return weights of the head's control vertices, and places of joints in the face's frame."""
    turn, shift = head_frame(body, voice)
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    places = np.concatenate([limbs.roots, limbs.shoulders, limbs.forearm])
    return {
        "joint_weights": np.rint(255 * limbs.weights[head.control]).astype(np.uint8),
        "joint_places": ((places - origin) * scale @ turn + shift).astype(np.float32),
    }


def motion_shares(mesh: Mesh, control: IntArray, body: Body, voice: Voice) -> FloatArray:
    """Return the share of the head's turn and shift per vertex, shape (M, 2).

    The voice's weights of the throat markers say what share of the head's motion belongs to a
    share of neck in the skin; vertices follow the same curve.
    """
    share = np.cumsum(NECK_SHARE)
    at_markers = body.face_skin.weights @ share
    order = np.argsort(at_markers)
    at_control = neck_weights(mesh)[control] @ share
    weights = np.stack(
        [
            np.interp(at_control, [0, *at_markers[order], 1], [0, *values[order], 1])
            for values in (voice.face.weights[:, :3].mean(1), voice.face.weights[:, 3:].mean(1))
        ],
        axis=1,
    )
    return np.asarray(np.clip(weights, 0, 1))
