"""Samples become packets of a sound stream in an output container."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import av
import numpy as np
from av.container import OutputContainer
from numpy.typing import NDArray

from codec.errors import CueError
from receiver.media.programme import SoundFormat, reason

_ENCODERS = {
    "mp3": "libmp3lame", "mp3float": "libmp3lame",
    "opus": "libopus", "vorbis": "libopus",  # the only Ogg encoder at hand; it serves Ogg and WebM
    "mp1": "mp2", "mp1float": "mp2", "mp2float": "mp2",
    "aac_latm": "aac", "aac_fixed": "aac", "ac3_fixed": "ac3",
}  # fmt: skip
"""Encoder of a codec where the names differ."""

_FALLBACK_BIT_RATE = 96_000
"""For one channel, where neither the programme nor the caller states a rate."""

_RATES = {
    "mp2": (32, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384),
    "ac3": (32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384, 448, 512, 576, 640),
    "eac3": (32, 48, 64, 96, 128, 160, 192, 224, 256, 320, 384, 448, 512, 640, 768, 1024),
}
"""Kilobits per second that coders know, or usual ones (ISO 11172-3, 2.4.2.3; ETSI TS 102 366)."""

_CODED_BITS = {"flac": 24, "alac": 24}
"""Bits of a 32 bit sample that the codec keeps."""


_LOSSLESS = {"flac", "alac", "wavpack", "tta", "ape", "truehd", "mlp"}
_COARSE = {"pcm_u8", "pcm_s8"}
"""Sounds with 256 even steps: rounding to them took away all superframes of a quiet talk."""

_WAV = "pcm_s16le pcm_s24le pcm_s32le pcm_f32le pcm_f64le pcm_alaw pcm_mulaw"

_HOLDS = {
    ".wav .w64 .rf64": (_WAV, "pcm_le"),
    ".aif .aiff .aifc": ("pcm_s16be pcm_s24be pcm_s32be", "pcm_be"),
    ".flac": ("flac", "flac"),
    ".mp3": ("libmp3lame", "libmp3lame"),
    ".mp2": ("mp2", "mp2"),
    ".ac3": ("ac3", "ac3"),
    ".aac": ("aac", "aac"),
    ".opus .webm": ("libopus", "libopus"),
    ".ogg .oga": ("libopus flac", "libopus"),
    ".m4a .mp4 .m4v": ("aac libmp3lame mp2 ac3 eac3 alac flac libopus", "aac"),
    ".ts .m2ts .mts": ("aac libmp3lame mp2 ac3 eac3 libopus", "aac"),
    ".mpg .mpeg .vob": ("mp2 libmp3lame ac3", "mp2"),
    ".mxf": ("pcm_s16le pcm_s24le", "pcm_s24le"),
}
"""For suffixes: the encoders whose sound they usually hold, and the one to take for others."""


@dataclass(frozen=True, slots=True)
class SoundTarget:
    """Sound parameters of an output: the encoder, and bits per second (0: it is lossless)."""

    encoder: str
    bit_rate: int


def usual_codec(sound: SoundFormat, suffix: str) -> str:
    """Return the codec for a sound in a file with this suffix: its own where that is usual there.

    Sound with 256 even steps gets 16 bits a sample.

    Examples
    --------
    >>> flac = SoundFormat("flac", 48000, 2, "stereo", "s16", 0)
    >>> usual_codec(flac, ".wav"), usual_codec(flac, ".mkv"), usual_codec(flac, ".ts")
    ('pcm_s16le', 'flac', 'aac')
    """
    if sound.codec in _COARSE:
        sound = replace(sound, codec="pcm_s16le")
    for suffixes, (held, usual) in _HOLDS.items():
        if suffix.lower() not in suffixes.split() or encoder_of(sound.codec) in held.split():
            continue
        if usual not in ("pcm_le", "pcm_be"):
            return usual
        end = usual[-2:]
        if end == "le" and sound.sample_format.startswith(("flt", "dbl")) and is_lossless(sound):
            return "pcm_f32le"
        return f"pcm_s{24 if sound.sample_format.startswith('s32') else 16}{end}"
    return sound.codec


def is_lossless(sound: SoundFormat) -> bool:
    """Whether a sound's codec keeps every sample."""
    return sound.codec.startswith("pcm_") or sound.codec in _LOSSLESS


def choose_target(
    sound: SoundFormat, *, codec: str | None = None, bit_rate: int | None = None
) -> SoundTarget:
    """Keep the codec and bit rate of `sound` by default.

    Raises
    ------
    CueError
        If the codec cannot be written.

    Examples
    --------
    >>> choose_target(SoundFormat("mp2float", 48000, 2, "stereo", "fltp", 192000))
    SoundTarget(encoder='mp2', bit_rate=192000)
    >>> choose_target(SoundFormat("flac", 48000, 2, "stereo", "s16", 700000))
    SoundTarget(encoder='flac', bit_rate=0)
    """
    wanted = codec or sound.codec
    name = encoder_of(wanted)
    try:
        encoder = av.Codec(name, "w")
    except (av.FFmpegError, ValueError) as error:
        raise CueError(
            f"sound codec {wanted!r} cannot be written: choose another with --audio-codec"
        ) from error
    if encoder.type != "audio" or encoder.experimental:
        raise CueError(f"sound codec {wanted!r} cannot be written: choose with --audio-codec")
    if encoder.lossless:
        return SoundTarget(name, 0)
    known = 0 if is_lossless(sound) else sound.bit_rate
    rate = bit_rate or known or _FALLBACK_BIT_RATE * sound.channels
    if name == "mp2" and not bit_rate:  # which refuses any other
        rate = usual_rate(name, rate)
    return SoundTarget(name, rate)


