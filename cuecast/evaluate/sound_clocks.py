"""Injuries of time: other speeds, a clock that drifts, other durations at the same pitch.

In: a programme, shape (n, channels), and its rate; out: the sound on its new clock. Samples between
samples are found by oversampling and splines; durations change by FFmpeg's atempo, by the program
``rubberband``, or by a plain phase vocoder.
Source: Flanagan and Golden, "Phase vocoder", Bell System Technical Journal 45, 1966.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import scipy.ndimage
import scipy.signal
import soundfile
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.evaluate.sound_filters import filtered

Sound = NDArray[np.float32]

OVERSAMPLING, SPLINE = 2, 5
"""Factor of oversampling, and order of the spline between those samples."""

DRIFT, DRIFT_S = 0.003, 12.0
"""Largest deviation of a tape's speed, and the period of its sine."""

FRAME, HOP = 2048, 512
"""Samples of the vocoder's frames, and from one output frame to the next."""


def at_other_speed(x: Sound, fs: int, *, ppm: float) -> Sound:
    """Play on a clock that runs `ppm` fast: the programme becomes shorter."""
    ratio = 1 + ppm * 1e-6
    return _read_at(x, ratio * np.arange(int(len(x) / ratio), dtype=np.float64))


def drifting(x: Sound, fs: int) -> Sound:
    """Play from a tape whose speed swings by `DRIFT`."""
    count, swing = int(len(x) / (1 + DRIFT)), DRIFT * DRIFT_S * fs / (2 * np.pi)
    places = np.arange(count, dtype=np.float64)
    places += swing * np.sin(2 * np.pi * places / (DRIFT_S * fs))
    return _read_at(x, places)


def at_tempo(x: Sound, fs: int, *, tempo: float) -> Sound:
    """Play faster or slower at the same pitch: FFmpeg's atempo, which overlaps alike pieces."""
    return filtered(x, fs, filters=(("atempo", f"{tempo:.9f}"),))


def by_rubberband(x: Sound, fs: int, *, tempo: float) -> Sound:
    """Play faster or slower at the same pitch by the program ``rubberband``.

    Raises
    ------
    CueError
        If that program is not installed, or fails.
    """
    program = shutil.which("rubberband")
    if program is None:
        raise CueError("this channel needs the program rubberband (Debian: rubberband-cli)")
    with tempfile.TemporaryDirectory() as folder:
        there, back = Path(folder, "sound.wav"), Path(folder, "changed.wav")
        soundfile.write(there, x, fs, subtype="FLOAT")
        command = [program, "--quiet", "--tempo", f"{tempo:.9f}", str(there), str(back)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise CueError(f"rubberband: {done.stderr.strip().splitlines()[-1:]}")
        sound, _ = soundfile.read(back, dtype="float32", always_2d=True)
    return np.asarray(sound, dtype=np.float32)


def by_vocoder(x: Sound, fs: int, *, tempo: float) -> Sound:
    """Play faster or slower at the same pitch by a phase vocoder, each channel by itself."""
    return np.stack([_vocoder(x[:, i], tempo) for i in range(x.shape[1])], axis=1)


def _vocoder(x: NDArray[np.float32], tempo: float) -> NDArray[np.float32]:
    """Stretch one channel: frames that are `HOP` apart turn as far as those at the input do."""
    window = np.hanning(FRAME + 1)[:-1]
    count = int((len(x) - FRAME - HOP) / (tempo * HOP))
    phase, out = np.zeros(FRAME // 2 + 1), np.zeros(count * HOP + FRAME)
    for i in range(count):
        first = int(i * tempo * HOP)
        here, later = (np.fft.rfft(window * x[at : at + FRAME]) for at in (first, first + HOP))
        if i == 0:
            phase = np.angle(here)
        out[i * HOP : i * HOP + FRAME] += window * np.fft.irfft(np.abs(here) * np.exp(1j * phase))
        phase += np.angle(later * here.conj())
    return (out / 1.5).astype(np.float32)


def _read_at(x: Sound, places: NDArray[np.float64]) -> Sound:
    """Read samples at any places, in samples of `x`."""
    out = np.empty((len(places), x.shape[1]), dtype=np.float32)
    for channel in range(x.shape[1]):
        fine = scipy.signal.resample_poly(x[:, channel].astype(np.float64), OVERSAMPLING, 1)
        at = [OVERSAMPLING * places]
        out[:, channel] = scipy.ndimage.map_coordinates(fine, at, order=SPLINE, mode="nearest")
    return out
