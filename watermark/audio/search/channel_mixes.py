"""How channels become the sound that is searched: the usual mid, and what may bear it instead.

In: a stretch of all channels; out: the mix of a kind, where it differs from those tried before it.
Specification: spec/audio-carrier.md, W42.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from watermark.audio.signal.mix import has_centre, weights_of
from watermark.audio.signal.sample_buffer import REACH, SampleBuffer

LONGEST_SKEW = 1440
"""Greatest delay of one channel in samples: 30 ms at 48 kHz."""

FINE = 8
"""Parts of a sample to which that is found."""

ALIKE = 1e-8
"""Least difference between two mixes as a part of the power: a mix 80 dB softer than two
channels of the same sound shows nothing else."""

LEAST_LIKENESS = 6.0
"""Least ratio of a believed skew's correlation to the others' mean power: of
23000 delays of unlike channels, noise's highest has some 4.5."""

USUAL_RMS, GATE = 10 ** (-25 / 20), 0.1
"""Root mean square of a programme of -23 LUFS, about, in blocks that have at least a tenth of the
loudest one's."""

MID, USUAL, ECHO, LATE, SIDE, LEFT, RIGHT, CENTRE = (
    "mid", "usual loudness", "echo", "late", "side", "left", "right", "centre"
)  # fmt: skip
"""Kinds of mixes: that which is marked; the same at a usual loudness; without its own echo; with
one channel late; with one inverted; channels alone."""

ECHO_WINDOW, SHORTEST_ECHO = 2**14, 240
"""Samples of the windows whose logarithmic spectra are averaged, and of the shortest echo: one that
is shorter looks like a voice's pitch."""

LEAST_ECHO, LARGEST_ECHO = 0.2, 0.8
"""Factors of an echo that is believed; of the largest one its removal dies out within a second."""

PAIR = "pair"
"""Left and right of more channels than two."""


@dataclass(frozen=True, slots=True)
class ChannelMix:
    """How channels become the sound that is searched.

    Attributes
    ----------
    weights : tuple of float
        Of each channel.
    skew : float
        Delay of the second channel, samples.
    echo : tuple of (int, float, float)
        Samples after which the mix comes again, and the factors of this echo in the mix and in what
        is beside it; both are taken out.
    """

    weights: tuple[float, ...]
    skew: float = 0.0
    echo: tuple[int, float, float] = (0, 0.0, 0.0)

    @property
    def side(self) -> "ChannelMix | None":
        """Mix of the first channels' rest beside this one, None for one that is no mid."""
        return _side_of(self)


@lru_cache(maxsize=16)
def _side_of(mix: ChannelMix) -> ChannelMix | None:
    left, right, *rest = mix.weights if len(mix.weights) > 1 else (1.0, 0.0)
    if abs(left) != abs(right) or any(rest):
        return None
    late, own, beside = mix.echo
    return ChannelMix((left, -right, *rest), mix.skew, (late, beside, own))


def usual_mix(channels: int) -> ChannelMix:
    """Return the mix that is marked."""
    return ChannelMix(weights_of(channels))


def kinds_of(channels: int) -> tuple[str, ...]:
    """Return the kinds of mixes, other than the usual one, that `channels` channels may have."""
    if channels == 1:
        return ()
    kinds = (LATE, SIDE, LEFT, RIGHT)
    return (
        *kinds,
        *((PAIR,) if channels > 2 else ()),
        *((CENTRE,) if has_centre(channels) else ()),
    )


def find_mix(kind: str, sound: NDArray[Any]) -> ChannelMix | None:
    """Return the mix of a kind for a stretch of sound, shape (n, channels).

    None where it would be silent, or the same but for a factor as one of the kinds before it.
    """
    channels = sound.shape[1]
    plain = usual_mix(channels)
    if kind == MID:
        return plain
    if kind == ECHO:
        side = plain.side
        beside = (
            sound @ np.array(side.weights, dtype=sound.dtype)
            if side
            else np.zeros(len(sound), dtype=sound.dtype)
        )
        late, factor = _find_echo(sound @ np.array(plain.weights, dtype=sound.dtype))
        echo = late, factor, _echo_at(beside, late)
        return ChannelMix(plain.weights, echo=echo) if late else None
    if kind == USUAL:
        gain = usual_gain(sound)
        return ChannelMix(tuple(gain * weight for weight in plain.weights))
    # Weights of the channels after the first two.
    rest = (0.0,) * (channels - 2)
    if kind == LATE:
        found = _find_skew(sound[:, 0], sound[:, 1])
        if found is None or found[1] == 0:
            return None
        return ChannelMix((0.5, 0.5 * found[0], *rest), found[1])
    fixed = {SIDE: (0.5, -0.5, *rest), LEFT: (1.0, 0.0, *rest), RIGHT: (0.0, 1.0, *rest)}
    if channels > 2:
        fixed[PAIR] = (0.5, 0.5, *rest)
    if has_centre(channels):
        fixed[CENTRE] = (0.0, 0.0, 1.0, *rest[1:])
    # Residual power against every earlier mix, in phase or inverted: w' C w with C = sound' sound.
    earlier = [plain.weights, *list(fixed.values())[: list(fixed).index(kind)]]
    products = sound.T @ sound

    def power(weights: NDArray[Any]) -> float:
        return float(weights @ products @ weights)

    own = np.array(fixed[kind])
    apart = (min(power(own - np.array(w)), power(own + np.array(w))) for w in earlier)
    if not power(own) > 0 or min(apart) <= ALIKE * power(own):
        return None
    return ChannelMix(fixed[kind])


