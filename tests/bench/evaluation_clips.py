"""Write twelve clips for measuring the sound carrier: four to choose by, eight for final figures.

In: the shared recordings; out: FLAC files of 24 s, 48 kHz, -23 LUFS, in the folders ``choose`` and
``final``. Nothing may be tuned on those of ``final``: other speakers, voices over music, and music
that is made here by arithmetic. None of them may be shipped (licences of the recordings).
Run: ``python -m tests.bench.evaluation_clips FOLDER``.
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.signal
import soundfile
from numpy.typing import NDArray

from receiver.media.sound import read_sound
from watermark.quality.loudness import loudness_lufs

FS, LENGTH_S = 48_000, 24.0
COUNT = round(LENGTH_S * FS)
SHARED = Path(__file__).parents[3] / "shared" / "data"
TO_CHOOSE_BY = ("pop_vocal", "film_mix", "speech_fr_f_lv", "classical_strings")

Signal = NDArray[np.float64]


def main() -> None:
    """Write the clips."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    chosen = {name: _recorded(SHARED / "audio" / f"{name}.flac") for name in TO_CHOOSE_BY}
    for kind, clips in (("choose", chosen), ("final", {k: make() for k, make in FINAL.items()})):
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for name, sound in clips.items():
            level = 10 ** ((-23.0 - loudness_lufs(sound.astype(np.float32), FS)) / 20)
            path = folder / kind / f"{name}.flac"
            soundfile.write(path, np.clip(level * sound, -1.0, 32767 / 32768), FS)
            print(path)


