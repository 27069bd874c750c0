"""Masking model: how strong a mark each bin of a frame can hide, the same at both ends.

In: power spectra of successive frames; out: amplitude of the mark's unit per bin. The receiver
derives it again from the marked and coded sound, so the model uses band powers only, no peaks and
no decisions. Source: spreading function of Schroeder, Atal and Hall (JASA 66, 1979), offset of
ITU-R BS.1387-2 annex 2 section 2.1.7; growth limit against pre-echo as in ISO/IEC 11172-3 annex D.
Specification: spec/audio-carrier.md, W23 to W28.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from watermark.audio.signal.profile import FS, HOP

BIN_HZ = FS / (2 * HOP)
"""Distance of two bins of the transform."""

BAND_BARK = 0.5
"""Width of a band on the Bark scale."""

MIN_BAND_BINS = 5
"""Width of the narrowest band."""

CAP = 10 ** (-0.6)
"""The threshold stays 6 dB below the power of its own band."""

GROWTH = 4.0
"""Largest growth of a threshold from frame to frame: what an attack masks, its pre-echo must not
exceed."""

COMPRESSION = 0.7
"""Exponent of threshold over spread power: loud bands mask relatively less than soft ones."""

REFERENCE = 10 ** (-8.0)
"""Power per bin at which compression is neutral."""

FLOOR = 10 ** (-9.4)
"""Band power per bin below which a 16 bit programme holds nothing but rounding: no mark there."""


def bark(frequency_hz: ArrayLike) -> NDArray[np.float64]:
    """Critical-band rate of Zwicker and Terhardt (JASA 68, 1980).

    Examples
    --------
    >>> float(bark(1000.0).round(2))
    8.51
    """
    f = np.asarray(frequency_hz, dtype=np.float64)
    return np.asarray(13 * np.arctan(0.00076 * f) + 3.5 * np.arctan((f / 7500) ** 2))


@lru_cache(maxsize=1)
def band_edges() -> NDArray[np.int64]:
    """First bin of each band, and `HOP` as the last entry."""
    z = bark(np.arange(HOP + 1) * BIN_HZ)
    edges = [0]
    while edges[-1] < HOP:
        beyond = int(np.searchsorted(z, z[edges[-1]] + BAND_BARK))
        edges.append(min(HOP, max(beyond, edges[-1] + MIN_BAND_BINS)))
    return np.array(edges, dtype=np.int64)


def spreading(edges: NDArray[np.int64]) -> NDArray[np.float64]:
    """Matrix from band powers to masking thresholds, shape (bands, bands), offset included."""
    z = bark((edges[:-1] + edges[1:]) / 2 * BIN_HZ)
    distance = z[np.newaxis, :] - z[:, np.newaxis] + 0.474
    level_db = 15.81 + 7.5 * distance - 17.5 * np.sqrt(1 + distance**2)
    gain = 10 ** (level_db / 10)
    offset = 10 ** (-np.maximum(3.0, 0.25 * z) / 10)
    return np.ascontiguousarray(gain / gain.sum(axis=0) * offset)


@dataclass(frozen=True, slots=True)
class Masker:
    """Thresholds of the bands below a limit.

    Attributes
    ----------
    edges : ndarray of int64, shape (bands + 1,)
        First bin of each band.
    matrix : ndarray of float64, shape (bands, bands)
        See `spreading`.
    floor : float
        Band power per bin below which a band is silent.
    """

    edges: NDArray[np.int64]
    matrix: NDArray[np.float64]
    floor: float = FLOOR

    def thresholds(self, power: NDArray[np.float64]) -> NDArray[np.float64]:
        """Masking threshold per band, each frame for itself.

        Parameters
        ----------
        power : ndarray of float64, shape (T, bins)
            Expected power of the MDCT coefficients; bins beyond the last band are ignored.

        Returns
        -------
        ndarray of float64, shape (T, bands)
            Power per bin that the mark's unit may have; zero where the band is silent.
        """
        widths = np.diff(self.edges)
        energy = np.add.reduceat(power[:, : self.edges[-1]], self.edges[:-1], axis=1) / widths
        return self.shaped(energy)

    def shaped(self, energy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Masking threshold per band by the powers per bin of the bands, shape (..., bands)."""
        spread = np.minimum(energy @ self.matrix, energy * CAP)
        compressed = REFERENCE * (spread / REFERENCE) ** COMPRESSION
        threshold = np.minimum(compressed, energy * CAP)
        threshold[energy < self.floor] = 0.0
        return np.asarray(threshold)

    def amplitudes(
        self, threshold: NDArray[np.float64], before: NDArray[np.float64], bins: int | None = None
    ) -> NDArray[np.float64]:
        """Amplitude of the mark's unit per bin.

        Parameters
        ----------
        threshold, before : ndarray of float64, shape (T, bands)
            Thresholds of the frames and of the frames one hop earlier.
        bins : int, optional
            Number of lowest bins wanted; default: all, ``edges[-1]``.

        Returns
        -------
        ndarray of float64, shape (T, bins)
        """
        count = len(self.edges) - 1 if bins is None else int(np.searchsorted(self.edges, bins))
        units = self.units(threshold[:, :count], before[:, :count])
        return np.repeat(units, np.diff(self.edges[: count + 1]), axis=1)[:, :bins]

    def units(
        self, threshold: NDArray[np.float64], before: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Amplitude of the mark's unit per band, shape (..., bands), see `amplitudes`."""
        # A band that was silent gives no limit: the floor's own power stands in for it.
        limited = np.minimum(threshold, GROWTH * np.maximum(before, self.floor * CAP))
        return np.asarray(np.sqrt(limited))


@lru_cache(maxsize=4)
def make_masker(bins: int = HOP, *, floor: float = FLOOR) -> Masker:
    """Return the model of the bands that begin below `bins`, silent below a floor."""
    edges = band_edges()
    count = int(np.searchsorted(edges, bins))
    return Masker(edges[: count + 1], np.ascontiguousarray(spreading(edges)[:count, :count]), floor)
