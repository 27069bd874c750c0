"""Other ways to code the parameters, for comparison: usual coders at low rates.

Each takes a training and a test motion (50 Hz) and a coarseness, and returns the rate in bit/s
and the decoded test parameters. Rates are ideal code lengths under static tables trained on the
training motion: without headers, checksums or terminations, to the baselines' advantage. Steps
of all parameters are equal in the markers' metric.

- *predictive* and *dct16*: the two modes of MPEG-4 face and body animation (ISO/IEC 14496-2) at
  25 Hz: differences of frames; cosines over 16 frames with predicted means, whose step is three
  times that of the others.
- *dpcm*: second-order prediction of decorrelated channels at 25 Hz.
- *wavelet*: bior4.4 to five levels of decorrelated channels at 50 Hz, over the whole motion.
- *raw*: eight bits per parameter at 25 Hz.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pywt
from numpy.typing import NDArray
from scipy.fft import dct, idct
from scipy.interpolate import CubicSpline

from codec.cuer.voice import Voice
from codec.superframe.transform import klt, marker_metric

Array = NDArray[np.float64]
Result = tuple[float, Array]

_LARGEST = 40
"""Least index coded by an escape."""

_SEGMENT = 16
"""Frames of a block of cosines (ISO/IEC 14496-2)."""

_HALF_HZ = 25.0
"""Frames per second of MPEG-4's modes."""

_EVERY = 97
"""Stride in frames of the metric; a prime, so that it falls on all phases of speech."""


@dataclass(frozen=True, slots=True)
class Material:
    """Input of a baseline: motions at 50 Hz in channels of the markers' metric.

    Attributes
    ----------
    train, test : ndarray of float64, shape (T, P)
        Parameters.
    plain, decorrelated : ndarray of float64, shape (P, P)
        Matrices from parameters to channels in millimetres: each scaled by itself, and KLT.
    """

    train: Array
    test: Array
    plain: Array
    decorrelated: Array

    @classmethod
    def of(cls, train: Array, test: Array, voice: Voice) -> "Material":
        """Return the material of two motions of a voice."""
        metric = marker_metric(voice, train[::_EVERY])
        plain = np.diag(np.sqrt(np.diag(metric)))
        return cls(train, test, plain, klt(metric, np.cov(train.T)))


def code_length(train: Sequence[Array], test: Sequence[Array]) -> float:
    """Return the bits of test indices, a static table per context trained on train indices."""
    bits = 0.0
    for known, new in zip(train, test, strict=True):
        clipped = np.clip(known, -_LARGEST, _LARGEST).astype(int) + _LARGEST
        counts = np.bincount(clipped.ravel(), minlength=2 * _LARGEST + 1) + 0.02
        cost = -np.log2(counts / counts.sum())
        wanted = np.clip(new, -_LARGEST, _LARGEST).astype(int) + _LARGEST
        over = np.abs(new[np.abs(new) >= _LARGEST]) - _LARGEST + 1
        bits += float(cost[wanted].sum() + (2 * np.floor(np.log2(over)) + 1).sum())
    return bits


def _upsampled(values: Array, length: int) -> Array:
    """Return channels at 25 Hz as `length` frames at 50 Hz."""
    course = CubicSpline(2 * np.arange(len(values)), values, axis=0)
    return np.asarray(course(np.minimum(np.arange(length), 2 * (len(values) - 1))))


def _predicted(channels: Array, step: float, taps: Sequence[float]) -> tuple[Array, Array]:
    """Return indices and decoded values of closed-loop prediction from past decoded frames."""
    indices, decoded = np.zeros_like(channels), np.zeros_like(channels)
    for t in range(len(channels)):
        guess = sum(
            (tap * decoded[t - 1 - i] for i, tap in enumerate(taps) if t > i),
            np.zeros(channels.shape[1]),
        )
        indices[t] = np.rint((channels[t] - guess) / step)
        decoded[t] = guess + step * indices[t]
    return indices, decoded


def _predictive(material: Material, step: float, matrix: Array, taps: Sequence[float]) -> Result:
    train = _predicted(material.train[::2] @ matrix, step, taps)[0]
    test, decoded = _predicted(material.test[::2] @ matrix, step, taps)
    bits = code_length(list(train.T), list(test.T))
    out = _upsampled(decoded @ np.linalg.inv(matrix), len(material.test))
    return bits * _HALF_HZ / len(test), out


def predictive(material: Material, step: float) -> Result:
    """Return the result of MPEG-4's predictive mode; `step` in millimetres."""
    return _predictive(material, step, material.plain, (1.0,))


def dpcm(material: Material, step: float) -> Result:
    """Return the result of second-order prediction of decorrelated channels."""
    return _predictive(material, step, material.decorrelated, (1.6, -0.64))


def dct16(material: Material, step: float) -> Result:
    """Return the result of MPEG-4's mode of 16-frame cosines."""

    def code(params: Array) -> tuple[Array, Array, int]:
        channels = (params @ material.plain)[::2]
        length = len(channels) // _SEGMENT * _SEGMENT
        blocks = channels[:length].reshape(-1, _SEGMENT, channels.shape[1])
        coefficients = dct(blocks, axis=1, norm="ortho")
        steps = np.full((_SEGMENT, 1), step)
        steps[0] = 3 * step
        indices = np.rint(coefficients / steps)
        decoded = idct(indices * steps, axis=1, norm="ortho").reshape(length, -1)
        indices[1:, 0] = np.diff(indices[:, 0], axis=0)
        return indices, decoded, length

    train, test = code(material.train)[0], code(material.test)
    size = test[0].shape[1] * test[0].shape[2]
    bits = code_length(list(train.reshape(-1, size).T), list(test[0].reshape(-1, size).T))
    out = _upsampled(test[1] @ np.linalg.inv(material.plain), 2 * test[2])
    return bits * _HALF_HZ / test[2], out


def wavelet(material: Material, step: float) -> Result:
    """Return the result of a wavelet transform of the whole motion."""

    def indices(params: Array) -> list[Array]:
        levels = pywt.wavedec(params @ material.decorrelated, "bior4.4", level=5, axis=0)
        return [np.sign(c) * np.floor(np.abs(c) / step + 0.4) for c in levels]

    train, test = indices(material.train), indices(material.test)
    bits = sum(code_length(list(a.T), list(b.T)) for a, b in zip(train, test, strict=True))
    channels = pywt.waverec([step * c for c in test], "bior4.4", axis=0)[: len(material.test)]
    return bits * 2 * _HALF_HZ / len(material.test), channels @ np.linalg.inv(material.decorrelated)


def raw(material: Material, _step: float) -> Result:
    """Return the result of eight bits per parameter over the range of the training."""
    low, high = material.train.min(axis=0), material.train.max(axis=0)
    index = np.rint(np.clip((material.test[::2] - low) / (high - low), 0, 1) * 255)
    decoded = low + index / 255 * (high - low)
    return 8 * material.test.shape[1] * _HALF_HZ, _upsampled(decoded, len(material.test))


BASELINES: dict[str, Callable[[Material, float], Result]] = {
    "mpeg4-predictive": predictive,
    "mpeg4-dct16": dct16,
    "dpcm": dpcm,
    "wavelet": wavelet,
    "raw-8bit": raw,
}
"""Baselines by the names of the evaluation's rows."""
