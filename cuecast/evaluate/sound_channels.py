"""Channels between the studio and the ear, by name: codecs and injuries.

In: a programme, shape (n, channels); out: the sound at a receiver, of any length. Codecs are those
of the FFmpeg inside PyAV; each channel is a pure function of its input, and shares nothing with the
receiver that is measured.
"""

import io
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import av
import numpy as np
import scipy.signal
import soundfile
from numpy.typing import NDArray

from cuecast.evaluate import sound_clocks as clocks
from cuecast.evaluate import sound_filters as filters
from cuecast.evaluate import sound_injuries as injuries
from cuecast.evaluate.sound_filters import filtered
from watermark.link.superframe import find_named

Sound = NDArray[np.float32]
Channel = Callable[[Sound, int], Sound]
"""Takes a programme and its rate in Hz."""

_CONTAINERS = {
    "aac": ("aac", "adts"),
    "mp2": ("mp2", "mp2"),
    "mp3": ("libmp3lame", "mp3"),
    "ac3": ("ac3", "ac3"),
    "eac3": ("eac3", "eac3"),
    "opus": ("libopus", "ogg"),
}
"""Encoder and container of each codec."""


def through_codec(x: Sound, fs: int, *, codec: str, bit_rate: int) -> Sound:
    """Code and decode a programme as stereo.

    Parameters
    ----------
    x : ndarray of float32, shape (n, channels)
        Mono is sent on both channels, as broadcasters do.
    fs : int
        Rate in Hz.
    codec : str
        One of aac, mp2, mp3, ac3, eac3, opus.
    bit_rate : int
        Bits per second.

    Returns
    -------
    ndarray of float32, shape (m, 2)
        With the codec's delay and padding.
    """
    return _decode(encode(x, fs, codec=codec, bit_rate=bit_rate), fs)


def encode(x: Sound, fs: int, *, codec: str, bit_rate: int) -> io.BytesIO:
    """Code a programme as stereo into its usual container, see `through_codec`."""
    encoder, container = _CONTAINERS[codec]
    memory = io.BytesIO()
    output: Any
    with av.open(memory, "w", format=container) as output:
        stream: Any = output.add_stream(encoder, rate=fs)
        stream.bit_rate = bit_rate
        stream.layout = "stereo"
        pair = np.repeat(x, 2, axis=1) if x.shape[1] == 1 else x[:, :2]
        words = np.round(np.clip(pair, -1.0, 32767 / 32768) * 32768).astype(np.int16)
        frame = av.AudioFrame.from_ndarray(words.reshape(1, -1), format="s16", layout="stereo")
        frame.sample_rate = fs
        for packet in (*stream.encode(frame), *stream.encode(None)):
            output.mux(packet)
    memory.seek(0)
    return memory


def _decode(memory: io.BytesIO, fs: int) -> Sound:
    resampler = av.AudioResampler("fltp", "stereo", fs)
    parts: list[NDArray[Any]] = []
    source: Any
    with av.open(memory) as source:
        for frame in source.decode(audio=0):
            parts += [part.to_ndarray() for part in resampler.resample(frame)]
    return np.ascontiguousarray(np.concatenate(parts, axis=1).T, dtype=np.float32)


def _vorbis(x: Sound, fs: int, *, quality: float) -> Sound:
    """Code as Vorbis by libsndfile: `quality` is a tenth of the coder's own number."""
    memory = io.BytesIO()
    soundfile.write(
        memory, x[:, :2], fs, format="OGG", subtype="VORBIS", compression_level=1 - quality
    )
    memory.seek(0)
    return np.asarray(soundfile.read(memory, dtype="float32", always_2d=True)[0])


def _in_a_row(x: Sound, fs: int, *, coders: Sequence[tuple[str, int]]) -> Sound:
    """Code and decode again and again."""
    for codec, bit_rate in coders:
        x = through_codec(x, fs, codec=codec, bit_rate=bit_rate)
    return x


def _other_rate(x: Sound, fs: int) -> Sound:
    """Go to 44.1 kHz (from there, to 48 kHz) and back."""
    up, down = (147, 160) if fs != 44_100 else (160, 147)
    there = scipy.signal.resample_poly(x, up, down, axis=0)
    return np.asarray(scipy.signal.resample_poly(there, down, up, axis=0), dtype=np.float32)


def _gain(x: Sound, fs: int, *, gain_db: float) -> Sound:
    """Louder or softer, clipped at full scale."""
    return np.asarray(np.clip(x * np.float32(10 ** (gain_db / 20)), -1.0, 1.0))


def _invert(x: Sound, fs: int) -> Sound:
    return -x


def _room(x: Sound, fs: int) -> Sound:
    """Play in a simulated room before one microphone.

    0.4 s of decaying noise, the direct sound 3 dB above it, and noise 30 dB below the programme.
    """
    rng = np.random.default_rng(1)
    tail = rng.normal(size=round(0.4 * fs)) * 10 ** (-3 * np.arange(round(0.4 * fs)) / (0.4 * fs))
    tail[: round(0.004 * fs)] = 0.0
    response = tail * 10 ** (-3 / 20) / np.sqrt((tail**2).sum())
    response[0] = 1.0
    mono = x.astype(np.float64).mean(axis=1)
    heard = scipy.signal.fftconvolve(mono, response)[: len(x)]
    return _noise((heard / 2)[:, np.newaxis].astype(np.float32), fs)


