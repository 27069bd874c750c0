"""From per-frame features to eleven model output variables to one grade.

ITU-R BS.1387-1, Annex 2, sections 4 and 6 (basic version). A recommendation speaks of whole files;
`MovAverages` holds running sums instead, so that a programme of any length can be graded.
"""

import math
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.quality import _kernels as k

FloatArray = NDArray[np.float64]

DELAY_FRAMES = 24  # half a second, before the modulation filters have settled

AUDIBLE_SONE = 0.1
"""Loudness in sone above which a frame counts as audible."""

AUDIBLE_DELAY_FRAMES = 3  # 50 ms after both signals became audible

DISTURBED = 10 ** (1.5 / 10)
"""Least ratio of noise to mask in a disturbed frame, 1.5 dB."""

# Used where no frame is wide enough to be measured: the lower ends of the network's ranges.
NARROW_REF, NARROW_TEST = 393.916656, 361.965332


@dataclass(frozen=True, slots=True)
class Movs:
    """The eleven model output variables of the basic version, in the network's order.

    Attributes
    ----------
    bandwidth_ref, bandwidth_test : float
        Mean bandwidths in bins of 23.4 Hz.
    total_nmr : float
        Noise-to-mask ratio in dB.
    win_mod_diff_1, avg_mod_diff_1, avg_mod_diff_2 : float
        Differences of the modulations.
    adb : float
        Average distorted block: logarithm of the steps per frame of audible difference.
    ehs : float
        Harmonic structure of the error.
    rms_noise_loud : float
        Loudness of the disturbance in sone.
    mfpd : float
        Largest low-passed probability of detection.
    rel_dist_frames : float
        Share of frames with a noise-to-mask ratio above 1.5 dB in some band.

    Examples
    --------
    >>> Movs(*range(11)).as_array().shape
    (11,)
    """

    bandwidth_ref: float
    bandwidth_test: float
    total_nmr: float
    win_mod_diff_1: float
    adb: float
    ehs: float
    avg_mod_diff_1: float
    avg_mod_diff_2: float
    rms_noise_loud: float
    mfpd: float
    rel_dist_frames: float

    def as_array(self) -> FloatArray:
        """Values in the network's order, float64, shape (11,)."""
        return np.array(astuple(self), dtype=np.float64)


@dataclass(slots=True)
class FrameFeatures:
    """Features of T frames that follow each other.

    Attributes
    ----------
    features : ndarray, shape (T, channels, 10)
        Columns as in `_kernels`.
    ehs : ndarray, shape (T, channels)
        Harmonic structure of the error, -1 where it was not measured.
    detection : ndarray, shape (T,)
        Probability that a listener detects a difference, over bands and channels.
    steps : ndarray, shape (T,)
        Size of the difference in just noticeable steps.
    """

    features: FloatArray
    ehs: FloatArray
    detection: FloatArray
    steps: FloatArray

    def __getitem__(self, part: slice) -> "FrameFeatures":
        """Return some of the frames."""
        return FrameFeatures(
            self.features[part], self.ehs[part], self.detection[part], self.steps[part]
        )


class MovAverages:
    """Running sums of the model output variables of up to `channels` channels."""

    def __init__(self, channels: int) -> None:
        self._sums = np.zeros((k.SUMS, channels))
        self._sums[k.WINDOW : k.WINDOW + k.WINDOW_FRAMES] = np.nan
        self._whole = np.zeros(k.WHOLE_SUMS)

    @property
    def frames(self) -> int:
        """Frames that were counted."""
        return int(self._whole[k.FRAMES])

    def add(
        self, frames: FrameFeatures, *, settled: NDArray[np.bool_], audible: NDArray[np.bool_]
    ) -> None:
        """Count frames.

        Parameters
        ----------
        frames : FrameFeatures
            Features of T frames.
        settled : ndarray of bool, shape (T,)
            At least half a second has passed, so that modulations may be compared.
        audible : ndarray of bool, shape (T,)
            Both signals have been audible for 50 ms, so that noise loudness may be averaged.
        """
        k.count_frames(
            frames.features, frames.ehs, frames.detection, frames.steps, settled, audible,
            DISTURBED, self._sums, self._whole,
        )  # fmt: skip

    def movs(self) -> Movs:
        """Evaluate the averages; there must be at least one frame."""
        ref, test, count = self._sums[k.BANDWIDTH : k.BANDWIDTH + 3]
        nmr, ehs = self._sums[k.NMR : k.NMR + 2], self._sums[k.EHS : k.EHS + 2]
        modulation = self._sums[k.MODULATION : k.MODULATION + 3]
        return Movs(
            bandwidth_ref=_mean(ref, count, NARROW_REF),
            bandwidth_test=_mean(test, count, NARROW_TEST),
            total_nmr=float(np.mean(10 * np.log10(np.maximum(nmr[0] / self.frames, 1e-30)))),
            win_mod_diff_1=_root_mean(*self._sums[k.WINDOWED : k.WINDOWED + 2]),
            adb=self._average_distorted_block(),
            ehs=1000 * _mean(ehs[0], ehs[1], 0.0),
            avg_mod_diff_1=_mean(modulation[0], modulation[2], 0.0),
            avg_mod_diff_2=_mean(modulation[1], modulation[2], 0.0),
            rms_noise_loud=_root_mean(*self._sums[k.NOISE : k.NOISE + 2]),
            mfpd=float(self._whole[k.LARGEST_DETECTION]),
            rel_dist_frames=float(np.mean(nmr[1] / self.frames)),
        )

    def _average_distorted_block(self) -> float:
        steps, count = self._whole[k.DISTORTED : k.DISTORTED + 2]
        if count == 0:
            return 0.0
        return math.log10(steps / count) if steps > 0 else -0.5


