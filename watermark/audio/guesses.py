"""What may have happened to a sound in which the usual search finds nothing, one guess at a time.

In: a stretch of all channels; out: guesses in the order in which they are worth trying: bands
turned in phase (a crossover, a rotator, a polarity), one channel inverted, late or alone, another
gain, another speed. Specification: section 7.1.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from watermark.audio.acquire import CLOCK_ERRORS_PPM
from watermark.audio.mix import has_centre, weights_of
from watermark.audio.profile import PILOT_STEPS

LARGEST_SPEED = 0.051
"""Largest change of speed that is tried."""

KNOWN_SPEEDS = (Fraction(25, 24), Fraction(24, 25), Fraction(25025, 24000), Fraction(24000, 25025))
"""Films at 24 or 23.976 pictures a second played at 25, and the way back: tried first."""

GAIN_PHASES = 8
"""Steps of pilots tried between two tiers: 2^(1/8) apart, soft values lose a tenth half-way."""

GAIN_TIERS = range(-2, 6)
"""Tiers, real or thought: 30 dB more or less move the steps by one and a half."""

LONGEST_SKEW = 48
"""Samples by which one channel may be late."""

FINE = 8
"""Parts of a sample to which that is found."""

LEAST_LIKENESS = 4.0
"""Ratio of the highest to the next correlation from which a skew is believed."""


@dataclass(frozen=True, slots=True)
class Mix:
    """How channels become the sound that is searched.

    Attributes
    ----------
    weights : tuple of float
        Of each channel.
    skew : float
        Samples by which the second channel is late.
    """

    weights: tuple[float, ...]
    skew: float = 0.0


@dataclass(frozen=True, slots=True)
class Guess:
    """One thing to try.

    Attributes
    ----------
    mix : Mix
        Sound in which to search.
    steps : tuple of float
        Steps that pilots may have in a search blind to phase; none for the usual search.
    speed : float
        Samples that come for one of the mark's own.
    """

    mix: Mix
    steps: tuple[float, ...] = PILOT_STEPS
    speed: float = 1.0


def usual_mix(channels: int) -> Mix:
    """Return the mix that is marked."""
    return Mix(weights_of(channels))


def make_guesses(sound: NDArray[np.float64]) -> Iterator[Guess]:
    """Guesses about a stretch of sound, shape (n, channels)."""
    channels = sound.shape[1]
    plain = usual_mix(channels)
    yield Guess(plain)
    for mix in _other_mixes(sound):
        yield Guess(mix)
    for part in range(1, GAIN_PHASES):
        yield Guess(plain, _steps(part))
    yield Guess(plain, _steps(0))
    for speed in speeds():
        yield Guess(plain, (), speed)


def speeds() -> list[float]:
    """List samples that come for one of the mark's own: one over the speed, known speeds first."""
    reach = CLOCK_ERRORS_PPM.max() * 1e-6
    known = [float(1 / speed) for speed in KNOWN_SPEEDS]
    count = int(np.ceil((LARGEST_SPEED - reach) / (2 * reach)))
    grid = [1 + sign * 2 * reach * n for n in range(1, count + 1) for sign in (1, -1)]
    return known + grid


def _steps(part: int) -> tuple[float, ...]:
    return tuple(PILOT_STEPS[0] * 2 ** (tier + part / GAIN_PHASES) for tier in GAIN_TIERS)


def _other_mixes(sound: NDArray[np.float64]) -> Iterator[Mix]:
    channels = sound.shape[1]
    if channels == 1:
        return
    rest = (0.0,) * (channels - 2)
    found = _find_skew(sound[:, 0], sound[:, 1])
    if found is not None:
        sign, skew = found
        if sign < 0 or skew != 0:
            yield Mix((0.5, 0.5 * sign, *rest), skew)
    yield Mix((0.5, -0.5, *rest))
    yield Mix((1.0, 0.0, *rest))
    yield Mix((0.0, 1.0, *rest))
    if channels > 2:
        yield Mix((0.5, 0.5, *rest))
    if has_centre(channels):
        yield Mix((0.0, 0.0, 1.0, *rest[1:]))


def _find_skew(left: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[int, float] | None:
    """Sign and lateness of right against left, None where nothing tells.

    Source: phase transform, Knapp and Carter, IEEE Trans. ASSP 24(4), 1976.
    """
    size = left.size
    cross = np.fft.rfft(left).conj() * np.fft.rfft(right)
    magnitude = np.abs(cross)
    if not magnitude.any():
        return None
    cross /= magnitude + 1e-3 * magnitude.mean()
    likeness = np.fft.irfft(cross, FINE * size)
    reach = LONGEST_SKEW * FINE
    near = np.concatenate([likeness[-reach:], likeness[: reach + 1]])
    peak = int(np.abs(near).argmax())
    others = np.delete(near, np.arange(max(peak - 4 * FINE, 0), peak + 4 * FINE + 1) % near.size)
    if np.abs(near[peak]) < LEAST_LIKENESS * np.sqrt(np.mean(others**2)):
        return None
    return (1 if near[peak] > 0 else -1), (peak - reach) / FINE
