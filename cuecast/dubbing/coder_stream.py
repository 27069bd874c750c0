"""A coder and its decoder as one stream: what listeners at home will hear of a programme.

In: samples at 48 kHz; out: the samples that came through, later by the coder's delay. On it the
embedder rehearses the broadcast. Codecs are those of PyAV.
"""

import re
from collections.abc import Callable, Sequence
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

FRUGAL = 96_000
"""Bits per second and channel below which a rehearsal hears the output's own coder. On the usual
ones alone 394 of 575 superframes of five clips arrive below it, none of a pop song's in MP3 at 96
kbit/s; on their own 554 (`python -m tests.bench.frugal_sound`)."""

FRAME_SHIFT = 1
"""Samples that a sound is later than before where its codec is that of the programme: with frames
in the same places a coder rounds back to the values that the programme was coded with, and the mark
away. Of a film's sound in AAC at 96 kbit/s .71 of the information that is needed was left, and 1.4
to 1.6 with frames 1 to 32 samples away."""

BREATH = 1e-5
"""Deviation of the noise that sound gets before it is coded as AAC: a third of the last of 16 bits.

After two frames of digital silence, such as a transport stream begins with, FFmpeg's coder leaves
less of a mark for 8 s: at 72 kbit/s .25 to .29 of a talk's bits were wrong, .12 to .18 where the
silence had noise of 5e-6 or more. Of 14 transport streams .21 of all bits were wrong without, .20
with it; of the one that lost most .21 and .24.
"""

LONGEST_CHAIN = 4
"""Coders in a row: their delays add up, and the rehearsal looks for 8192 samples."""

Samples = NDArray[np.float32]


class CoderStream:
    """Code and decode without end; the output is in stereo.

    Parameters
    ----------
    coder : str
        Name and bit rate, such as ``aac:128k``; ``aac:64k:mono`` codes the middle of both channels.

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
        match = re.fullmatch(r"(\w+):(\d+)k(:mono)?", coder)
        if match is None or match[1] not in _ENCODERS:
            known = ", ".join(_ENCODERS)
            raise CueError(f"coder {coder!r}: say it as aac:128k, known: {known}")
        self._layout = "mono" if match[3] else "stereo"
        name = _ENCODERS[match[1]]
        encoder: Any = av.CodecContext.create(name, "w")
        encoder.sample_rate, encoder.bit_rate = FS, int(match[2]) * 1000
        encoder.layout, encoder.format = self._layout, _format_of(encoder)
        try:
            encoder.open()
        except av.FFmpegError as error:
            raise CueError(f"coder {coder!r}: {error.strerror}") from error
        self._encoder = encoder
        self._decoder: Any = av.CodecContext.create(_decoder_of(match[1]), "r")
        self._decoder.extradata = encoder.extradata
        self._decoded = "fltp", self._layout, FS
        self._back = av.AudioResampler(*self._decoded)
        self._time = 0

    def process(self, sound: Samples) -> Samples:
        """Take samples, shape (n, 1 or 2); return the samples decoded by now, shape (m, 2)."""
        if self._layout == "mono":
            sound = sound.mean(axis=1, keepdims=True)
        elif sound.shape[1] == 1:
            sound = np.repeat(sound, 2, axis=1)
        words = np.round(np.clip(sound, -1.0, 32767 / 32768) * 32768).astype(np.int16)
        frame = av.AudioFrame.from_ndarray(words.reshape(1, -1), format="s16", layout=self._layout)
        frame.sample_rate, frame.pts = FS, self._time
        self._time += len(words)
        parts: list[NDArray[Any]] = [np.zeros((sound.shape[1], 0), dtype=np.float32)]
        for packet in self._encoder.encode(frame):
            for heard in self._decoder.decode(packet):
                plain = (heard.format.name, heard.layout.name, heard.rate) == self._decoded
                same = [heard] if plain else self._back.resample(heard)
                parts += [part.to_ndarray() for part in same]
        decoded = np.concatenate(parts, axis=1).T
        pair = np.repeat(decoded, 2, axis=1) if self._layout == "mono" else decoded
        return np.ascontiguousarray(pair, dtype=np.float32)


class Breath:
    """Noise of `BREATH` in sound that is given block by block, however it is cut.

    Examples
    --------
    >>> heard = Breath(1).on(np.zeros((48000, 1), np.float32))
    >>> round(float(heard.std()), 6)
    1e-05
    """

    def __init__(self, channels: int) -> None:
        self._at = 0
        self._noise = np.random.default_rng(0).normal(0, BREATH, (FS, channels))

    def on(self, sound: Samples) -> Samples:
        """Return the next samples, shape (n, channels), with their noise."""
        places = (self._at + np.arange(len(sound))) % len(self._noise)
        self._at += len(sound)
        return np.asarray(sound + self._noise[places], np.float32)


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


def coders_for(profile: str, encoder: str, bit_rate: int, channels: int) -> str | None:
    """Return the coders that a mark is rehearsed on without a choice, in an output of this kind.

    To the profile's `USUAL` ones comes the output's own where it leaves less, in place of one that
    is the same but for its rate. Of more than two channels, each has the same share of the rate but
    a sixth and eighth one, which are taken for bass, and two are rehearsed.

    Parameters
    ----------
    profile : str
        Name of the mark's profile.
    encoder : str
        FFmpeg's name of the output's encoder.
    bit_rate : int
        Bits per second, 0 if it loses nothing.
    channels : int

    Returns
    -------
    str or None
        See `chains_of`; None if marks of this profile are not rehearsed.

    Examples
    --------
    >>> coders_for("standard", "aac", 96_000, 2), coders_for("standard", "aac", 192_000, 2)
    ('aac:96k,mp2:192k', 'aac:128k,mp2:192k')
    >>> coders_for("standard", "libmp3lame", 64_000, 1)
    'aac:128k,mp2:192k,mp3:64k:mono'
    >>> coders_for("standard", "aac", 192_000, 6)
    'aac:76k,mp2:192k'
    """
    usual = USUAL.get(profile)
    name = next((name for name, own in _ENCODERS.items() if own == encoder), None)
    if usual is None or name is None:
        return usual
    full = channels - (channels in (6, 8))
    if full > 2:
        bit_rate, full = bit_rate * 2 // full, 2
    if not 0 < bit_rate < FRUGAL * full:
        return usual
    coders = usual.split(",")
    like = next((coder for coder in coders if coder.startswith(f"{name}:")), None)
    if like is not None and 1000 * int(like[len(name) + 1 : -1]) <= bit_rate:
        return usual
    own = f"{name}:{bit_rate // 1000}k{':mono' if full == 1 else ''}"
    try:
        CoderStream(own)
    except CueError:  # such as a rate that it does not know at 48 kHz
        return usual
    if like is None:
        return f"{usual},{own}"
    return ",".join(own if coder == like else coder for coder in coders)


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


def make_rehearsal(
    profile: "AudioProfile", key: int, coder: str | None, skipped: int = 0
) -> "CodecLoop | None":
    """Prepare the rehearsal of a mark.

    Parameters
    ----------
    profile : AudioProfile
        Of the mark.
    key : int
        Its key.
    coder : str or None
        See `chains_of`; ``none`` for no rehearsal, None for the profile's `USUAL` ones.
    skipped : int
        Samples at 48 kHz of the output before the first that is rehearsed.

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
    return CodecLoop(profile, key, *map(CoderChain, chains), names=names, skipped=skipped)


