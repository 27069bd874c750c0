"""ARKit's face weights from the markers, so that other avatars can replace ours.

Markers of the face (head at rest) come in, the 52 weights go out: non-negative least squares on
the displacements that each unit gives the markers, with a preference for small weights that are
alike on both sides: many units move the same few markers (Lawson and Hanson 1974, chapter 23). The
asset of the avatar holds the units. Eyes are
not measured by the markers: their lids follow the avatar's blinking, the rest stays zero.
"""

import csv
import io
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from receiver.drawing.avatar import Avatar
from receiver.drawing.movement import express

_SIDES = ("Left", "Right")


def _both(*stems: str) -> tuple[str, ...]:
    return tuple(f"{stem}{side}" for stem in stems for side in _SIDES)


ARKIT_NAMES = (
    *(f"eye{what}{side}" for side in _SIDES
      for what in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    "jawForward", "jawRight", "jawLeft", "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker",
    "mouthRight", "mouthLeft", *_both("mouthSmile", "mouthFrown", "mouthDimple", "mouthStretch"),
    "mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper",
    *_both("mouthPress", "mouthLowerDown", "mouthUpperUp", "browDown"),
    "browInnerUp", *_both("browOuterUp"), "cheekPuff", *_both("cheekSquint", "noseSneer"),
    "tongueOut",
)  # fmt: skip
"""The 52 weights in the order of Live Link Face files."""

assert len(ARKIT_NAMES) == len(set(ARKIT_NAMES)) == 52

_FIRMNESS_MM = 0.8
"""Displacement in mm that a full weight has to be worth: smaller ones are noise."""

_LIKENESS_MM = 8.0
"""Displacement in mm by which a difference between left and right has to be seen."""


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
    units = avatar.units.reshape(len(columns), -1).T
    alike = _LIKENESS_MM * _pairs(avatar.unit_names)
    system = np.vstack([units, _FIRMNESS_MM * np.eye(len(columns)), alike])
    shapes = voice.face.shape(motion.params[:, voice.face_columns[:7]])
    moved = (shapes - avatar.unit_rest).reshape(len(shapes), -1)
    weights = np.zeros((len(shapes), len(ARKIT_NAMES)))
    zeros = np.zeros(len(columns) + len(alike))
    for row, target in zip(weights, moved, strict=True):
        row[columns] = np.minimum(nnls(system, np.concatenate([target, zeros]))[0], 1.0)
    added = express(voice, partial(sample_params, motion), motion.times_s)
    for name in set(added.shapes) & set(ARKIT_NAMES) - set(avatar.unit_names):
        weights[:, ARKIT_NAMES.index(name)] = added.shapes[name]
    return weights


def _pairs(names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return a row for each unit that has a twin: the one's weight minus the other's."""
    rows = []
    for number, name in enumerate(names):
        twin = name.removesuffix("Left") + "Right"
        # The jaw and the mouth as a whole go to one side or the other.
        if name.endswith("Left") and name not in ("jawLeft", "mouthLeft") and twin in names:
            rows.append(np.zeros(len(names)))
            rows[-1][number], rows[-1][names.index(twin)] = 1, -1
    return np.array(rows).reshape(-1, len(names))


def live_link_csv(motion: Motion, voice: Voice, avatar: Avatar) -> str:
    """Return the weights as a Live Link Face table: time code, 52 weights, 9 rotations.

    Head rotations are in radians; those of the eyes are zero.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    titles = [name[0].upper() + name[1:] for name in ARKIT_NAMES]
    turns = [f"{part}{axis}" for part in ("Head", "LeftEye", "RightEye")
             for axis in ("Yaw", "Pitch", "Roll")]  # fmt: skip
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
