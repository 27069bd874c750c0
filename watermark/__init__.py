"""Bytes under a noisy programme.

Each carrier has an embedder and a receiver that take a programme block by block; they carry
superframes of two byte strings, L0 and L1, one every 0.64 s. `PROFILES` has their sizes.

Examples
--------
Bytes under a sound and out of it:

>>> import numpy as np
>>> from watermark import PROFILES, AudioEmbedder, AudioReceiver
>>> standard = PROFILES["audio"]["standard"]
>>> standard.l0_bytes, standard.l1_bytes, standard.net_bps
(20, 7, 337.5)
>>> sound = np.random.default_rng(0).normal(0, 0.1, (6 * 48000, 1)).astype(np.float32)
>>> embedder = AudioEmbedder(48000, 1, lambda k: (bytes([k] * 20), bytes([k] * 7)))
>>> marked = np.concatenate([embedder.process(sound), embedder.flush()])
>>> receiver = AudioReceiver(48000, 1)
>>> found = [*receiver.process(marked), *receiver.flush()]
>>> [superframe.l0[0] for superframe in found[:3]]
[0, 1, 2]
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from watermark.audio.embed.codec_loop import CodecLoop, CodecStream
    from watermark.audio.embed.embedder import AudioEmbedder
    from watermark.audio.embed.report import EmbedReport, SuperframeMargin
    from watermark.audio.receiver import AudioReceiver
    from watermark.audio.signal.profile import AudioProfile
    from watermark.link.superframe import ReceivedSuperframe
    from watermark.quality.movs import Movs
    from watermark.quality.peaq import PeaqResult, grade
    from watermark.video.coder_windows import PictureCoder
    from watermark.video.embed import VideoEmbedder, VideoReport
    from watermark.video.profile import VideoProfile
    from watermark.video.receive import VideoReceiver
    from watermark.video.strength_choice import TriedChannel

__all__ = [
    "PROFILES",
    "AudioEmbedder",
    "AudioProfile",
    "AudioReceiver",
    "CodecLoop",
    "CodecStream",
    "EmbedReport",
    "Movs",
    "PeaqResult",
    "PictureCoder",
    "ReceivedSuperframe",
    "SuperframeMargin",
    "TriedChannel",
    "VideoEmbedder",
    "VideoProfile",
    "VideoReceiver",
    "VideoReport",
    "grade",
]

_HOMES = {
    "AudioEmbedder": "watermark.audio.embed.embedder",
    "AudioProfile": "watermark.audio.signal.profile",
    "AudioReceiver": "watermark.audio.receiver",
    "CodecLoop": "watermark.audio.embed.codec_loop",
    "CodecStream": "watermark.audio.embed.codec_loop",
    "EmbedReport": "watermark.audio.embed.report",
    "Movs": "watermark.quality.movs",
    "PeaqResult": "watermark.quality.peaq",
    "PictureCoder": "watermark.video.coder_windows",
    "ReceivedSuperframe": "watermark.link.superframe",
    "SuperframeMargin": "watermark.audio.embed.report",
    "TriedChannel": "watermark.video.strength_choice",
    "VideoEmbedder": "watermark.video.embed",
    "VideoProfile": "watermark.video.profile",
    "VideoReceiver": "watermark.video.receive",
    "VideoReport": "watermark.video.embed",
    "grade": "watermark.quality.peaq",
}
"""Where each name lives: it is imported when it is first asked for, so that importing is cheap."""

_CARRIERS = {
    "audio": "watermark.audio.signal",
    "video": "watermark.video",
    "a335": "watermark.a335",
}

PROFILES: dict[str, dict[str, Any]]
"""Profiles by carrier and name; each states ``l0_bytes``, ``l1_bytes`` and ``net_bps``."""

if not TYPE_CHECKING:  # type checkers would take any name for one of ours

    def __getattr__(name: str) -> Any:
        if name == "PROFILES":
            return {
                carrier: import_module(f"{room}.profile").PROFILES
                for carrier, room in _CARRIERS.items()
            }
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
