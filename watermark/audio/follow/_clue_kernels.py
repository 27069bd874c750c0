"""Compiled loops of the clues to how far cells can be trusted.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True)
def bin_powers(
    spectra: NDArray[np.complex64],
    edges: NDArray[np.int64],
    power: NDArray[np.float32],
    energy: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Compute the expected power of each bin, its mean in each band, and its sum in each frame."""
    half = np.float32(0.5)
    for t in range(power.shape[0]):
        total[t] = 0.0
        row, out = spectra[t], power[t]
        for k in range(out.size):
            out[k] = half * (row[k].real * row[k].real + row[k].imag * row[k].imag)
        for b in range(edges.size - 1):
            band = np.float32(0.0)
            for k in range(edges[b], edges[b + 1]):
                band += out[k]
            energy[t, b] = band / (edges[b + 1] - edges[b])
            total[t] += band


@njit(cache=True)
def cell_means(
    amplitudes: NDArray[np.float32],
    noise: NDArray[np.float64],
    edges: NDArray[np.int64],
    first: int,
    bins: int,
    means: NDArray[np.float64],
) -> None:
    """means[0, t, g] = mean unit of cell g's bins, 1e-7 at least; means[2, t, g] = mean noise.

    Cells begin at bin `first`; noise is given by bands.
    """
    band = np.empty(edges[edges.size - 1], dtype=np.int64)
    for b in range(edges.size - 1):
        for k in range(edges[b], edges[b + 1]):
            band[k] = b
    for t in range(means.shape[1]):
        for g in range(means.shape[2]):
            unit, near = np.float32(0.0), 0.0
            for k in range(first + g * bins, first + (g + 1) * bins):
                unit += amplitudes[t, k]
                near += noise[t, band[k]]
            unit /= np.float32(bins)
            means[0, t, g] = unit if unit > 1e-7 else 1e-7
            means[2, t, g] = near / bins


@njit(cache=True)
def centre_clues(clues: NDArray[np.float64], limit: float) -> None:
    """Take each cell's mean over the frames from its clues, and keep them within a limit."""
    mean = np.empty(clues.shape[2])
    for n in range(clues.shape[0]):
        mean[:] = 0.0
        for t in range(clues.shape[1]):
            for g in range(mean.size):
                mean[g] += clues[n, t, g]
        for t in range(clues.shape[1]):
            for g in range(mean.size):
                value = clues[n, t, g] - mean[g] / clues.shape[1]
                clues[n, t, g] = min(max(value, -limit), limit)


@njit(cache=True)
def look_up_cells(
    errors: NDArray[np.float64],
    alive: NDArray[np.bool_],
    unknown: NDArray[np.float64],
    untouched: NDArray[np.float64],
    own: NDArray[np.float64],
    zero: NDArray[np.float64],
    one: NDArray[np.float64],
) -> None:
    """Look up what tables of each cell say at its error, in steps.

    The tables, shape (groups, points), are over one step. Of cells that are not alive own is 0 and
    the densities of either bit are 1.
    """
    points = unknown.shape[1]
    for t in range(errors.shape[0]):
        for g in range(errors.shape[1]):
            own[t, g], zero[t, g], one[t, g] = 0.0, 1.0, 1.0
            if alive[t, g]:
                # Rounded to even, as numpy does.
                at = int(np.rint(errors[t, g] * points)) % points
                beside = int(np.rint((errors[t, g] - 0.5) * points)) % points
                own[t, g] = unknown[g, at]
                zero[t, g], one[t, g] = untouched[g, at], untouched[g, beside]
