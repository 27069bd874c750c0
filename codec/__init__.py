"""The cuer as numbers, and those numbers as few bits.

A `Motion` is a cuer's movement as parameters over time; a `Voice` knows how to draw her from them.
Superframes of 0.64 s carry it on air, stream files keep it.

Examples
--------
A motion to bytes and back:

>>> import numpy as np
>>> from codec import Motion, decode_stream, encode_stream, load_voice
>>> voice = load_voice("claire")
>>> still = np.zeros((64, len(voice.layout)), dtype=np.float32)
>>> motion = Motion(still, rate_hz=50.0, start_s=0.0, layout=voice.layout, voice=voice.identity)
>>> stream = encode_stream(motion, voice, rate_bps=337.5)
>>> again = decode_stream(stream, voice)
>>> again.params.shape
(64, 31)
>>> voice.reconstruct(again.params).shape
(64, 113, 3)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from codec.analysis.compare import Comparison, compare_motions
    from codec.authentication.announcement import Announcement, SigningKey
    from codec.authentication.chain import Chain
    from codec.cuer.gestures import GestureTable
    from codec.cuer.models.face import FaceModel
    from codec.cuer.models.hand import HandModel
    from codec.cuer.motion import Motion, load_motion, save_motion
    from codec.cuer.voice import Voice, load_voice, save_voice
    from codec.cues.cueing import CueingOptions
    from codec.cues.language import Language, load_language
    from codec.cues.score import Key, Phone, Score
    from codec.errors import BitstreamError, CueError, VoiceError
    from codec.streamfile.inspect import inspect_stream
    from codec.streamfile.stream import decode_stream, encode_stream
    from codec.superframe.decoder import SuperframeDecoder
    from codec.superframe.encoder import SuperframeEncoder
    from codec.superframe.score_coding import ScorePart
    from codec.superframe.slow_channel import SlowSender
    from codec.superframe.superframe import DecodedSuperframe, Superframe
    from codec.superframe.window import Window

__all__ = [
    "Announcement",
    "BitstreamError",
    "Chain",
    "Comparison",
    "CueError",
    "CueingOptions",
    "DecodedSuperframe",
    "FaceModel",
    "GestureTable",
    "HandModel",
    "Key",
    "Language",
    "Motion",
    "Phone",
    "Score",
    "ScorePart",
    "SigningKey",
    "SlowSender",
    "Superframe",
    "SuperframeDecoder",
    "SuperframeEncoder",
    "Voice",
    "VoiceError",
    "Window",
    "compare_motions",
    "decode_stream",
    "encode_stream",
    "inspect_stream",
    "load_language",
    "load_motion",
    "load_voice",
    "save_motion",
    "save_voice",
]

_HOMES = {
    "Announcement": "codec.authentication.announcement",
    "BitstreamError": "codec.errors",
    "Chain": "codec.authentication.chain",
    "Comparison": "codec.analysis.compare",
    "CueError": "codec.errors",
    "CueingOptions": "codec.cues.cueing",
    "DecodedSuperframe": "codec.superframe.superframe",
    "FaceModel": "codec.cuer.models.face",
    "GestureTable": "codec.cuer.gestures",
    "HandModel": "codec.cuer.models.hand",
    "Key": "codec.cues.score",
    "Language": "codec.cues.language",
    "Motion": "codec.cuer.motion",
    "Phone": "codec.cues.score",
    "Score": "codec.cues.score",
    "ScorePart": "codec.superframe.score_coding",
    "SigningKey": "codec.authentication.announcement",
    "SlowSender": "codec.superframe.slow_channel",
    "Superframe": "codec.superframe.superframe",
    "SuperframeDecoder": "codec.superframe.decoder",
    "SuperframeEncoder": "codec.superframe.encoder",
    "Voice": "codec.cuer.voice",
    "VoiceError": "codec.errors",
    "Window": "codec.superframe.window",
    "compare_motions": "codec.analysis.compare",
    "decode_stream": "codec.streamfile.stream",
    "encode_stream": "codec.streamfile.stream",
    "inspect_stream": "codec.streamfile.inspect",
    "load_language": "codec.cues.language",
    "load_motion": "codec.cuer.motion",
    "load_voice": "codec.cuer.voice",
    "save_motion": "codec.cuer.motion",
    "save_voice": "codec.cuer.voice",
}
"""Where each name lives: it is imported when it is first asked for, so that importing is cheap."""

if not TYPE_CHECKING:  # type checkers would take any name for one of ours

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
