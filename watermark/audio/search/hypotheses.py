"""What may have happened to a sound in which the usual search finds nothing, one guess at a time.

In: a stretch of all channels; out: guesses in the order in which they are worth trying: bands
turned in phase (a crossover, a rotator, a polarity), one channel inverted, late or alone, another
gain, another speed, another duration at its pitch.
Specification: spec/audio-carrier.md, W35 and W42.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from watermark.audio.search.acquire import CLOCK_ERRORS_PPM
from watermark.audio.search.pilot_scan import DECIMATION, LOW_REACH
from watermark.audio.signal.mix import has_centre, weights_of
from watermark.audio.signal.profile import FS, PILOT_STEPS
from watermark.audio.signal.sample_buffer import REACH, SampleBuffer, StereoBuffer

STRETCH_S, SHORT_STRETCH_S = 2.2, 1.36
"""Sound on which a guess is tried: a superframe and its successor, and one superframe, wherever
they begin."""

LARGEST_SPEED = 0.053
"""Largest change of speed that is tried."""

KNOWN_SPEEDS = (Fraction(25, 24), Fraction(24, 25), Fraction(26, 25), Fraction(25, 26))
"""Films at 24 pictures a second, or 23.976, played at 25, and the way back, and what others mean by
4 %: tried first."""

NEAR = 2
"""Speeds nearest to the right one that are tried with those: clocks and tapes at 0.15 to 0.47 %."""

GAIN_STEPS = 8
"""Steps of pilots tried for each doubling: 2^(1/8) apart, soft values lose a tenth half-way."""

GAIN_LADDER = range(-GAIN_STEPS, GAIN_STEPS * len(PILOT_STEPS))
"""Those tried in sound of the usual loudness; 20 dB double the steps."""

LADDER_PART = 10
"""Of those, how many share one attempt."""

USUAL_RMS, GATE = 10 ** (-25 / 20), 0.1
"""Root mean square of a programme of -23 LUFS, about, in blocks that have at least a tenth of the
loudest one's."""

LONGEST_SKEW = 48
"""Samples by which one channel may be late."""

FINE = 8
"""Parts of a sample to which that is found."""

ALIKE = 1e-8
"""Part of a mix's power by which another must differ from it: what is 80 dB softer than two
channels of the same sound tells nothing else."""

LEAST_LIKENESS = 4.0
"""Ratio of the highest to the next correlation from which a skew is believed."""


@dataclass(frozen=True, slots=True)
class ChannelMix:
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

    @property
    def side(self) -> "ChannelMix | None":
        """Mix of what the first channels have beside this one, None for one that is no mid."""
        left, right, *rest = self.weights if len(self.weights) > 1 else (1.0, 0.0)
        if abs(left) != abs(right) or any(rest):
            return None
        return ChannelMix((left, -right, *rest), self.skew)


@dataclass(frozen=True, slots=True)
class ChannelHypothesis:
    """One thing to try.

    Attributes
    ----------
    mix : ChannelMix
        Sound in which to search.
    steps : tuple of tuple of float
        Steps that pilots may have in a search blind to phase, each part for itself; none for the
        usual search.
    speed : float
        Samples that come for one of the mark's own.
    stretch_s : float
        Sound in which to search, seconds.
    stretched : bool
        Whether its duration was changed at its pitch.
    """

    mix: ChannelMix
    steps: tuple[tuple[float, ...], ...] = (PILOT_STEPS,)
    speed: float = 1.0
    stretch_s: float = STRETCH_S
    stretched: bool = False


class Stretch:
    """A mix that is searched again and again, as it is and as the search's sound.

    Parameters
    ----------
    tape : StereoBuffer
        The mix and its side.
    nominal : float
        Samples that come for one of the mark's own at its usual speed.
    """

    def __init__(self, tape: StereoBuffer, nominal: float) -> None:
        self.tape, self._low = tape, SampleBuffer()
        step, count = DECIMATION * nominal, tape.end - tape.first
        self._low.append(tape.read(tape.first, step, int(count / step), LOW_REACH))

    def low(self, speed: float, seconds: float) -> NDArray[np.float64]:
        """Return the first seconds at the search's rate, as if they came at some speed."""
        count = min(int(seconds * FS / DECIMATION), self._low.end)
        return self._low.read(0.0, speed, int(count / speed), LOW_REACH)


def usual_mix(channels: int) -> ChannelMix:
    """Return the mix that is marked."""
    return ChannelMix(weights_of(channels))


