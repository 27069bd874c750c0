"""A voice as the page's document.

The matrices of the paper's two algorithms and the camera, as JSON; numbers travel as base64 of
little-endian float64, so that the page (``page/model.js``) computes from the same values.
"""

import base64
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from codec.cuer.layout import MARKERS, N_FACE, longest_finger_tip
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.score import SHAPES
from codec.superframe.resynthesis.targets import Targets
from receiver.drawing.avatar import has_avatar, load_avatar
from receiver.drawing.camera import ASPECT, Camera, frame_cuer
from receiver.drawing.movement import movement_document

_FACE_ARRAYS = ("mean", "directions", "pivot", "motion_mean", "motion_directions", "weights")
_HAND_ARRAYS = (
    "angle_mean",
    "angle_directions",
    "regression",
    "pivot",
    "motion_mean",
    "motion_directions",
)


def _encode(array: ArrayLike) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode()


def neutral_camera(voice: Voice) -> Camera:
    """Return the camera that frames the voice's neutral posture."""
    neutral = voice.reconstruct(np.zeros((1, len(voice.layout)), dtype=np.float32))[0]
    return frame_cuer(neutral)


def voice_document(voice: Voice, *, own_avatar: bool = False) -> dict[str, Any]:
    """Return what ``/voice.json`` serves.

    Parameters
    ----------
    voice : Voice
    own_avatar : bool
        Whether an avatar of the viewer's replaces the voice's, in all its looks.

    Returns
    -------
    dict
        ``identity``, ``layout``, ``markers``, ``face_markers``, ``aspect``, ``camera``,
        ``movement`` (constants of the hand's clock, and where it is for each key, mm),
        ``rules`` (`receiver.drawing.movement`), ``looks`` (appearances of the avatar),
        ``pointing`` (marker of each shape), ``gestures`` (targets, as parameters), and the arrays
        of ``face`` and ``hand`` under the names of
        `codec.cuer.models`.
    """
    camera = neutral_camera(voice)
    looks = list(load_avatar(voice).looks) if has_avatar(voice) else []
    return {
        "identity": voice.identity,
        "layout": list(voice.layout),
        "markers": list(MARKERS),
        "face_markers": N_FACE,
        "aspect": ASPECT,
        "camera": {
            "centre": camera.centre,
            "height_mm": camera.height_mm,
            "distance_mm": camera.distance_mm,
        },
        "movement": _movement(voice),
        "rules": movement_document(voice),
        "looks": ["own"] if own_avatar else looks,
        "pointing": [longest_finger_tip(shape) for shape in SHAPES],
        "gestures": {
            "shapes": _encode(voice.gestures.shape_targets),
            "forearms": _encode(voice.gestures.placement_targets),
            "head": _encode(voice.gestures.neutral_head),
        },
        "face": {name: _encode(getattr(voice.face, name)) for name in _FACE_ARRAYS},
        "hand": {name: _encode(getattr(voice.hand, name)) for name in _HAND_ARRAYS},
    }


def _movement(voice: Voice) -> dict[str, Any]:
    targets = Targets.of(voice)
    return asdict(targets.movement) | {
        "rest_gap_s": DEFAULT_OPTIONS.rest_gap_s,
        "places": targets.places.round(1).tolist(),
    }
