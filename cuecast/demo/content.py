"""The built-in programme: a short French announcement, its music, its picture.

Everything is made by arithmetic and by espeak-ng, so the demonstration needs no files.
"""

from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from synth.language.subtitles import Subtitle
from synth.units.speech.espeak_voice import speak

FS = 48_000
"""Rate in Hz of the sound."""

WIDTH, HEIGHT, PICTURE_RATE = 640, 360, 25
"""Pixels of the picture, and pictures per second."""

LINES = (
    "Bonsoir, et bienvenue sur notre chaîne.",
    "Une interprète virtuelle accompagne ce programme.",
    "Elle code chaque syllabe avec sa main droite, près du visage.",
    "Ses gestes voyagent dans le son, et personne ne les entend.",
    "Le téléviseur les retrouve, puis il dessine notre amie à l'écran.",
    "Merci de votre confiance, et bonne soirée à tous.",
)
"""Sentences of the speaker."""

_FIRST_LINE_S = 2.5
"""Seconds before the first line: a receiver tunes in."""

_PAUSE_S = 0.9
"""Seconds between lines."""

_TAIL_S = 1.2
"""Seconds after the last pause: she may be 1.5 s behind, and goes to rest."""

_SPEECH_RMS = 0.09
"""Level of the speech, of full scale: about -21 dB, as announcements have."""

_MUSIC_RMS = 0.05
"""Level of the music, of full scale: 5 dB below the speech."""

_CHORDS = ((57, 60, 64, 69), (53, 57, 60, 65), (48, 55, 60, 64), (55, 59, 62, 67))
"""A minor, F, C, G as MIDI note numbers."""

_CHORD_S = 2.0
"""Duration of a chord in seconds."""

_PLAYERS = 3
"""Strings that play each note, slightly apart."""

_VIBRATO_HZ = 5.5
"""Rate of the vibrato."""

_BRIGHT_HZ = 9000
"""Highest harmonic in Hz."""


def make_sound() -> tuple[NDArray[np.float32], list[Subtitle]]:
    """Return the sound, shape (n, 2) at `FS`, and the subtitles of its speech."""
    sound, subtitles = _programme()
    return sound.copy(), list(subtitles)


@cache
def _programme() -> tuple[NDArray[np.float32], tuple[Subtitle, ...]]:
    """Make sound and subtitles, once in a process."""
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
    sound = make_music(time_s + _TAIL_S)
    for start, x in spoken:
        sound[start : start + len(x)] += x[:, None]
    return np.clip(sound, -0.99, 0.99).astype(np.float32), tuple(subtitles)


def make_music(seconds: float) -> NDArray[np.float64]:
    """Play chords on strings, shape (n, 2)."""
    rng = np.random.default_rng(2004)
    n, fade = round(seconds * FS), FS // 4
    bar = round(_CHORD_S * FS)
    sound = np.zeros((n, 2))
    for number, start in enumerate(range(0, n, bar)):
        length = min(bar + fade, n - start)
        rise = np.minimum(np.arange(length), np.arange(length)[::-1]) / fade
        for note in _CHORDS[number % len(_CHORDS)]:
            for _ in range(_PLAYERS):
                tone = _bowed(440 * 2 ** ((note - 69) / 12), length, rng) * np.minimum(rise, 1)
                seat = rng.uniform(0.2, 0.8)
                sound[start : start + length] += tone[:, None] * (1 - seat, seat)
    level: NDArray[np.float64] = sound * (_MUSIC_RMS / np.sqrt(np.mean(sound**2)))
    return level


def _bowed(frequency_hz: float, length: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return one player's tone: a harmonic series, a little out of tune, with vibrato."""
    t = np.arange(length) / FS
    frequency = frequency_hz * 2 ** (rng.normal(0, 4) / 1200)
    vibrato = 0.003 * frequency / _VIBRATO_HZ * np.sin(2 * np.pi * _VIBRATO_HZ * t)
    phase = 2 * np.pi * frequency * t + vibrato
    harmonics = np.arange(1, int(_BRIGHT_HZ / frequency))
    parts = np.exp(1j * rng.uniform(0, 6, harmonics.size)) / harmonics**1.1
    # All harmonics are powers of the first: their sum is a polynomial, after Horner.
    first, tone = np.exp(1j * phase), np.zeros(length, dtype=np.complex128)
    for part in parts[::-1]:
        tone += part
        tone *= first
    return tone.imag


def make_pictures(seconds: float) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures, (HEIGHT, WIDTH, 3) red, green, blue: a sunset over moving water."""
    y, x = np.arange(HEIGHT, dtype=np.float64)[:, None], np.arange(WIDTH, dtype=np.float64)
    horizon = 0.62 * HEIGHT
    above = y <= horizon
    below = slice(int(above.sum()), HEIGHT)
    sky = np.clip(1 - y / horizon, 0, 1)
    depth = 0.9 * (y[below] - horizon) ** 0.7
    # Constant in all pictures: the light of the sky, the phase of the waves by depth.
    still = 60 + 110 * (1 - sky) * above, 40 + 50 * (1 - sky), 90 + 60 * sky
    sines, cosines = 0.5 * np.sin(depth), 0.5 * np.cos(depth)
    glow, plane = np.empty((HEIGHT, WIDTH)), np.empty((HEIGHT, WIDTH))
    for number in range(round(seconds * PICTURE_RATE)):
        t = number / PICTURE_RATE
        sun_x, sun_y = WIDTH * (0.25 + 0.01 * t), HEIGHT * (0.30 + 0.006 * t)
        np.add((x - sun_x) ** 2, (y - sun_y) ** 2, out=glow)
        np.sqrt(glow, out=glow)
        glow *= -1 / 70
        np.exp(glow, out=glow)
        across = 0.02 * x - 2 * t
        water = sines * np.cos(across) + cosines * np.sin(across)
        water += 0.5
        water *= 0.25 + 0.5 * np.exp(-(((x - sun_x) / 90) ** 2))
        picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        for channel, (sun, wave) in enumerate(((190, 90), (140, 70), (60, 60))):
            np.multiply(glow, sun, out=plane)
            plane += still[channel]
            plane[below] += wave * water
            picture[..., channel] = np.clip(plane, 0, 255, out=plane)
        yield picture
