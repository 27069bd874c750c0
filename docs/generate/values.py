"""Numbers that pages state, taken from the code that defines them."""

from typing import Any

from codec.cuer.layout import N_FACE, N_HAND
from codec.cuer.voice import load_voice
from codec.cues.timeline import SUPERFRAME_S, TICK_S
from cuecast.evaluate.records import catalogue
from watermark import PROFILES
from watermark.audio.signal.profile import ROBUST, USUAL_GRADE


def values() -> dict[str, Any]:
    """Return what `{{ ... }}` in a page may name."""
    voice = load_voice()
    return {
        "superframe_s": SUPERFRAME_S,
        "tick_ms": round(1000 * TICK_S),
        "markers": N_FACE + N_HAND,
        "face_markers": N_FACE,
        "hand_markers": N_HAND,
        "parameters": len(voice.layout),
        "profiles": PROFILES,
        "usual_grade": USUAL_GRADE,
        "robust_grade": ROBUST.grade,
        "clips": sorted(catalogue().values(), key=lambda clip: clip["name"]),
    }
