"""The built-in programme: a short French announcement, its music, its picture.

Everything is made by arithmetic and by espeak-ng, so the demonstration needs no files.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, resample_poly

from synth.speech.espeak_voice import speak
from synth.subtitles import Subtitle

FS = 48_000
WIDTH, HEIGHT, PICTURE_RATE = 640, 360, 25

LINES = (
    "Bonsoir, et bienvenue sur notre chaîne.",
    "Une interprète virtuelle accompagne ce programme.",
    "Elle code chaque syllabe avec sa main droite, près du visage.",
    "Ses gestes voyagent dans le son, et personne ne les entend.",
    "Le téléviseur les retrouve, puis il dessine notre amie à l'écran.",
    "Merci de votre confiance, et bonne soirée à tous.",
)
"""What is said."""

_FIRST_LINE_S = 2.5
_PAUSE_S = 0.9
_AFTERMATH_S = 2.5
_SPEECH_RMS = 0.09
_MUSIC_RMS = 0.03

_CHORDS = ((57, 60, 64, 69), (53, 57, 60, 65), (48, 55, 60, 64), (55, 59, 62, 67))
"""A minor, F, C, G as MIDI note numbers."""
_CHORD_S = 2.0


def make_sound() -> tuple[NDArray[np.float32], list[Subtitle]]:
    """Return the sound, shape (n, 2) at `FS`, and the subtitles of what is said in it."""
    subtitles: list[Subtitle] = []
    spoken: list[tuple[int, NDArray[np.float64]]] = []
    time_s = _FIRST_LINE_S
    for line in LINES:
        voice, fs = speak(line)
        x = resample_poly(voice.astype(np.float64), FS, fs)
        x *= _SPEECH_RMS / np.sqrt(np.mean(x**2))
        spoken.append((round(time_s * FS), x))
        end_s = time_s + len(x) / FS
        subtitles.append(Subtitle(round(time_s, 3), round(end_s, 3), line))
        time_s = end_s + _PAUSE_S
    sound = _music(time_s + _AFTERMATH_S)
    for start, x in spoken:
        sound[start : start + len(x)] += x[:, None]
    return np.clip(sound, -0.99, 0.99).astype(np.float32), subtitles


def _music(seconds: float) -> NDArray[np.float64]:
    """Plucked chords over a soft cymbal, shape (n, 2)."""
    rng = np.random.default_rng(2004)
    n = round(seconds * FS)
    sound = np.zeros((n, 2))
    beat = round(_CHORD_S / 8 * FS)
    for number, start in enumerate(range(0, n, beat)):
        chord = _CHORDS[number // 8 % len(_CHORDS)]
        note = chord[number % 4] + (12 if number % 8 >= 4 else 0)
        tone = _plucked(440 * 2 ** ((note - 69) / 12), rng)[: n - start]
        pan = 0.3 + 0.4 * (number % 4) / 3
        sound[start : start + len(tone)] += tone[:, None] * (1 - pan, pan)
        hiss = (
            rng.standard_normal((min(beat, n - start), 2))
            * np.exp(-np.arange(min(beat, n - start)) / (0.06 * FS))[:, None]
        )
        sound[start : start + len(hiss)] += 0.08 * hiss
    level: NDArray[np.float64] = sound * (_MUSIC_RMS / np.sqrt(np.mean(sound**2)))
    return level


def _plucked(frequency_hz: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a plucked string after Karplus and Strong 1983: noise in a loop with a lowpass."""
    period = round(FS / frequency_hz)
    excitation = np.zeros(2 * FS)
    excitation[:period] = rng.uniform(-1, 1, period)
    loop = np.zeros(period + 2)
    loop[0], loop[period], loop[period + 1] = 1.0, -0.498, -0.498
    return np.asarray(lfilter([1.0], loop, excitation), dtype=np.float64)


def make_pictures(seconds: float) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures, (HEIGHT, WIDTH, 3) red, green, blue: a sunset over moving water."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    horizon = 0.62 * HEIGHT
    for number in range(round(seconds * PICTURE_RATE)):
        t = number / PICTURE_RATE
        sun_x, sun_y = WIDTH * (0.25 + 0.01 * t), HEIGHT * (0.30 + 0.006 * t)
        glow = np.exp(-np.hypot(x - sun_x, y - sun_y) / 70)
        sky = np.clip(1 - y / horizon, 0, 1)
        waves = 0.5 + 0.5 * np.sin(0.9 * np.maximum(y - horizon, 0) ** 0.7 + 0.02 * x - 2 * t)
        water = (y > horizon) * waves * (0.25 + 0.5 * np.exp(-(((x - sun_x) / 90) ** 2)))
        red = 60 + 110 * (1 - sky) * (y <= horizon) + 190 * glow + 90 * water
        green = 40 + 50 * (1 - sky) + 140 * glow + 70 * water
        blue = 90 + 60 * sky + 60 * glow + 60 * water
        yield np.clip(np.stack([red, green, blue], axis=2), 0, 255).astype(np.uint8)