def _noise(x: Sound, fs: int) -> Sound:
    """White noise 30 dB below the programme."""
    deviation = np.sqrt(np.mean(x.astype(np.float64) ** 2)) * 10 ** (-30 / 20)
    noise = np.random.default_rng(0).normal(0.0, deviation, x.shape)
    return (x + noise).astype(np.float32)


CUT_S = 1.2345
"""What ``crop`` takes from the start."""


def _crop(x: Sound, fs: int) -> Sound:
    return x[round(CUT_S * fs) :]


def _compress(x: Sound, fs: int) -> Sound:
    """Dynamic range compression 2:1 above -26 dBFS, 10 ms attack and 150 ms release, as by ear."""
    level = np.abs(x.astype(np.float64)).max(axis=1)
    block = fs // 1000
    peaks = level[: len(level) // block * block].reshape(-1, block).max(axis=1)
    smooth, envelope = 0.0, np.empty(peaks.size)
    for i, peak in enumerate(peaks):
        smooth += (peak - smooth) / (10 if peak > smooth else 150)
        envelope[i] = smooth
    over_db = np.maximum(20 * np.log10(np.maximum(envelope, 1e-6)) + 26.0, 0.0)
    time = (np.arange(peaks.size) + 0.5) * block
    gain_db = np.interp(np.arange(len(x)), time, -over_db / 2)
    return (x * 10 ** (gain_db / 20)[:, np.newaxis]).astype(np.float32)


def _unchanged(x: Sound, fs: int) -> Sound:
    return x


SPEEDS = {
    "25_24": 25 / 24,
    "24_25": 24 / 25,
    "plus_2000ppm": 1.002,
    "minus_2000ppm": 0.998,
    "plus_4pct": 1.04,
    "plus_6pct": 1.06,
    "minus_6pct": 0.94,
}
"""Speeds by the names that channels have."""

CHANNELS: dict[str, Channel] = {
    "none": _unchanged,
    **{
        f"{codec}_{rate}": partial(through_codec, codec=codec, bit_rate=rate * 1000)
        for codec, rate in (
            ("mp2", 192),
            ("mp2", 128),
            ("mp3", 128),
            ("mp3", 64),
            ("aac", 128),
            ("aac", 96),
            ("aac", 64),
            ("ac3", 192),
            ("eac3", 128),
            ("opus", 96),
            ("opus", 64),
        )
    },
    "vorbis_q2": partial(_vorbis, quality=0.2),
    "he_aac_64": partial(injuries.he_aac, bit_rate=64_000),
    "tandem_mp2_192_aac_128": partial(_in_a_row, coders=(("mp2", 192_000), ("aac", 128_000))),
    "tandem_aac_mp3_aac_128": partial(
        _in_a_row, coders=(("aac", 128_000), ("mp3", 128_000), ("aac", 128_000))
    ),
    "rate_44100": _other_rate,
    **{
        f"gain_{name}db": partial(_gain, gain_db=gain_db)
        for name, gain_db in (
            ("minus_6", -6.0),
            ("minus_10", -10.0),
            ("minus_20", -20.0),
            ("plus_10", 10.0),
        )
    },
    "gain_plus_20db": partial(injuries.louder, gain_db=20.0),
    "inverted": _invert,
    "rotator": injuries.rotator,
    "crossover": injuries.crossover,
    "right_inverted": injuries.right_inverted,
    "right_late": partial(injuries.right_late, late_s=0.0002),
    "right_late_3ms": partial(injuries.right_late, late_s=0.003),
    "left_alone": partial(injuries.one_channel, channel=0),
    "right_alone": partial(injuries.one_channel, channel=1),
    "side_alone": injuries.side_alone,
    "two_languages": injuries.two_languages,
    "announcer": injuries.announcer,
    "other_voice": injuries.other_voice,
    "widened_20ms": partial(filtered, filters=filters.WIDER, stereo=True),
    "dialogue_enhanced": partial(filtered, filters=filters.DIALOGUE, stereo=True),
    "compress": _compress,
    "multiband": injuries.multiband,
    "night_mode": partial(filtered, filters=filters.NIGHT_MODE),
    "radio_multiband": partial(filtered, filters=filters.RADIO),
    "denoiser_20db": partial(filtered, filters=filters.DENOISER),
    **{
        f"clock_{name}ppm": partial(clocks.at_other_speed, ppm=ppm)
        for name, ppm in (
            ("plus_100", 100.0),
            ("minus_100", -100.0),
            ("plus_200", 200.0),
            ("minus_200", -200.0),
        )
    },
    "stretch_1000ppm": partial(clocks.at_other_speed, ppm=1000.0),
    "drift": clocks.drifting,
    **{
        f"speed_{name}": partial(clocks.at_other_speed, ppm=1e6 * (speed - 1))
        for name, speed in SPEEDS.items()
    },
    **{
        f"{way}_{name}": partial(change, tempo=SPEEDS[name])
        for way, change in (
            ("tempo", clocks.at_tempo),
            ("rubberband", clocks.by_rubberband),
            ("vocoder", clocks.by_vocoder),
        )
        for name in ("25_24", "24_25")
    },
    "room": _room,
    "noise_30db": _noise,
    "crop": _crop,
}
"""Channels by name."""


def find_channel(name: str) -> Channel:
    """Return the channel called `name`.

    Raises
    ------
    CueError
        If there is none.
    """
    return find_named(CHANNELS, name, "channel")
