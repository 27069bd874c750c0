"""ARKit's face weights from the markers, so that other avatars can replace ours.

Markers of the face (head at rest) come in, the 52 weights go out (`receiver.drawing.units`). The
asset of the avatar holds the units. Eyes are not measured by the markers: their lids follow the
avatar's blinking, the rest stays zero.
"""

import csv
import io
from functools import partial

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from receiver.drawing.avatar import Avatar
from receiver.drawing.movement import express
from receiver.drawing.units import ARKIT_NAMES, unit_weights


def arkit_weights(motion: Motion, avatar: Avatar) -> NDArray[np.float64]:
    """Return the weights of every frame, shape (T, 52), 0..1, columns as `ARKIT_NAMES`.

    Parameters
    ----------
    motion : Motion
    avatar : Avatar
        Of the motion's voice.
    """
    voice = avatar.voice
    columns = [ARKIT_NAMES.index(name) for name in avatar.unit_names]
    shapes = voice.face.shape(motion.params[:, voice.face_columns[:7]])
    weights = np.zeros((len(shapes), len(ARKIT_NAMES)))
    weights[:, columns] = unit_weights(shapes - avatar.unit_rest, avatar.units, avatar.unit_names)
    added = express(voice, partial(sample_params, motion), motion.times_s)
    for name in set(added.shapes) & set(ARKIT_NAMES) - set(avatar.unit_names):
        weights[:, ARKIT_NAMES.index(name)] = added.shapes[name]
    return weights


def live_link_csv(motion: Motion, voice: Voice, avatar: Avatar) -> str:
    """Return the weights as a Live Link Face table: time code, 52 weights, 9 rotations.

    Head rotations are in radians; those of the eyes are zero.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    titles = [name[0].upper() + name[1:] for name in ARKIT_NAMES]
    turns = [
        f"{part}{axis}"
        for part in ("Head", "LeftEye", "RightEye")
        for axis in ("Yaw", "Pitch", "Roll")
    ]
    writer.writerow(["Timecode", "BlendShapeCount", *titles, *turns])
    head = voice.face.motion(motion.params[:, voice.face_columns[7:]])
    for time_s, row, turn in zip(motion.times_s, arkit_weights(motion, avatar), head, strict=True):
        rotations = [turn[1], -turn[0], -turn[2], *[0.0] * 6]
        writer.writerow(
            [_time_code(time_s), 61, *(f"{v:.5f}" for v in row), *(f"{v:.5f}" for v in rotations)]
        )
    return text.getvalue()


def _time_code(time_s: float) -> str:
    """Return hours:minutes:seconds:frames.fraction at 60 frames per second.

    Examples
    --------
    >>> _time_code(3723.5125)
    '01:02:03:30.750'
    """
    whole = int(time_s)
    frames = (time_s - whole) * 60
    return f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}:{frames:06.3f}"
