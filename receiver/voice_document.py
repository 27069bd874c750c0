"""A voice as the page's document: the matrices of the paper's two algorithms and the camera.

The page rebuilds the markers from them (``page/model.js``); numbers travel as base64 of
little-endian float64, so both sides compute from the same values.
"""

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from codec.layout import MARKERS, N_FACE
from codec.voice import Voice
from receiver.camera import ASPECT, Camera, frame_cuer

_FACE_ARRAYS = ("mean", "directions", "pivot", "motion_mean", "motion_directions", "weights")
_HAND_ARRAYS = (
    "angle_mean", "angle_directions", "regression", "pivot", "motion_mean", "motion_directions",
)  # fmt: skip


def _encode(array: ArrayLike) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode()


def neutral_camera(voice: Voice) -> Camera:
    """Return the camera that frames the voice's neutral posture."""
    neutral = voice.reconstruct(np.zeros((1, len(voice.layout)), dtype=np.float32))[0]
    return frame_cuer(neutral)


def voice_document(voice: Voice) -> dict[str, Any]:
    """Return what ``/voice.json`` serves.

    Parameters
    ----------
    voice : Voice

    Returns
    -------
    dict
        ``identity``, ``layout``, ``markers``, ``face_markers``, ``aspect``, ``camera``, and the
        arrays of ``face`` and ``hand`` under the names of `codec.models`.
    """
    camera = neutral_camera(voice)
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
        "face": {name: _encode(getattr(voice.face, name)) for name in _FACE_ARRAYS},
        "hand": {name: _encode(getattr(voice.hand, name)) for name in _HAND_ARRAYS},
    }
