"""From features of frames to the five model output variables of the advanced version to one grade.

ITU-R BS.1387-1, Annex 2, sections 4 and 6. As `movs` does for the basic version, sums are held
instead of files.
"""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.quality import _bank_kernels as k
from watermark.quality.movs import network

FloatArray = NDArray[np.float64]

DELAY_FRAMES = 125  # half a second, before the modulation filters have settled

AUDIBLE_DELAY_FRAMES = 13  # 50 ms after both signals became audible

_MISSING_SHARE = 0.5
"""Weight of missing components relative to added ones."""


@dataclass(frozen=True, slots=True)
class AdvancedMovs:
    """The five model output variables of the advanced version, in the network's order.

    Attributes
    ----------
    rms_mod_diff : float
        Difference of the modulations.
    rms_noise_loud_asym : float
        Loudness in sone of added sound and of half of the missing sound.
    segmental_nmr : float
        Mean noise-to-mask ratio in dB.
    ehs : float
        Harmonic structure of the error.
    avg_lin_dist : float
        Loudness in sone of the part that a change of the spectrum removed.
    """

    rms_mod_diff: float
    rms_noise_loud_asym: float
    segmental_nmr: float
    ehs: float
    avg_lin_dist: float

    def as_array(self) -> FloatArray:
        """Values in the network's order, float64, shape (5,)."""
        return np.array(astuple(self), dtype=np.float64)


class BankAverages:
    """Running sums of the variables that come from the filter bank; frames of shape (channels, 7).

    Columns of a frame as in `_bank_kernels`.
    """

    def __init__(self, channels: int) -> None:
        self._modulation = np.zeros((2, channels))
        self._loudness = np.zeros((3, channels))
        self._audible = 0

    def add(self, frame: FloatArray, *, settled: bool, audible: bool) -> None:
        """Count one frame; flags as of `MovAverages.add`."""
        if not settled:
            return
        weight = frame[:, k.WEIGHT] ** 2
        self._modulation[0] += weight * frame[:, k.MOD] ** 2
        self._modulation[1] += weight
        if audible:
            self._loudness[0] += frame[:, k.NOISE] ** 2
            self._loudness[1] += frame[:, k.MISSING] ** 2
            self._loudness[2] += frame[:, k.LINEAR]
            self._audible += 1

    def values(self) -> tuple[float, float, float]:
        """Difference of the modulations, asymmetric loudness of the noise, linear distortion."""
        total, weight = self._modulation
        modulation = np.sqrt(np.divide(total, weight, out=np.zeros_like(total), where=weight > 0))
        added, missing, linear = self._loudness / max(self._audible, 1)
        noise = np.sqrt(added) + _MISSING_SHARE * np.sqrt(missing)
        return float(modulation.mean()), float(noise.mean()), float(linear.mean())


class SpectralAverages:
    """Running sums of the variables that come from spectra; frames of shape (channels, 2).

    A frame holds the noise-to-mask ratio in dB and the harmonic structure, -1 where that was not
    measured.
    """

    def __init__(self, channels: int) -> None:
        self._sums = np.zeros((2, channels))
        self._counts = np.zeros((2, channels))

    def add(self, frame: FloatArray, *, settled: bool, audible: bool) -> None:
        """Count one frame, whatever the flags."""
        self._sums[0] += frame[:, 0]
        self._counts[0] += 1
        self._sums[1] += np.maximum(frame[:, 1], 0)
        self._counts[1] += frame[:, 1] >= 0

    def values(self) -> tuple[float, float]:
        """Segmental noise-to-mask ratio in dB, harmonic structure."""
        mean = (self._sums / np.maximum(self._counts, 1)).mean(axis=1)
        return float(mean[0]), float(1000 * mean[1])


# One row per variable: lower and upper end of its range, weights to the five hidden nodes.
# Copies of the table differ in one digit: GstPEAQ has -39.013052, Kabal's PQevalAudio -39.913052.
# The former grades up to 0.02 lower and is taken: where in doubt, the stricter.
_INPUT = np.array(
    [
        [13.298751, 2166.5, 21.211773, -39.013052, -1.382553, -14.545348, -0.320899],
        [0.041073, 13.24326, -8.981803, 19.956049, 0.935389, -1.686586, -3.238586],
        [-25.018791, 13.46708, 1.633830, -2.877505, -7.442935, 5.606502, -1.783120],
        [0.061560, 10.226771, 6.103821, 19.587435, -0.240284, 1.088213, -0.511314],
        [0.024523, 14.224874, 11.556344, 3.892028, 9.720441, -3.287205, -11.031250],
    ]
)

_HIDDEN_BIAS = np.array([1.330890, 2.686103, 2.096598, -1.327851, 3.087055])
"""Biases of the hidden nodes."""

_HIDDEN = np.array([-4.696996, -3.289959, 7.004782, 6.651897, 4.009144])
"""Weights of the hidden nodes in the distortion index."""

_BIAS = -1.360308
"""Bias of the distortion index."""


def advanced_index(movs: AdvancedMovs) -> float:
    """Distortion index of the advanced version: large is good."""
    return network(movs.as_array(), _INPUT, _HIDDEN_BIAS, _HIDDEN, _BIAS)
