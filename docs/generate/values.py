"""Numbers that pages state, taken from the code that defines them."""

from collections.abc import Mapping
from typing import Any

from codec.cuer.layout import N_FACE, N_HAND
from codec.cuer.voice import load_voice
from codec.cues.timeline import SUPERFRAME_S, TICK_S
from cuecast.evaluate.records import catalogue
from watermark import PROFILES
from watermark.audio.signal.profile import ROBUST, USUAL_GRADE


def values() -> dict[str, Any]:
    """Return the values that a page or template may name."""
    voice = load_voice()
    return {
        "superframe_s": SUPERFRAME_S,
        "tick_ms": round(1000 * TICK_S),
        "markers": N_FACE + N_HAND,
        "face_markers": N_FACE,
        "hand_markers": N_HAND,
        "parameters": len(voice.layout),
        **{f"{carrier}_profiles": _rates(profiles) for carrier, profiles in PROFILES.items()},
        "usual_grade": USUAL_GRADE,
        "robust_grade": ROBUST.grade,
        "clips": sorted(catalogue().values(), key=lambda clip: clip["name"]),
    }


def _rates(profiles: Mapping[str, Any]) -> str:
    """Return names and net bit rates of profiles in Markdown."""
    return ", ".join(f"`{profile.name}` {profile.net_bps}" for profile in profiles.values())
