"""Compiled loops of the audio carrier.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True, fastmath={"reassoc", "contract"})
def fit_scores(
    terms: NDArray[np.complex128],
    expected: NDArray[np.float64],
    dither: NDArray[np.float64],
    angle: NDArray[np.float64],
    bend: NDArray[np.float64],
    turn: NDArray[np.complex128],
    score: NDArray[np.float64],
) -> None:
    """score[d] += sum over frames t and cells g of expected[t, g] times their soft value.

    A cell's phase is the real part of the sum over its bins b of terms[t, b] turn[b, d], turned by
    angle[t] + b bend[t], less dither[g]. Cells without an expectation are left out.
    """
    bins = turn.shape[0] // dither.size
    phase = np.empty(score.size)
    for t in range(expected.shape[0]):
        now, on = np.exp(1j * angle[t]), np.exp(1j * bend[t])
        for g in range(dither.size):
            weight = expected[t, g]
            phase[:] = -dither[g]
            for b in range(g * bins, (g + 1) * bins):
                if weight:
                    term, row = terms[t, b] * now, turn[b]
                    for d in range(score.size):
                        phase[d] += term.real * row[d].real - term.imag * row[d].imag
                now *= on
            if weight:
                for d in range(score.size):
                    score[d] += weight * np.cos(2 * np.pi * phase[d])
