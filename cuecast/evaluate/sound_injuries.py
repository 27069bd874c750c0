"""Injuries that studios, transmitters and receivers do to sound, by plain arithmetic.

In: a programme, shape (n, channels), and its rate; out: the sound at a receiver. Phases (an
all-pass rotator, crossovers, a multiband compressor), channels out of step or missing, gain, other
voices; and HE-AAC, whose encoder is a program of its own.
"""

import math
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import av
import numpy as np
import scipy.signal
import soundfile
from numpy.typing import NDArray

from codec.errors import CueError

Sound = NDArray[np.float32]

ROTATOR_HZ = 200.0
"""Frequency of both second-order all-passes of a phase rotator, as in radio stations."""

CROSSOVER_HZ, BANDS_HZ = 1500.0, (200.0, 1500.0, 6000.0)
"""Crossovers of fourth order (Linkwitz and Riley): one alone, those of a multiband compressor."""

THRESHOLD_DB, RATIO, ATTACK_MS, RELEASE_MS = -40.0, 2.0, 5.0, 100.0
"""Compression of each band."""

ANNOUNCER_DB = -6.0
"""Level of another voice against the programme."""

ANNOUNCEMENT = (
    "Mesdames et messieurs, votre attention s'il vous plaît.",
    "La suite de notre programme sera diffusée dans quelques instants.",
    "Nous vous rappelons que la soirée continue sur cette chaîne.",
)
"""Words of an announcer, repeated without a pause."""


def rotator(x: Sound, fs: int) -> Sound:
    """Two second-order all-passes, as in the audio equaliser cookbook of R. Bristow-Johnson."""
    w = 2 * np.pi * ROTATOR_HZ / fs
    a, c = np.sin(w) / np.sqrt(2), np.cos(w)
    b = np.array([1 - a, -2 * c, 1 + a])
    for _ in range(2):
        x = np.asarray(scipy.signal.lfilter(b, b[::-1], x, axis=0), dtype=np.float32)
    return x


def crossover(x: Sound, fs: int) -> Sound:
    """Split in two and add up again: an all-pass as a whole."""
    low, high = _split(x.astype(np.float64), CROSSOVER_HZ, fs)
    return (low + high).astype(np.float32)


def multiband(x: Sound, fs: int) -> Sound:
    """Split in four, compress each band, add up."""
    rest, out = x.astype(np.float64), np.zeros(x.shape)
    for frequency_hz in BANDS_HZ:
        low, rest = _split(rest, frequency_hz, fs)
        out += _compressed(low, fs)
    return (out + _compressed(rest, fs)).astype(np.float32)


def louder(x: Sound, fs: int, *, gain_db: float) -> Sound:
    """Multiply, beyond full scale if need be."""
    return np.asarray(x * np.float32(10 ** (gain_db / 20)))


def right_inverted(x: Sound, fs: int) -> Sound:
    """One channel with its poles exchanged."""
    return np.asarray(_pair(x) * np.array([1, -1], dtype=np.float32))


def right_late(x: Sound, fs: int, *, late_s: float) -> Sound:
    """One channel late by a time that need not be whole samples."""
    pair = _pair(x).copy()
    spectrum = np.fft.rfft(pair[:, 1])
    turn = np.exp(-2j * np.pi * np.arange(spectrum.size) * late_s * fs / len(pair))
    pair[:, 1] = np.fft.irfft(spectrum * turn, len(pair))
    return pair


def one_channel(x: Sound, fs: int, *, channel: int) -> Sound:
    """Keep the left (0) or the right channel (1), as mono."""
    return _pair(x)[:, channel : channel + 1].copy()


def side_alone(x: Sound, fs: int) -> Sound:
    """Keep half the difference of left and right, as mono: silence of a mono programme."""
    pair = _pair(x)
    return np.asarray((pair[:, :1] - pair[:, 1:]) / 2)


def two_languages(x: Sound, fs: int) -> Sound:
    """Put the programme as mono in the left channel, an unmarked voice in the right one."""
    mono = x[:, :2].mean(axis=1)
    return np.stack([mono, _announcer(mono, fs)], axis=1).astype(np.float32)