def _recorded(path: Path, start_s: float = 0.0) -> Signal:
    """`LENGTH_S` of a recording at `FS`, shape (n, channels)."""
    sound, fs = read_sound(path)
    divisor = math.gcd(fs, FS)
    sound = sound[round(start_s * fs) : round((start_s + LENGTH_S + 1) * fs)]
    return np.asarray(
        scipy.signal.resample_poly(sound.astype(np.float64), FS // divisor, fs // divisor)[:COUNT]
    )


def _sentences(folder: str, first: int) -> Signal:
    """Join recordings of a folder until there is enough, shape (n, 1)."""
    paths = sorted(p for p in (SHARED / "speech" / folder).rglob("*") if p.suffix in _RECORDINGS)
    parts: list[Signal] = []
    while sum(map(len, parts)) < COUNT:
        sound = _recorded(paths[first % len(paths)]).mean(axis=1, keepdims=True)
        parts += [sound / max(float(sound.std()), 1e-6), np.zeros((FS // 3, 1))]
        first += 1
    return np.concatenate(parts)[:COUNT]


_RECORDINGS = {".ogg", ".wav", ".mp3", ".flac"}


def _over(voice: Signal, bed: Signal, bed_db: float) -> Signal:
    """A voice in the middle over a stereo bed that is `bed_db` against it."""
    power = float(np.mean(voice**2)) / float(np.mean(bed**2))
    return np.asarray(voice + bed * np.sqrt(power) * 10 ** (bed_db / 20))


def _note(midi: float, length_s: float, rng: np.random.Generator, *, bright: float) -> Signal:
    """A plucked or struck note: harmonics that decay faster the higher they are, shape (n,)."""
    t = np.arange(round(length_s * FS)) / FS
    f0 = 440 * 2 ** ((midi - 69 + rng.normal(0, 0.03)) / 12)
    k = np.arange(1, max(2, min(40, int(14_000 / f0))))[:, np.newaxis]
    decay = np.exp(-t * (1.5 + 0.6 * k) / length_s) * np.minimum(t / 0.004, 1)
    phases = rng.uniform(0, 2 * np.pi, k.shape)
    return np.asarray((decay * np.sin(2 * np.pi * f0 * k * t + phases) * k**-bright).sum(axis=0))


def _hall(x: Signal, decay_s: float, rng: np.random.Generator, wet: float) -> Signal:
    """Add a diffuse stereo tail."""
    t = np.arange(round(decay_s * FS)) / FS
    tail = rng.normal(size=(t.size, 2)) * 10 ** (-3 * t / decay_s)[:, np.newaxis]
    tail /= np.sqrt((tail**2).sum(axis=0))
    return np.asarray(x + wet * scipy.signal.fftconvolve(x, tail, axes=0)[: len(x)])


def _waltz() -> Signal:
    """Three beats a bar, plucked chords, a melody, a hall."""
    rng, out = np.random.default_rng(31), np.zeros((COUNT, 2))
    chords = ((45, 52, 57, 60), (50, 53, 57, 62), (52, 56, 59, 62), (45, 52, 57, 64))
    beat_s = 0.34
    for beat in range(int((LENGTH_S - 1) / beat_s)):
        chord = chords[beat // 6 % 4]
        played = [(chord[0], 0.8)] if beat % 3 == 0 else [(note, 0.4) for note in chord[1:]]
        if beat % 2:
            played.append((int(rng.choice(chord)) + 12 * int(rng.integers(1, 3)), 0.9))
        for note, strength in played:
            sound, seat = _note(note, 0.9, rng, bright=0.9), rng.uniform(0.15, 0.85)
            start = round((beat * beat_s + rng.normal(0, 0.006) + 0.05) * FS)
            part = out[start : start + sound.size]
            part += strength * sound[: len(part), np.newaxis] * (1 - seat, seat)
    return _hall(out, 1.4, rng, 0.5)


def _dance() -> Signal:
    """Four to the floor: bass drum, hats, saw chords through a moving filter, hard limited."""
    rng, out = np.random.default_rng(32), np.zeros((COUNT, 2))
    t, beat = np.arange(COUNT) / FS, round(FS * 60 / 126)
    for start in range(0, COUNT - beat, beat):
        s = np.arange(beat) / FS
        out[start : start + beat] += (
            np.sin(2 * np.pi * (45 * s + 9 * (1 - np.exp(-30 * s)))) * np.exp(-7 * s)
        )[:, np.newaxis]
        hat = rng.normal(0, 0.25, (beat // 2, 2)) * np.exp(-40 * s[: beat // 2])[:, np.newaxis]
        out[start + beat // 2 : start + beat // 2 * 2] += np.diff(hat, axis=0, prepend=0)
    for side, detune in enumerate((0.997, 1.003)):
        for note in (45, 57, 60, 64):
            frequency = 440 * 2 ** ((note - 69) / 12) * detune
            saw = scipy.signal.sawtooth(2 * np.pi * frequency * t)
            soft = scipy.signal.sosfilt(scipy.signal.butter(2, 1500, fs=FS, output="sos"), saw)
            mix = 0.5 + 0.5 * np.sin(2 * np.pi * t / 7.6)
            out[:, side] += 0.12 * (mix * saw + (1 - mix) * soft)
    return np.tanh(2.0 * out)


def _crowd() -> Signal:
    """A stadium: noise of many throats that swells, and claps."""
    rng = np.random.default_rng(33)
    filters = scipy.signal.butter(2, (300, 3500), "band", fs=FS, output="sos")
    out = scipy.signal.sosfilt(filters, rng.normal(size=(COUNT, 2)), axis=0)
    swell = np.interp(np.arange(COUNT), np.linspace(0, COUNT, 14), rng.uniform(0.3, 1.0, 14))
    for start in rng.integers(0, COUNT - 800, 1500):
        clap = rng.normal(size=800) * np.exp(-np.arange(800) / 120)
        seat = rng.uniform()
        out[start : start + 800] += 0.6 * clap[:, np.newaxis] * (1 - seat, seat)
    return np.asarray(out * swell[:, np.newaxis])


FINAL: dict[str, Callable[[], Signal]] = {
    "margot": lambda: _recorded(SHARED / "speech" / "librivox_margot" / "045.mp3", 20.0),
    "gcompris": lambda: _sentences("gcompris_fr/fr/intro", 40),
    "speakers": lambda: _sentences("sppas_fr", 0),
    "documentary": lambda: _over(
        _sentences("gcompris_fr/fr/intro", 70),
        _recorded(SHARED / "audio" / "classical_strings.flac", 15.0),
        -10.0,
    ),
    "radio": lambda: _over(
        _recorded(SHARED / "speech" / "librivox_margot" / "097.mp3", 25.0),
        _recorded(SHARED / "audio" / "pop_vocal.flac", 15.0),
        -6.0,
    ),
    "waltz": _waltz,
    "dance": _dance,
    "sport": lambda: _over(_sentences("sppas_fr", 5), _crowd(), -8.0),
}
"""Clips that served no choice, by name."""


if __name__ == "__main__":
    main()
