"""Joints of the hand under its markers: what a foreign skeleton is posed by.

The virtual cuer's own bones, posed by sentences, give the joints; a linear map from the markers is
learnt as for the skin. `receiver.foreign` reads the asset.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from lab.avatar.fitting import CARRIER, EXAM, LESSON, RIDGE_MM2, aligned, poses
from receiver.drawing.maps import learn
from synth.motion.body.body import Body, BodyPose, load_body
from synth.motion.body.skeleton import ARM_BONES, FINGER_BONES

FloatArray = NDArray[np.float64]

_RANK = 24
"""Directions of displacement that the map keeps."""

JOINTS = ("elbow", "wrist", *(f"F{f}{p}" for f in range(1, 6) for p in ("1", "2", "3", "T")))
"""Elbow, wrist, and of every finger, thumb first, its three joints and its tip."""


def finger_joints(cuer: str) -> tuple[dict[str, NDArray[np.float32]], float]:
    """Return the arrays of the asset, and the mean error in mm on a sentence not learnt from."""
    body, voice = load_body(cuer), load_voice(cuer)
    reference = voice.hand.shape(np.zeros((1, voice.hand.n_shape)))[0]

    def seen(text: str) -> tuple[FloatArray, FloatArray]:
        pose = poses(body, text)
        markers = body.hand(pose.angles, pose.forearm)
        return aligned(markers, _joints(body, pose), reference, CARRIER)

    markers, joints = seen(LESSON)
    found = learn(
        markers,
        joints,
        ridge=RIDGE_MM2,
        rank=_RANK,
        rest_markers=markers.mean(axis=0),
        rest=joints.mean(axis=0),
    )
    markers, joints = seen(EXAM)
    error = float(np.linalg.norm(found.vertices(markers) - joints, axis=-1).mean())
    arrays = {
        "markers": found.rest_markers,
        "rest": found.rest,
        "coefficients": found.coefficients,
        "basis": found.basis,
    }
    return {name: array.astype(np.float32) for name, array in arrays.items()}, error


def _joints(body: Body, pose: BodyPose) -> FloatArray:
    """Return the joints (T, 22, 3) in the world, columns as `JOINTS`."""
    turns, places = body.arm_bones(pose.angles, pose.forearm)
    number = {name: i for i, name in enumerate(ARM_BONES)}
    found = [places[:, number["lowerarm01"]], places[:, number["wrist"]]]
    for bones in FINGER_BONES:
        found += [places[:, number[bone]] for bone in bones]
        last = number[bones[-1]]
        found.append(places[:, last] + body.arm_lengths[last] * turns[:, last, :, 1])
    return np.stack(found, axis=1)
