"""Joins of speech: stretches meet in phase and at one level."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from synth.units.speech.marks import PitchMarks
from synth.units.speech.psola import SpeechPiece, modify_prosody

FS, PERIOD = 16_000, 100
"""Rate in Hz, and distance of the pulses in samples."""

LATE = 27
"""Samples by which the second sound's marks lie beside those of the first one."""


def _vowel(n: int) -> NDArray[np.float64]:
    """Return pulses through two resonances, at 700 and 1900 Hz."""
    x = (np.arange(n) % PERIOD == 0).astype(np.float64)
    for hz in (700, 1900):
        pole = 0.97 * np.exp(2j * np.pi * hz / FS)
        x = np.asarray(lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], x))
    return np.asarray(x / np.abs(x).max())


def _joined(late: int, gain: float) -> NDArray[np.float64]:
    """Return half a second of a vowel and half a second of it again, marked later and louder."""
    n = FS
    x = np.concatenate([_vowel(n), gain * _vowel(n)])
    first = np.arange(PERIOD, n - PERIOD, PERIOD)
    marks = PitchMarks(
        np.concatenate([first, first + n + late]), np.ones(2 * len(first), dtype=np.bool_), FS
    )
    pieces = [SpeechPiece.of([0.2, 0.7], [0.0, 0.5]), SpeechPiece.of([1.2, 1.7], [0.5, 1.0])]
    return modify_prosody(x, marks, pieces)


def _likeness(y: NDArray[np.float64], at: int) -> float:
    """Return the correlation of a period with the next one."""
    one, other = y[at : at + PERIOD], y[at + PERIOD : at + 2 * PERIOD]
    return float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))


def test_stretches_meet_in_phase_whatever_their_marks() -> None:
    y = _joined(LATE, 1.0)
    around = [_likeness(y, at) for at in range(FS // 2 - 4 * PERIOD, FS // 2 + 3 * PERIOD, 10)]
    # Measured: 1.0; with the grains left at their marks .86.
    assert min(around) > 0.99


def test_levels_meet_half_way() -> None:
    y = _joined(0, 10 ** (4 / 20))
    level = np.array(
        [10 * np.log10(np.mean(y[at : at + PERIOD] ** 2)) for at in range(0, FS - PERIOD, PERIOD)]
    )
    step = level - level[10]
    assert abs(step[-10] - 4.0) < 0.1, "far from the join the level is its own"
    assert abs(step[:60].max()) < 4.1
    # Measured: .18 dB from a period to the next; without the change of level 1.5.
    assert np.abs(np.diff(step)).max() < 0.3


def test_two_parts_of_one_stretch_are_not_a_join() -> None:
    x = _vowel(FS)
    marks = PitchMarks(np.arange(0, FS, PERIOD), np.ones(FS // PERIOD, dtype=np.bool_), FS)
    half = [SpeechPiece.of([0.0, 0.5], [0.0, 0.5]), SpeechPiece.of([0.5, 1.0], [0.5, 1.0])]
    np.testing.assert_allclose(modify_prosody(x, marks, half), x, atol=1e-12)
