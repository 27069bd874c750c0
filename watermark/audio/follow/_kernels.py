"""Compiled loops of following: a superframe's view, and how known cells fit in it.

Contiguous arrays in, arrays filled in place out; no checks.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from watermark.audio.signal._kernels import cosine_of_turns


@njit(cache=True)
def cut_frames(sound: NDArray[Any], starts: NDArray[np.int64], frames: NDArray[np.float32]) -> bool:
    """frames[t] = sound from starts[t] on; return whether that is not silence."""
    first = 0
    while first < sound.size and sound[first] == 0:
        first += 1
    if first == sound.size:
        return False
    for t in range(frames.shape[0]):
        frame, own = frames[t], sound[starts[t] :]
        for i in range(frame.size):
            frame[i] = own[i]
    return True


@njit(cache=True, fastmath={"contract"})
def lap_bins(
    plain: NDArray[np.complex64],
    own: NDArray[np.complex64],
    following: NDArray[np.complex64],
    spectra: NDArray[np.complex64],
) -> None:
    """spectra[t, k] = plain[t, k] own[k] + plain[t, k + 1] following[k]."""
    for t in range(spectra.shape[0]):
        row, beyond, out = plain[t], plain[t, 1:], spectra[t]
        for k in range(out.size):
            a, b, c, d = row[k], own[k], beyond[k], following[k]
            real = (a.real * b.real - a.imag * b.imag) + (c.real * d.real - c.imag * d.imag)
            imaginary = (a.real * b.imag + a.imag * b.real) + (c.real * d.imag + c.imag * d.real)
            out[k] = complex(real, imaginary)


@njit(cache=True, fastmath={"contract"})
def turn_bins(
    spectra: NDArray[np.complex64], delays: NDArray[np.float64], pace: float, bins: int
) -> None:
    """Turn bin k of frame t by delays[t] (k + 1/2) pace radians, in place, for k below `bins`."""
    turn = np.empty(bins + 3, dtype=np.complex64)
    for t in range(spectra.shape[0]):
        # Four bins' turns go on side by side: each product waits for the one before.
        on = np.exp(4j * pace * delays[t])
        first, second = np.exp(0.5j * pace * delays[t]), np.exp(1.5j * pace * delays[t])
        third, fourth = np.exp(2.5j * pace * delays[t]), np.exp(3.5j * pace * delays[t])
        for k in range(0, bins, 4):
            turn[k], turn[k + 1], turn[k + 2], turn[k + 3] = first, second, third, fourth
            first, second, third, fourth = first * on, second * on, third * on, fourth * on
        row = spectra[t]
        for k in range(bins):
            row[k] *= turn[k]


@njit(cache=True, fastmath={"reassoc", "contract"})
def band_energies(
    mid: NDArray[np.complex64],
    side: NDArray[np.complex64],
    edges: NDArray[np.int64],
    energies: NDArray[np.float64],
) -> None:
    """energies[c, t, b] = mean expected power of mid, left, right in a band; of mid without side.

    |M +- S|^2 = |M|^2 + |S|^2 +- 2 Re(M S*).
    """
    for t in range(mid.shape[0]):
        for b in range(edges.size - 1):
            middle, other, cross = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            for k in range(edges[b], edges[b + 1]):
                m = mid[t, k]
                middle += m.real * m.real + m.imag * m.imag
                if side.size:
                    s = side[t, k]
                    other += s.real * s.real + s.imag * s.imag
                    cross += m.real * s.real + m.imag * s.imag
            width = edges[b + 1] - edges[b]
            energies[0, t, b] = 0.5 * middle / width
            if side.size:
                both = 0.5 * (middle + other)
                energies[1, t, b] = max(both + cross, 0.0) / width
                energies[2, t, b] = max(both - cross, 0.0) / width


@njit(cache=True)
def choose_bins(
    mid: NDArray[np.complex64],
    side: NDArray[np.complex64],
    units: NDArray[np.float64],
    edges: NDArray[np.int64],
    places: NDArray[np.int64],
    spectra: NDArray[np.complex64],
    amplitudes: NDArray[np.float32],
) -> None:
    """Fill spectra and amplitudes (64, bins) from mid, left or right as places say.

    units (channels, 64, bands) are the amplitudes of each channel.
    """
    for t in range(places.shape[0]):
        for b in range(edges.size - 1):
            for k in range(edges[b], edges[b + 1]):
                place, m = places[t, k], mid[t, k]
                if place == 1:
                    m += side[t, k]
                elif place == 2:
                    m -= side[t, k]
                spectra[t, k] = m
                amplitudes[t, k] = units[place, t, b]


@njit(cache=True, fastmath={"contract"})
def project_cells(
    spectra: NDArray[np.complex64],
    amplitudes: NDArray[np.float32],
    signs: NDArray[np.float64],
    first: int,
    projections: NDArray[np.float64],
    alive: NDArray[np.bool_],
) -> None:
    """projections[t, g] = projection of cell g in frame t, 0 where a bin of it is silent.

    It is the sum of sign * coefficient / unit over the cell's bins, by the root of their number.
    Cells begin at bin `first`.
    """
    bins = signs.size // projections.shape[1]
    root = np.sqrt(bins)
    for t in range(projections.shape[0]):
        for g in range(projections.shape[1]):
            total, living = 0.0, True
            for i in range(g * bins, (g + 1) * bins):
                unit = amplitudes[t, first + i]
                if unit > 0:
                    total += spectra[t, first + i].real * signs[i] / unit
                else:
                    living = False
            alive[t, g], projections[t, g] = living, total / root if living else 0.0


@njit(cache=True, fastmath={"reassoc", "contract"})
def fit_scores(
    spectra: NDArray[np.complex64],
    amplitudes: NDArray[np.float32],
    signs: NDArray[np.float64],
    expected: NDArray[np.float64],
    dither: NDArray[np.float64],
    angle: NDArray[np.float64],
    bend: NDArray[np.float64],
    turn: NDArray[np.complex128],
    scale: float,
    score: NDArray[np.float64],
) -> None:
    """score[d] += sum over frames t and cells g of expected[t, g] times their soft value.

    A cell's phase is `scale` times the real part of the sum over its bins b of
    spectra[t, b] signs[b] / amplitudes[t, b] turn[b, d], turned by angle[t] + b bend[t], less
    dither[g]. Cells without an expectation, or with a silent bin, are left out.
    """
    bins = turn.shape[0] // dither.size
    phase = np.empty(score.size)
    for t in range(expected.shape[0]):
        now, on = scale * np.exp(1j * angle[t]), np.exp(1j * bend[t])
        for g in range(dither.size):
            weight = expected[t, g]
            phase[:] = -dither[g]
            for b in range(g * bins, (g + 1) * bins):
                if amplitudes[t, b] <= 0:
                    weight = 0.0
                if weight != 0:
                    term, row = spectra[t, b] * now * (signs[b] / amplitudes[t, b]), turn[b]
                    for d in range(score.size):
                        phase[d] += term.real * row[d].real - term.imag * row[d].imag
                now *= on
            if weight != 0:
                for d in range(score.size):
                    score[d] += weight * cosine_of_turns(phase[d])


@njit(cache=True, fastmath={"contract"})
def project_phases(
    spectra: NDArray[np.complex64],
    amplitudes: NDArray[np.float32],
    signs: NDArray[np.float64],
    first: int,
    scale: float,
    projections: NDArray[np.complex128],
) -> None:
    """projections[t, g] = `scale` times the complex projection of cell g in frame t.

    It is not a number where a bin of the cell is silent; cells begin at bin `first`.
    """
    bins = signs.size // projections.shape[1]
    for t in range(projections.shape[0]):
        for g in range(projections.shape[1]):
            real, imaginary, living = 0.0, 0.0, True
            for i in range(g * bins, (g + 1) * bins):
                unit, value = amplitudes[t, first + i], spectra[t, first + i]
                if unit > 0:
                    real += value.real * signs[i] / unit
                    imaginary += value.imag * signs[i] / unit
                else:
                    living = False
            if not living:
                real = np.nan
            projections[t, g] = complex(scale * real, scale * imaginary)


@njit(cache=True, fastmath={"reassoc", "contract"})
def phase_scores(
    projections: NDArray[np.complex128],
    weight: NDArray[np.float64],
    dither: NDArray[np.float64],
    band: NDArray[np.int64],
    harmonic: int,
    turns: NDArray[np.complex128],
    table: NDArray[np.float64],
) -> None:
    """table[band[g], i] += sum over t, g of weight[t, g] times the soft value after turn i.

    Cells whose projection is not a number are left out.
    """
    for t in range(weight.shape[0]):
        for g in range(dither.size):
            own = projections[t, g]
            if weight[t, g] != 0 and not np.isnan(own.real):
                for i in range(turns.size):
                    part = own.real * turns[i].real - own.imag * turns[i].imag
                    value = cosine_of_turns(harmonic * (part - dither[g]))
                    table[band[g], i] += weight[t, g] * value


@njit(cache=True, fastmath={"reassoc", "contract"})
def agreements(
    projections: NDArray[np.float64],
    alive: NDArray[np.bool_],
    dither: NDArray[np.float64],
    scales: NDArray[np.float64],
    expected: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """sums[i] = sum over t, g of expected[t, g] times the soft value at scales[i].

    See `watermark.audio.signal._kernels.soft_cells`.
    """
    for i in range(scales.size):
        total, scale = 0.0, scales[i]
        for t in range(expected.shape[0]):
            for g in range(dither.size):
                value = cosine_of_turns(projections[t, g] * scale - dither[g])
                total += expected[t, g] * value if alive[t, g] else 0.0
        sums[i] = total