def announcer(x: Sound, fs: int) -> Sound:
    """Add an unmarked voice over the programme, `ANNOUNCER_DB` against it."""
    voice = _announcer(x[:, :2].mean(axis=1), fs)[:, np.newaxis]
    return np.asarray(x + np.float32(10 ** (ANNOUNCER_DB / 20)) * voice, dtype=np.float32)


def other_voice(x: Sound, fs: int) -> Sound:
    """Add the programme's own sound, backwards, `ANNOUNCER_DB` against it."""
    voice = x.mean(axis=1, keepdims=True)[::-1]
    return np.asarray(x + np.float32(10 ** (ANNOUNCER_DB / 20)) * voice, dtype=np.float32)


def _announcer(mono: NDArray[np.float32], fs: int) -> NDArray[np.float64]:
    """Speak as long and as strong as the programme."""
    from synth.units.speech.espeak_voice import speak

    spoken = []
    for line in ANNOUNCEMENT:
        voice, rate = speak(line)
        divisor = math.gcd(fs, rate)
        spoken.append(scipy.signal.resample_poly(voice, fs // divisor, rate // divisor))
    sound = np.resize(np.concatenate(spoken).astype(np.float64), len(mono))
    power = float(np.mean(mono.astype(np.float64) ** 2))
    return np.asarray(sound * np.sqrt(power / np.mean(sound**2)))


def he_aac(x: Sound, fs: int, *, bit_rate: int) -> Sound:
    """Code as HE-AAC (version 1) by ``fdkaac``, decode by FFmpeg.

    Raises
    ------
    CueError
        If that program is not installed, or fails.
    """
    program = shutil.which("fdkaac")
    if program is None:
        raise CueError("HE-AAC needs the program fdkaac (Debian: contrib), which was not found")
    with tempfile.TemporaryDirectory() as folder:
        there, back = Path(folder, "sound.wav"), Path(folder, "sound.m4a")
        soundfile.write(there, np.clip(_pair(x), -1.0, 32767 / 32768), fs, subtype="PCM_16")
        command = [program, "-p", "5", "-b", str(bit_rate), "-o", str(back), str(there)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise CueError(f"fdkaac: {done.stderr.strip().splitlines()[-1:] or done.returncode}")
        resampler = av.AudioResampler("fltp", "stereo", fs)
        parts: list[NDArray[Any]] = []
        source: Any
        with av.open(str(back)) as source:
            for frame in source.decode(audio=0):
                parts += [part.to_ndarray() for part in resampler.resample(frame)]
    return np.ascontiguousarray(np.concatenate(parts, axis=1).T, dtype=np.float32)


def _pair(x: Sound) -> Sound:
    return np.repeat(x, 2, axis=1) if x.shape[1] == 1 else x[:, :2]


def _split(
    x: NDArray[np.float64], frequency_hz: float, fs: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Low and high part, each by two Butterworth filters of second order in a row."""
    parts = []
    for kind in ("lowpass", "highpass"):
        filters = scipy.signal.butter(2, frequency_hz, kind, fs=fs, output="sos")
        once = scipy.signal.sosfilt(filters, x, axis=0)
        parts.append(np.asarray(scipy.signal.sosfilt(filters, once, axis=0)))
    return parts[0], parts[1]


def _compressed(x: NDArray[np.float64], fs: int) -> NDArray[np.float64]:
    """Compress by the peaks of all channels together, in blocks of a millisecond."""
    block = fs // 1000
    level = np.abs(x).max(axis=1)
    peaks = level[: len(level) // block * block].reshape(-1, block).max(axis=1)
    smooth, envelope = 0.0, np.empty(peaks.size)
    for i, peak in enumerate(peaks):
        smooth += (peak - smooth) / (ATTACK_MS if peak > smooth else RELEASE_MS)
        envelope[i] = smooth
    over_db = np.maximum(20 * np.log10(np.maximum(envelope, 1e-6)) - THRESHOLD_DB, 0.0)
    time = (np.arange(peaks.size) + 0.5) * block
    gain_db = np.interp(np.arange(len(x)), time, -over_db * (1 - 1 / RATIO))
    return np.asarray(x * 10 ** (gain_db / 20)[:, np.newaxis])