def _mean(total: FloatArray, count: FloatArray, otherwise: float) -> float:
    """Mean over channels of total / count, `otherwise` in a channel without a count."""
    value = np.full(total.shape, otherwise)
    np.divide(total, count, out=value, where=count > 0)
    return float(value.mean())


def _root_mean(total: FloatArray, count: FloatArray) -> float:
    value = np.zeros(total.shape)
    np.divide(total, count, out=value, where=count > 0)
    return float(np.sqrt(value).mean())


LAGS = 256
"""Lags of the correlation of the error's spectrum."""

SILENT = 8000 / 32768**2  # energy of the newer half of a frame below which nothing is measured
_FLOOR = 1e-12  # of a power spectrum; keeps digital silence finite

_WINDOW = np.sqrt(8 / 3) / LAGS * 0.5 * (1 - np.cos(2 * np.pi * np.arange(LAGS) / (LAGS - 1)))
"""Hann window over the lags, scaled to unit energy."""


def harmonic_structure(power: FloatArray, energy: FloatArray) -> FloatArray:
    """Measure how harmonic the difference of two spectra is.

    Parameters
    ----------
    power : ndarray of float64, shape (2, T, bins)
        Power spectra of reference and test, at least 511 bins.
    energy : ndarray of float64, shape (2, T)
        Energy of the newer half of each frame.

    Returns
    -------
    ndarray of float64, shape (T,)
        Largest value of the spectrum of the normalised autocorrelation that exceeds the one before
        it, -1 where both are silent.
    """
    # The ear does not hear 0 Hz; a zero fills the transform up.
    ratio = np.zeros((power.shape[1], 2 * LAGS))
    k.ratios_into(power, _FLOOR, ratio)
    head = np.fft.rfft(ratio[:, :LAGS], 2 * LAGS)
    product = np.fft.irfft(np.conj(head) * np.fft.rfft(ratio))
    correlation = np.empty((len(ratio), LAGS))
    k.normalise_into(ratio, product, correlation)
    correlation -= correlation.mean(axis=1, keepdims=True)
    spectrum = np.fft.rfft(correlation * _WINDOW, axis=1)
    spectrum = np.square(spectrum.real) + np.square(spectrum.imag)
    peak = np.where(spectrum[:, 1:] > spectrum[:, :-1], spectrum[:, 1:], 0.0).max(axis=1)
    return np.where((energy < SILENT).all(axis=0), -1.0, peak)


# One row per variable: lower and upper end of its range, weights to the three hidden nodes.
_INPUT = np.array(
    [
        [393.916656, 921.0, -0.502657, 0.436333, 1.219602],
        [361.965332, 881.131226, 4.307481, 3.246017, 1.123743],
        [-24.045116, 16.212030, 4.984241, -2.211189, -0.192096],
        [1.110661, 107.137772, 0.051056, -1.762424, 4.331315],
        [-0.206623, 2.886017, 2.321580, 1.789971, -0.754560],
        [0.074318, 13.933351, -5.303901, -3.452257, -10.814982],
        [1.113683, 63.257874, 2.730991, -6.111805, 1.519223],
        [0.950345, 1145.018555, 0.624950, -1.331523, -5.955151],
        [0.029985, 14.819740, 3.102889, 0.871260, -5.922878],
        [0.000101, 1.0, -1.051468, -0.939882, -0.142913],
        [0.0, 1.0, -1.804679, -0.503610, -0.620456],
    ]
)

_HIDDEN_BIAS = np.array([-2.518254, 0.654841, -2.207228])
"""Biases of the hidden nodes."""

_HIDDEN = np.array([-3.817048, 4.107138, 4.629582])
"""Weights of the hidden nodes in the distortion index."""

_BIAS = -0.307594
"""Bias of the distortion index."""

_ODG_MIN, _ODG_MAX = -3.98, 0.22
"""Ends of the scale of grades."""


def distortion_index(movs: Movs) -> float:
    """Distortion index: large is good, 1.5 and more is transparent."""
    return network(movs.as_array(), _INPUT, _HIDDEN_BIAS, _HIDDEN, _BIAS)


def network(
    values: FloatArray, table: FloatArray, hidden_bias: FloatArray, weights: FloatArray, bias: float
) -> float:
    """Evaluate a network with one hidden layer; rows of `table` as in `_INPUT`."""
    low, high = table[:, 0], table[:, 1]
    hidden = hidden_bias + ((values - low) / (high - low)) @ table[:, 2:]
    return float(bias + weights @ (1 / (1 + np.exp(-hidden))))


def difference_grade(index: float) -> float:
    """Objective difference grade of a distortion index: 0 imperceptible to -4 very annoying.

    Examples
    --------
    >>> round(difference_grade(0.0), 2)
    -1.88
    """
    return _ODG_MIN + (_ODG_MAX - _ODG_MIN) / (1 + math.exp(-index))
