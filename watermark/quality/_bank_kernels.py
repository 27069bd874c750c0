"""Compiled loops of the advanced version of the quality meter.

Conventions as in `_kernels`; `state` has the rows that are named there.
"""

import math

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from watermark.quality._kernels import (
    MEAN,
    SMEARED,
    adapt_into,
    group_into,
    loudness,
    loudness_scale_into,
    modulation_difference,
    modulation_into,
    noise_loudness,
    quiet_into,
    spread_into,
)

# Columns of `out` of `bank_frames_into`.
MOD, WEIGHT, NOISE, MISSING, LINEAR, LOUDNESS_REF, LOUDNESS_TEST = 0, 1, 2, 3, 4, 5, 6
COLUMNS = 7

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]


@njit(cache=True)
def filter_into(sound: FloatArray, taps: FloatArray, step: int, out: FloatArray) -> None:
    """Weigh the samples from every `step`-th on by each column of taps, the earliest first.

    A product of matrices does the same, but its last digits depend on how many rows it has, on some
    processors, and so on where a stream was cut.

    sound : (>= (T - 1) * step + samples,); taps : (samples, columns); out : (T, columns).
    """
    for t in range(out.shape[0]):
        row = out[t]
        row[:] = 0.0
        for n in range(taps.shape[0]):
            sample = sound[t * step + n]
            for c in range(taps.shape[1]):
                row[c] += sample * taps[n, c]


@njit(cache=True)
def spread_amplitudes_into(
    bands: ComplexArray,
    slope_db: FloatArray,
    step_db: float,
    new_slope: float,
    slopes: FloatArray,
    out: FloatArray,
) -> None:
    """Spread the filters' outputs over the bands and rectify them: energies.

    slopes : (bands,), smoothed factors from band to band above each band, updated.
    """
    n = bands.size
    spread = bands.copy()
    for b in range(n):
        power = bands[b].real ** 2 + bands[b].imag ** 2
        level = 10.0 * math.log10(max(power, 1e-30))
        slope = math.exp(step_db * max(4.0, slope_db[b] - 0.2 * level))
        slopes[b] += new_slope * (slope - slopes[b])
        share = bands[b]
        for m in range(b + 1, n):
            share = share * slopes[b]
            spread[m] += share
    lower = math.exp(31.0 * step_db)
    for b in range(n - 1, 0, -1):
        spread[b - 1] += lower * spread[b]
    for b in range(n):
        out[b] = spread[b].real ** 2 + spread[b].imag ** 2


@njit(cache=True)
def bank_frames_into(
    filtered: ComplexArray,
    rows: FloatArray,
    backward: FloatArray,
    step_db: float,
    new_slope: float,
    frame_rate: float,
    slopes: FloatArray,
    history: FloatArray,
    state: FloatArray,
    out: FloatArray,
) -> None:
    """Run consecutive frames of one channel through the filter bank's model.

    filtered : (2, T * steps, bands), reference then test; rows : see `bank.BankTables`; slopes :
    (2, bands); history : (2, 11, bands), energies that backward masking reaches, the oldest first,
    the first ones from before; out : (T, 7).
    """
    noise, slope_db, smear, decay = rows[0], rows[1], rows[2], rows[3]
    n, width, frames = noise.size, backward.size, out.shape[0]
    steps = filtered.shape[1] // frames
    fresh = np.empty((2, n))
    adapted, modulation = np.empty((2, n)), np.empty((2, n))
    excitation = state[SMEARED : SMEARED + 2]
    quiet, scale = np.empty(n), np.empty(n)
    quiet_into(noise, 1.0, quiet)
    loudness_scale_into(rows[4], rows[5], 1.26539, scale)
    for t in range(frames):
        for s in range(2):
            for q in range(steps):
                spread_amplitudes_into(
                    filtered[s, t * steps + q],
                    slope_db,
                    step_db,
                    new_slope,
                    slopes[s],
                    history[s, width - steps + q],
                )
            for b in range(n):
                total = noise[b]
                # Backward masking by weights over the last samples, forward masking by a decay in
                # each band.
                for q in range(width):
                    total += backward[q] * history[s, q, b]
                fresh[s, b] = total
                excitation[s, b] = smear[b] * excitation[s, b] + (1.0 - smear[b]) * total
            for q in range(width - steps):
                history[s, q] = history[s, q + steps]
        adapt_into(excitation, decay, 1, 1, state, adapted)
        modulation_into(fresh, decay, frame_rate, state, modulation)
        plain, _, weight = modulation_difference(modulation, state[MEAN], quiet)
        out[t, MOD], out[t, WEIGHT] = math.sqrt(n) * plain, weight
        ref, test = modulation[0], modulation[1]
        added = noise_loudness(adapted[0], adapted[1], ref, test, noise, 2.5, 0.3, 1.0)
        out[t, NOISE] = added if added >= 0.1 else 0.0
        out[t, MISSING] = noise_loudness(adapted[1], adapted[0], test, ref, noise, 1.5, 0.15, 1.0)
        out[t, LINEAR] = noise_loudness(adapted[0], excitation[0], ref, ref, noise, 1.5, 0.15, 1.0)
        out[t, LOUDNESS_REF] = loudness(excitation[0], rows[4], rows[5], scale)
        out[t, LOUDNESS_TEST] = loudness(excitation[1], rows[4], rows[5], scale)


@njit(cache=True)
def noise_to_mask_into(
    power: FloatArray,
    outer_ear: FloatArray,
    first: IntArray,
    last: IntArray,
    first_share: FloatArray,
    last_share: FloatArray,
    bands: FloatArray,
    smeared: FloatArray,
    out: FloatArray,
) -> None:
    """Noise-to-mask ratio in dB of consecutive frames of one channel.

    Arguments as of `_kernels.frames_into`; smeared : (bands,), time-spread excitation of the
    reference, updated; out : (T,).
    """
    n = smeared.size
    weighted = np.empty(outer_ear.size)
    error = np.empty(outer_ear.size)
    grouped, disturbance, spread = np.empty(n), np.empty(n), np.empty(n)
    for t in range(out.size):
        for k in range(outer_ear.size):
            weighted[k] = outer_ear[k] * power[0, t, k]
            test = outer_ear[k] * power[1, t, k]
            error[k] = (math.sqrt(weighted[k]) - math.sqrt(test)) ** 2
        group_into(error, first, last, first_share, last_share, disturbance)
        group_into(weighted, first, last, first_share, last_share, grouped)
        for b in range(n):
            grouped[b] += bands[0, b]
        spread_into(grouped, bands[1], bands[2], bands[3], spread)
        mean = 0.0
        for b in range(n):
            smeared[b] = bands[4, b] * smeared[b] + (1.0 - bands[4, b]) * spread[b]
            mean += disturbance[b] / (bands[8, b] * max(smeared[b], spread[b])) / n
        out[t] = 10.0 * math.log10(mean)