def usual_rate(encoder: str, bit_rate: int) -> int:
    """Return the bit rate nearest to another that an encoder knows.

    Examples
    --------
    >>> usual_rate("mp2", 191_998), usual_rate("aac", 69_000)
    (192000, 69000)
    """
    rates = _RATES.get(encoder)
    return min((1000 * k for k in rates), key=lambda r: abs(r - bit_rate)) if rates else bit_rate


def encoder_of(codec: str) -> str:
    """Return the name of the encoder for a codec, which is often its own."""
    return _ENCODERS.get(codec, codec)


class SoundEncoder:
    """Encoder of one sound stream.

    Parameters
    ----------
    container : av.container.OutputContainer
        Gets the stream.
    sound : SoundFormat
        Rate, channels and sample type of the programme.
    target : SoundTarget
        Encoder and bit rate.
    settings : dict, optional
        Options of the encoder.

    Attributes
    ----------
    clipped : int
        Samples that reached beyond full scale and were set to it.

    Raises
    ------
    CueError
        If the encoder or the container refuses these parameters.
    """

    def __init__(
        self,
        container: OutputContainer,
        sound: SoundFormat,
        target: SoundTarget,
        settings: dict[str, str] | None = None,
    ) -> None:
        try:
            self.stream: Any = container.add_stream(target.encoder, rate=sound.fs)
        except (av.FFmpegError, ValueError) as error:
            raise CueError(
                f"{container.format.name} cannot hold sound in {target.encoder!r}: {reason(error)}"
            ) from error
        context: Any = self.stream.codec_context
        accepted = [f.name for f in context.codec.audio_formats or []]
        self._format = _sample_format(accepted, sound.sample_format)
        width = 8 * av.AudioFormat(self._format).bytes
        self._bits = min(width, _CODED_BITS.get(target.encoder, width))
        if target.encoder.startswith("pcm_"):
            self._bits = int("".join(c for c in target.encoder if c.isdigit()) or width)
        context.layout = sound.layout
        context.format = self._format
        context.options = settings or {}
        if target.bit_rate:
            context.bit_rate = target.bit_rate
        self._sound = sound
        self._pts: int | None = None
        self.clipped = 0

    def open(self) -> None:
        """Open the encoder, which checks the parameters.

        Raises
        ------
        CueError
            If it does not.
        """
        sound = self._sound
        try:
            self.stream.codec_context.open(strict=False)
        except (av.FFmpegError, ValueError) as error:
            rate = self.stream.codec_context.bit_rate
            wanted = f" with {rate} bit/s" if rate else ""
            raise CueError(
                f"{self.stream.codec_context.name} cannot encode {sound.layout} sound at "
                f"{sound.fs} Hz{wanted}: choose another codec with --audio-codec ({reason(error)})"
            ) from error

    def process(self, block: NDArray[np.float32], start_s: float) -> Iterator[Any]:
        """Encode `block`, shape (n, channels); yield packets.

        The first block's first sample gets the time `start_s` of the container; what follows
        follows.
        """
        if not len(block):
            return
        fs = self._sound.fs
        if self._pts is None:
            self._pts = round(start_s * fs)
        self.clipped += int(np.count_nonzero(np.abs(block) > 1.0))
        packed = as_samples(block, self._format, self._bits)
        frame = av.AudioFrame.from_ndarray(packed, format=self._format, layout=self._sound.layout)
        frame.sample_rate = fs
        frame.time_base = Fraction(1, fs)
        frame.pts = self._pts
        self._pts += len(block)
        yield from self.stream.encode(frame)

    def flush(self) -> Iterator[Any]:
        """Yield the packets that were still in the encoder."""
        if self._pts is not None:
            yield from self.stream.encode(None)


def _sample_format(accepted: list[str], wanted: str) -> str:
    """Choose the encoder's sample type that loses least of `wanted`."""
    plain, planar = wanted.removesuffix("p"), f"{wanted.removesuffix('p')}p"
    for name in (plain, planar, "flt", "fltp", "s32", "s32p", "s16", "s16p"):
        if name in accepted or not accepted:
            return name
    return accepted[0]


def as_samples(block: NDArray[np.float32], sample_format: str, bits: int) -> NDArray[Any]:
    """Return `block` in FFmpeg's type `sample_format`, rounded to `bits`, no dither.

    Values beyond full scale are set to full scale.

    Parameters
    ----------
    block : ndarray of float32, shape (n, channels)
        Full scale is 1.
    sample_format : str
        ``u8``, ``s16``, ``s32``, ``flt``, ``dbl``, or one of these with ``p`` for planar.
    bits : int
        Bits that count, the upper ones of an integer type.

    Returns
    -------
    ndarray, shape (channels, n) if planar, else (1, n * channels)

    Examples
    --------
    >>> as_samples(np.array([[0.5], [-1.5]], np.float32), "s16", 16).tolist()
    [[16384, -32768]]
    """
    kind = sample_format.removesuffix("p")
    if kind in ("flt", "dbl"):
        x: NDArray[Any] = block.astype(np.float32 if kind == "flt" else np.float64)
    else:
        half = 1 << (bits - 1)
        x = np.clip(np.rint(block.astype(np.float64) * half), -half, half - 1).astype(np.int64)
        if kind == "u8":
            x = (x + 128).astype(np.uint8)
        else:
            width = int(kind[1:])
            x = (x << (width - bits)).astype(np.int16 if width == 16 else np.int32)
    if sample_format.endswith("p"):
        return np.ascontiguousarray(x.T)
    return np.ascontiguousarray(x).reshape(1, -1)
