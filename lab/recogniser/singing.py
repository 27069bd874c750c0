"""Spoken voices made to sing: what lies under speech in programmes, for the ear to learn from."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from synth.planning.alignment.recogniser import FS
from synth.units.speech.marks import place_marks
from synth.units.speech.pitch import track_pitch
from synth.units.speech.psola import SpeechPiece, modify_prosody

_SCALE = (-5, -3, 0, 2, 4, 5, 7, 9, 12)
"""Semitones of the notes from the voice's own pitch: a major scale."""

_NOTE_S = 0.25
"""Seconds of speech on one note, before they are drawn out."""

_DRAWN_OUT = (2.0, 3.0)
"""How many times slower a voice sings than it speaks."""

_TRANSPOSED = (0.9, 1.3)
"""Factors on the pitch of the whole melody."""

_STRENGTH = (0.8, 1.5)
"""Ratio of the singer to the music, by root mean square."""

_LEAST_VOICED = 0.2
"""Least share of voiced frames in a sound that counts as a voice."""

_SHORTEST_S, _LONGEST_S = 1.0, 6.0
"""Length of the phrases that are taken."""

Sound = NDArray[np.float64]


def sung(x: Sound, rng: np.random.Generator) -> Sound:
    """Return a spoken phrase on notes, drawn out; nothing if it holds hardly any voice."""
    track = track_pitch(x, FS)
    voiced = track.f0 > 0
    if voiced.mean() < _LEAST_VOICED:
        return np.zeros(0)
    own = float(np.median(track.f0[voiced]))
    length_s = len(x) / FS
    source = np.linspace(0.0, length_s, max(3, round(length_s / 0.02)))
    notes = rng.choice(_SCALE, int(length_s / _NOTE_S) + 1)
    wanted = own * rng.uniform(*_TRANSPOSED) * 2 ** (notes[(source / _NOTE_S).astype(int)] / 12)
    pitch = np.where(voiced, track.f0, own)
    ratio = wanted / np.interp(source, np.arange(len(pitch)) * track.hop_s, pitch)
    slower = rng.uniform(*_DRAWN_OUT)
    piece = SpeechPiece.of(source, source * slower, np.clip(ratio, 0.4, 2.5))
    return modify_prosody(x, place_marks(x, FS, track), [piece])


def songs(
    voices: Sequence[Sound], music: Sequence[Sound], rng: np.random.Generator, length_s: float
) -> list[Sound]:
    """Return pieces of music with voices that sing, in all about so long."""
    made: list[Sound] = []
    done_s = 0.0
    for number in rng.permutation(len(voices)):
        spoken = voices[number]
        if done_s >= length_s:
            break
        if not _SHORTEST_S < len(spoken) / FS < _LONGEST_S:
            continue
        voice = sung(spoken, rng)
        if not len(voice):
            continue
        under = music[len(made) % len(music)]
        under = np.resize(np.roll(under, -int(rng.integers(len(under)))), len(voice))
        strength = rng.uniform(*_STRENGTH)
        made.append(strength * voice / (voice.std() + 1e-9) + under / (under.std() + 1e-9))
        done_s += len(voice) / FS
    return made