def make_guesses(
    sound: NDArray[np.float64], *, again: bool = False, thorough: bool
) -> Iterator[ChannelHypothesis]:
    """Guess about a stretch of sound, shape (n, channels).

    After the first round `again` for another duration at the same pitch, too; thoroughly at all
    speeds.
    """
    channels = sound.shape[1]
    plain = usual_mix(channels)
    for mix in _other_mixes(sound):
        yield ChannelHypothesis(mix)
    gain = usual_gain(sound)
    usual = ChannelMix(tuple(gain * weight for weight in plain.weights))
    ladder = [PILOT_STEPS[0] * 2 ** (i / GAIN_STEPS) for i in GAIN_LADDER]
    parts = range(0, len(ladder), LADDER_PART)
    yield ChannelHypothesis(
        usual, tuple(tuple(ladder[first : first + LADDER_PART]) for first in parts)
    )
    for speed in likely_speeds():
        yield ChannelHypothesis(plain, (), speed)
    if again:
        yield ChannelHypothesis(plain, stretched=True)
    for speed in speeds()[NEAR:] if thorough else ():
        yield ChannelHypothesis(plain, (), speed, SHORT_STRETCH_S)


def usual_gain(sound: NDArray[np.float64]) -> float:
    """Return the factor that brings a stretch, shape (n, channels), to a usual loudness."""
    mid = sound @ np.array(weights_of(sound.shape[1]))
    blocks = mid[: mid.size // 2400 * 2400].reshape(-1, 2400)
    rms = np.sqrt((blocks**2).mean(axis=1))
    loud = rms[rms >= GATE * rms.max()]
    return float(USUAL_RMS / max(np.sqrt((loud**2).mean()), 1e-7))


def likely_speeds() -> list[float]:
    """List samples that come for one of the mark's own: one over a film's speeds, and near 1."""
    return [*(float(1 / speed) for speed in KNOWN_SPEEDS), *speeds()[:NEAR]]


def speeds() -> list[float]:
    """List samples that come for one of the mark's own: a grid without gaps, from 1 on."""
    reach = CLOCK_ERRORS_PPM.max() * 1e-6
    count = int(np.ceil((LARGEST_SPEED - reach) / (2 * reach)))
    return [1 + sign * 2 * reach * n for n in range(1, count + 1) for sign in (1, -1)]


def _other_mixes(sound: NDArray[np.float64]) -> Iterator[ChannelMix]:
    """Yield mixes that differ from the usual one and from each other by more than a factor."""
    channels = sound.shape[1]
    if channels == 1:
        return
    rest = (0.0,) * (channels - 2)
    found = _find_skew(sound[:, 0], sound[:, 1])
    if found is not None and found[1] != 0:
        yield ChannelMix((0.5, 0.5 * found[0], *rest), found[1])
    others = [(0.5, -0.5, *rest), (1.0, 0.0, *rest), (0.0, 1.0, *rest)]
    if channels > 2:
        others.append((0.5, 0.5, *rest))
    if has_centre(channels):
        others.append((0.0, 0.0, 1.0, *rest[1:]))
    products = sound.T @ sound
    tried = [np.array(weights_of(channels))]
    for weights in map(np.array, others):
        power = weights @ products @ weights
        apart = [[d @ products @ d for d in (weights - old, weights + old)] for old in tried]
        if power > 0 and min(map(min, apart)) > ALIKE * power:
            tried.append(weights)
            yield ChannelMix(tuple(map(float, weights)))


def _find_skew(left: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[int, float] | None:
    """Sign and lateness of right against left, None where nothing tells.

    Source: phase transform, Knapp and Carter, IEEE Trans. ASSP 24(4), 1976.
    """
    transforms = [scipy.fft.rfft(channel.astype(np.float32)) for channel in (left, right)]
    cross = transforms[0].conj() * transforms[1]
    magnitude = np.abs(cross)
    if not magnitude.any():
        return None
    cross /= magnitude + np.float32(1e-3) * magnitude.mean()
    likeness = scipy.fft.irfft(cross, left.size)
    reach, margin = LONGEST_SKEW * FINE, LONGEST_SKEW + REACH + 1
    tape = SampleBuffer(-margin)
    tape.append(np.concatenate([likeness[-margin:], likeness[: margin + 1]]).astype(np.float64))
    near = tape.read(-LONGEST_SKEW, 1 / FINE, 2 * reach + 1)
    peak = int(np.abs(near).argmax())
    others = np.delete(near, np.arange(max(peak - 4 * FINE, 0), peak + 4 * FINE + 1) % near.size)
    if np.abs(near[peak]) < LEAST_LIKENESS * np.sqrt(np.mean(others**2)):
        return None
    return (1 if near[peak] > 0 else -1), (peak - reach) / FINE
