"""Tables of the FFT-based ear model: bands, weights, spreading, time constants.

Everything here follows from a handful of formulas of ITU-R BS.1387-1, Annex 2, sections 2 to 4
(see also P. Kabal, "An Examination and Interpretation of ITU-R BS.1387", McGill University, 2002).
The band edges come from the formula: the Recommendation's printed table has misprints.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from watermark.quality import _kernels

FS = 48_000
"""Rate in Hz that the Recommendation demands."""

FRAME = 2048
"""Samples of a frame."""

HOP = FRAME // 2
"""Samples between the starts of frames."""

FRAME_RATE = FS / HOP

BINS = FRAME // 2 + 1
"""Spectral lines of a frame."""

BANDS = 109
"""Bands of the basic version, a quarter of a Bark each."""

WIDE_BANDS = 55
"""Bands of the advanced version's spectral part, half a Bark each."""

SPREAD_BARK = 27.0
"""Width of all bands but one in Bark: gives the width of a band from their number."""

FULL_SCALE_DB = 92.0  # sound pressure level of a sine at full scale
REFERENCE_SINE_HZ = 1019.5  # of that sine: it falls between two bins

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EarTables:
    """Constants of the ear model.

    Attributes
    ----------
    window : ndarray, shape (2048,)
        Hann window times the playback level; input in full scales, squares in sound pressure.
    outer_ear : ndarray, shape (1025,)
        Power response of the outer and middle ear per bin.
    first, last : ndarray of int64, shape (bands,)
        Bins that hold the lower and upper edge of each band.
    first_share, last_share : ndarray, shape (bands,)
        Parts of those two bins that belong to the band.
    bands : ndarray, shape (9, bands)
        Per band: internal noise; natural logarithm of the level-independent part of the upper slope
        of spreading; sum of its lower slope; its response to a flat unit; decay per frame of time
        spreading (30 ms at 100 Hz) and of adaptation (50 ms at 100 Hz); excitation at the threshold
        and threshold index of the loudness formula; masking threshold divided by excitation.
    """

    window: FloatArray
    outer_ear: FloatArray
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    first_share: FloatArray
    last_share: FloatArray
    bands: FloatArray


def band_edges(bands: int = BANDS) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lower edge, centre and upper edge of the bands in Hz.

    Examples
    --------
    >>> low, centre, high = band_edges()
    >>> [round(float(x[0]), 3) for x in (low, centre, high)]
    [80.0, 91.708, 103.445]
    """
    width = SPREAD_BARK / (bands - 1)
    bark = 7 * np.arcsinh(80 / 650) + width * np.arange(bands)
    top = 7 * np.arcsinh(18_000 / 650)
    high_bark = np.minimum(bark + width, top)
    low, centre, high = (650 * np.sinh(z / 7) for z in (bark, (bark + high_bark) / 2, high_bark))
    return low, centre, high


def decay(
    centre_hz: FloatArray,
    at_100_hz_s: float,
    *,
    least_s: float = 0.008,
    frame_rate: float = FRAME_RATE,
) -> FloatArray:
    """Decay per frame of a one-pole filter: `at_100_hz_s` at 100 Hz, towards `least_s` above."""
    tau_s = least_s + (100 / centre_hz) * (at_100_hz_s - least_s)
    return np.exp(-1 / (frame_rate * tau_s))


def internal_noise(centre_hz: FloatArray) -> FloatArray:
    """Noise of the ear itself in each band."""
    return np.power(10.0, 0.1456 * (centre_hz / 1000) ** -0.8)


def loudness_rows(centre_hz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Excitation at the threshold and threshold index of the loudness formula."""
    khz = centre_hz / 1000
    index_db = -2 - 2.05 * np.arctan(khz / 4) - 0.75 * np.arctan((khz / 1.6) ** 2)
    return np.power(10.0, 0.364 * khz**-0.8), np.power(10.0, 0.1 * index_db)


def ear_response_db(khz: FloatArray) -> FloatArray:
    """Response of the outer and middle ear."""
    return -2.184 * khz**-0.8 + 6.5 * np.exp(-0.6 * (khz - 3.3) ** 2) - 0.001 * khz**3.6


@cache
def ear_tables(bands: int = BANDS) -> EarTables:
    """Compute the tables for 109 or 55 bands (once per process)."""
    low, centre, high = band_edges(bands)
    width = SPREAD_BARK / (bands - 1)
    # Slopes of the spreading function (BS.1387) in dB per Bark: 27 downwards, 24 + 230 / f upwards,
    # which the kernels lessen with level.
    upper_slope = np.log(10) * (-2.4 - 23 / centre) * width
    band = np.arange(bands)
    lower_gain = np.cumsum(np.power(10.0 ** (-2.7 * width), band.astype(np.float64)))
    # Masking offset: 3 dB up to 12 Bark, then a quarter of the distance.
    mask_db = np.where(band * width <= 12, 3.0, 0.25 * band * width)
    rows = np.stack(
        [
            internal_noise(centre),
            upper_slope,
            lower_gain,
            _spread_unit(upper_slope, lower_gain),
            decay(centre, 0.030),
            decay(centre, 0.050),
            *loudness_rows(centre),
            10 ** (-mask_db / 10),
        ]
    )
    window = np.multiply(_level() / 2, 1 - np.cos(2 * np.pi * np.arange(FRAME) / (FRAME - 1)))
    return EarTables(window, _outer_ear(), *_band_bins(low, high), rows)


def _level() -> float:
    """Scale the spectrum so that a full-scale sine reads `FULL_SCALE_DB` at its highest bin."""
    position = REFERENCE_SINE_HZ / FS * FRAME
    offset = min(position % 1, 1 - position % 1) * (FRAME - 1) / FRAME
    peak = np.sin(np.pi * offset) / (np.pi * offset * (1 - offset**2))
    return float(10 ** (FULL_SCALE_DB / 20) / (peak / 4 * (FRAME - 1)))


def _outer_ear() -> FloatArray:
    khz = np.arange(1, BINS, dtype=np.float64) * (FS / FRAME / 1000)
    return np.concatenate([[0.0], 10 ** (ear_response_db(khz) / 10)])


def _band_bins(
    low: FloatArray, high: FloatArray
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray, FloatArray]:
    """Bins at both edges of each band and the share of each that lies inside."""
    lo, hi = low * FRAME / FS, high * FRAME / FS
    first = np.floor(lo + 0.5).astype(np.int64)
    last = np.ceil(hi - 0.5).astype(np.int64)
    first_share = np.minimum(hi, first + 0.5) - lo
    last_share = np.where(first == last, 0.0, hi - (last - 0.5))
    return first, last, first_share, last_share


def _spread_unit(upper_slope: FloatArray, lower_gain: FloatArray) -> FloatArray:
    """Spread a flat pattern of ones: the normalisation of spreading."""
    out, ones = np.empty(upper_slope.size), np.ones(upper_slope.size)
    _kernels.spread_into(ones, upper_slope, lower_gain, ones, out)
    return out
