"""A coder and its decoder as one stream: what listeners at home will hear of a programme.

In: samples at 48 kHz; out: the samples that came through, later by the coder's delay. On it the
embedder rehearses the broadcast. Codecs are those of PyAV.
"""

import re
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

if TYPE_CHECKING:
    from watermark.audio.embed.codec_loop import CodecLoop
    from watermark.audio.signal.profile import AudioProfile

FS = 48_000
"""Rate in Hz of the rehearsed coder."""

_ENCODERS = {
    "aac": "aac",
    "mp2": "mp2",
    "mp3": "libmp3lame",
    "ac3": "ac3",
    "eac3": "eac3",
    "opus": "libopus",
}
"""Encoder of each name."""

USUAL = {"robust": "aac:64k", "standard": "aac:128k,mp2:192k", "high": "aac:128k,mp2:192k"}
"""Coders of a profile's rehearsal by default."""

_DECODED = ("fltp", "stereo", FS)
"""Format, layout and rate of the decoded sound."""

LONGEST_CHAIN = 4
"""Coders in a row: their delays add up, and the rehearsal looks for 8192 samples."""

Samples = NDArray[np.float32]


class CoderStream:
    """Code and decode without end, in stereo.

    Parameters
    ----------
    coder : str
        Name and bit rate, such as ``aac:128k``.

    Raises
    ------
    CueError
        If there is no such coder, or not at this rate.

    Examples
    --------
    >>> stream = CoderStream("mp2:192k")
    >>> stream.process(np.zeros((48000, 2), dtype=np.float32)).shape[1]
    2
    """

    def __init__(self, coder: str) -> None:
        match = re.fullmatch(r"(\w+):(\d+)k", coder)
        if match is None or match[1] not in _ENCODERS:
            known = ", ".join(_ENCODERS)
            raise CueError(f"coder {coder!r}: say it as aac:128k, known: {known}")
        name = _ENCODERS[match[1]]
        encoder: Any = av.CodecContext.create(name, "w")
        encoder.sample_rate, encoder.bit_rate = FS, int(match[2]) * 1000
        encoder.layout, encoder.format = "stereo", _format_of(encoder)
        try:
            encoder.open()
        except av.FFmpegError as error:
            raise CueError(f"coder {coder!r}: {error.strerror}") from error
        self._encoder = encoder
        self._decoder: Any = av.CodecContext.create(_decoder_of(match[1]), "r")
        self._decoder.extradata = encoder.extradata
        self._back = av.AudioResampler(*_DECODED)
        self._time = 0

    def process(self, sound: Samples) -> Samples:
        """Take samples, shape (n, 1 or 2); return the samples decoded by now, shape (m, 2)."""
        pair = np.repeat(sound, 2, axis=1) if sound.shape[1] == 1 else sound
        words = np.round(np.clip(pair, -1.0, 32767 / 32768) * 32768).astype(np.int16)
        frame = av.AudioFrame.from_ndarray(words.reshape(1, -1), format="s16", layout="stereo")
        frame.sample_rate, frame.pts = FS, self._time
        self._time += len(words)
        parts: list[NDArray[Any]] = [np.zeros((2, 0), dtype=np.float32)]
        for packet in self._encoder.encode(frame):
            for heard in self._decoder.decode(packet):
                plain = (heard.format.name, heard.layout.name, heard.rate) == _DECODED
                same = [heard] if plain else self._back.resample(heard)
                parts += [part.to_ndarray() for part in same]
        return np.ascontiguousarray(np.concatenate(parts, axis=1).T, dtype=np.float32)


class CoderChain:
    """Coders in a row: each takes the sound that the one before has decoded.

    Parameters
    ----------
    coders : sequence of str
        See `CoderStream`.

    Raises
    ------
    CueError
        If there is no such coder, or there are more than `LONGEST_CHAIN`.
    """

    def __init__(self, coders: Sequence[str]) -> None:
        if len(coders) > LONGEST_CHAIN:
            raise CueError(f"{len(coders)} coders in a row, limit {LONGEST_CHAIN}")
        self._streams = [CoderStream(coder) for coder in coders]

    def process(self, sound: Samples) -> Samples:
        """Take samples, shape (n, 1 or 2); return those that have passed all, shape (m, 2)."""
        for stream in self._streams:
            sound = stream.process(sound)
        return sound


def chains_of(through: str) -> tuple[tuple[str, ...], ...]:
    """Return the alternatives that ``--through`` names, each a row of coders.

    Commas separate alternatives, plus signs coders in a row. A list with commas that names a coder
    twice is one row: as an alternative the repetition would be idle.

    Examples
    --------
    >>> chains_of("aac:128k,mp2:192k")
    (('aac:128k',), ('mp2:192k',))
    >>> chains_of("mp2:192k+aac:128k")
    (('mp2:192k', 'aac:128k'),)
    >>> chains_of("aac:128k,mp3:128k,aac:128k")
    (('aac:128k', 'mp3:128k', 'aac:128k'),)
    """
    alternatives = through.split(",")
    if len(set(alternatives)) < len(alternatives):
        alternatives = ["+".join(alternatives)]
    return tuple(tuple(one.split("+")) for one in alternatives)


@cache
def is_rehearsed(profile: str, coder: str | None) -> bool:
    """Return whether a mark is rehearsed, see `make_rehearsal`.

    Parameters
    ----------
    profile : str
        Name of the mark's profile.
    coder : str or None

    Raises
    ------
    CueError
        If there is no such coder.
    """
    coder = coder or USUAL.get(profile, "none")
    if coder == "none":
        return False
    for chain in chains_of(coder):
        CoderChain(chain)
    return True


def make_rehearsal(profile: "AudioProfile", key: int, coder: str | None) -> "CodecLoop | None":
    """Prepare the rehearsal of a mark.

    Parameters
    ----------
    profile : AudioProfile
        Of the mark.
    key : int
        Its key.
    coder : str or None
        See `chains_of`; ``none`` for no rehearsal, None for the profile's `USUAL` ones.

    Raises
    ------
    CueError
        If there is no such coder.
    """
    if not is_rehearsed(profile.name, coder):
        return None
    # The mark's design takes as long to import as all the rest of a playout.
    from watermark.audio.embed.codec_loop import CodecLoop

    chains = chains_of(coder or USUAL[profile.name])
    names = ["+".join(chain) for chain in chains]
    return CodecLoop(profile, key, *map(CoderChain, chains), names=names)


def _format_of(encoder: Any) -> str:
    """Sample format that an encoder takes, the plainest first."""
    offered = [form.name for form in encoder.codec.audio_formats]
    return next((name for name in ("s16", "s16p", "fltp", "flt") if name in offered), offered[0])


def _decoder_of(name: str) -> str:
    return "libopus" if name == "opus" else name