def _cepstrum(mix: NDArray[Any]) -> NDArray[Any]:
    """Mean cepstrum of the windows that are not silent; an echo's factor stands at its delay.

    Source: Bogert, Healy and Tukey, "The quefrency alanysis of time series for echoes", 1963.
    """
    sound = mix.astype(np.float32, copy=False)
    windows = np.lib.stride_tricks.sliding_window_view(sound, ECHO_WINDOW)[:: ECHO_WINDOW // 2]
    spectra = scipy.fft.rfft(windows * _echo_window(), axis=1)
    power = spectra.real**2 + spectra.imag**2
    mean = power.mean(axis=1, keepdims=True)
    heard = mean[:, 0] > 0
    if not heard.any():
        return np.zeros(ECHO_WINDOW)
    logarithms = np.log(power[heard] + np.float32(1e-9) * mean[heard])
    return np.asarray(scipy.fft.irfft(logarithms.mean(axis=0, dtype=np.float64)))


@lru_cache(maxsize=1)
def _echo_window() -> NDArray[np.float32]:
    return np.hanning(ECHO_WINDOW).astype(np.float32)


def _find_echo(mix: NDArray[Any]) -> tuple[int, float]:
    """Return an echo's delay in samples and its factor; 0 and 0 where none is believed."""
    near = _cepstrum(mix)[SHORTEST_ECHO : LONGEST_SKEW + 1]
    peak = int(np.abs(near).argmax())
    factor = float(np.clip(near[peak], -LARGEST_ECHO, LARGEST_ECHO))
    deviation = float(np.sqrt(np.mean(np.delete(near, peak) ** 2)))
    if abs(factor) < max(LEAST_ECHO, LEAST_LIKENESS * deviation):
        return 0, 0.0
    return SHORTEST_ECHO + peak, factor


def _echo_at(mix: NDArray[Any], late: int) -> float:
    """Return the factor of an echo whose delay is known."""
    return float(np.clip(_cepstrum(mix)[late], -LARGEST_ECHO, LARGEST_ECHO)) if late else 0.0


def usual_gain(sound: NDArray[Any]) -> float:
    """Return the factor that brings a stretch, shape (n, channels), to a usual loudness."""
    mid = sound @ np.array(weights_of(sound.shape[1]), dtype=sound.dtype)
    blocks = mid[: mid.size // 2400 * 2400].reshape(-1, 2400)
    rms = np.sqrt((blocks**2).mean(axis=1))
    loud = rms[rms >= GATE * rms.max()]
    return float(USUAL_RMS / max(np.sqrt((loud**2).mean()), 1e-7))


def _find_skew(left: NDArray[Any], right: NDArray[Any]) -> tuple[int, float] | None:
    """Sign and lateness of right against left, None if unknown.

    Source: phase transform, Knapp and Carter, IEEE Trans. ASSP 24(4), 1976.
    """
    transforms = [
        scipy.fft.rfft(channel.astype(np.float32, copy=False)) for channel in (left, right)
    ]
    cross = transforms[0].conj() * transforms[1]
    magnitude = np.abs(cross)
    if not magnitude.any():
        return None
    cross /= magnitude + np.float32(1e-3) * magnitude.mean()
    likeness = scipy.fft.irfft(cross, left.size)
    reach, margin = LONGEST_SKEW * FINE, LONGEST_SKEW + REACH + 1
    tape = SampleBuffer(-margin, np.float32)
    tape.append(np.concatenate([likeness[-margin:], likeness[: margin + 1]]))
    near = tape.read(-LONGEST_SKEW, 1 / FINE, 2 * reach + 1)
    peak = int(np.abs(near).argmax())
    others = np.delete(near, np.arange(max(peak - 4 * FINE, 0), peak + 4 * FINE + 1) % near.size)
    if np.abs(near[peak]) < LEAST_LIKENESS * np.sqrt(np.mean(others**2)):
        return None
    return (1 if near[peak] > 0 else -1), (peak - reach) / FINE