def make_line_rehearsal(
    profile: "AudioProfile",
    key: int,
    encoder: str,
    channels: int,
    bit_rate: Callable[[], int],
    skipped: int = 0,
) -> "CodecLoop | None":
    """Prepare the rehearsal, without a choice of coders, of a line whose rate becomes known later.

    Parameters
    ----------
    profile, key, skipped
        As for `make_rehearsal`.
    encoder, channels
        As for `coders_for`. A coder that is none of the profile's usual ones is not heard: whether
        it is frugal is not known when the rehearsal begins.
    bit_rate : callable
        Gives the line's bits per second; called when the first sound is rehearsed.
    """
    usual = USUAL.get(profile.name)
    if usual is None:
        return None
    from watermark.audio.embed.codec_loop import CodecLoop

    @cache
    def chosen() -> list[str]:
        coders = coders_for(profile.name, encoder, bit_rate(), channels)
        return (coders or usual).split(",")

    names = usual.split(",")
    late = [_LateCoder(chosen, number) for number in range(len(names))]
    return CodecLoop(profile, key, *late, names=names, skipped=skipped)


class _LateCoder:
    """One of several coders, which are chosen when the first sound comes."""

    def __init__(self, chosen: Callable[[], list[str]], number: int) -> None:
        self._chosen, self._number = chosen, number
        self._stream: CoderStream | None = None

    def process(self, sound: Samples) -> Samples:
        self._stream = self._stream or CoderStream(self._chosen()[self._number])
        return self._stream.process(sound)


def _format_of(encoder: Any) -> str:
    """Sample format that an encoder takes, the plainest first."""
    offered = [form.name for form in encoder.codec.audio_formats]
    return next((name for name in ("s16", "s16p", "fltp", "flt") if name in offered), offered[0])


def _decoder_of(name: str) -> str:
    return "libopus" if name == "opus" else name
