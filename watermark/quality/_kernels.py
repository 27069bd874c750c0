"""Compiled loops of the quality meter.

Contiguous float64 arrays in, arrays filled in place out. The states of one channel are
passed as one array `state` of shape (14, bands) whose rows are named by the constants below.
"""

import math

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit
from watermark.quality._math_kernels import exponential, logarithm, raised

# Rows of `state`; pairs are reference, test.
SMEARED = 0  # time-spread excitation
LEVEL = 2  # low-passed excitation, for level adaptation
PATTERN = 4  # low-passed pattern correction
RATIO = 6  # numerator and denominator of the pattern ratio
PREVIOUS = 8  # loudness of the frame before
CHANGE = 10  # low-passed change of loudness
MEAN = 12  # low-passed loudness

# Columns of `out` of `frames_into`.
NMR_MEAN, NMR_MAX, MOD_1, MOD_2, MOD_WEIGHT, NOISE_LOUDNESS = 0, 1, 2, 3, 4, 5

LOUDNESS_REF, LOUDNESS_TEST, BANDWIDTH_REF, BANDWIDTH_TEST = 6, 7, 8, 9
"""Columns of the features: loudness in sone, bandwidth in spectral lines."""

# Rows of `sums` of `count_frame`, for each channel: sums and their counts.
BANDWIDTH = 0  # reference, test, count
NMR = 3  # ratios, disturbed frames
EHS = 5
MODULATION = 7  # weighted 1, weighted 2, weight
WINDOW = 10  # roots of the last frames' modulation, the oldest first
WINDOW_FRAMES = 4
WINDOWED = 14
NOISE = 16
SUMS = 18

# Elements of `whole`, over all channels.
SMOOTH_DETECTION, LARGEST_DETECTION, DISTORTED, FRAMES = 0, 1, 2, 4
WHOLE_SUMS = 5

LOG_HALF = math.log(0.5)
"""Natural logarithm of a half."""

DECIBEL = 10.0 / math.log(10.0)
"""Decibels of a natural logarithm of power."""

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def group_into(
    power: FloatArray,
    first: IntArray,
    last: IntArray,
    first_share: FloatArray,
    last_share: FloatArray,
    out: FloatArray,
) -> None:
    """Sum bins of a power spectrum into bands."""
    for b in range(out.size):
        total = first_share[b] * power[first[b]] + last_share[b] * power[last[b]]
        for k in range(first[b] + 1, last[b]):
            total += power[k]
        out[b] = max(total, 1e-12)


@njit(cache=True, error_model="numpy")
def spread_into(
    bands: FloatArray,
    upper_slope: FloatArray,
    lower_gain: FloatArray,
    unit: FloatArray,
    out: FloatArray,
) -> None:
    """Spread energy over bands; slopes add up in the domain of the power 0.4."""
    n = bands.size
    width = 27.0 / (n - 1)  # of a band in Bark, see `ear.SPREAD_BARK`
    lower = 10.0 ** (-2.7 * width * 0.4)
    share, step = np.empty(n), np.empty(n)
    for b in range(n):
        out[b] = 0.0
        level = logarithm(bands[b])
        fall = upper_slope[b] + 0.2 * width * level
        step[b] = exponential(0.4 * fall)
        slope, beyond = step[b] * step[b] * math.sqrt(step[b]), (n - b) * fall
        # Below e**-40 the rest of the series is lost in rounding.
        rest = exponential(beyond)
        rest = rest if beyond > -40.0 else 0.0
        upper_gain = (1.0 - rest) / (1.0 - slope)
        share[b] = exponential(0.4 * (level - logarithm(lower_gain[b] + upper_gain - 1.0)))
    below = 0.0
    for b in range(n - 1, -1, -1):
        out[b] += below
        below = lower * (below + share[b])
    # All bands at once go up band by band: their products do not wait for each other.
    for distance in range(n):
        reached = out[distance:]
        for b in range(reached.size):
            reached[b] += share[b]
            share[b] *= step[b]
    for b in range(n):
        out[b] = out[b] * out[b] * math.sqrt(out[b]) / unit[b]


@njit(cache=True, error_model="numpy", inner=True)
def adapt_into(
    excitation: FloatArray,
    decay: FloatArray,
    below: int,
    above: int,
    state: FloatArray,
    out: FloatArray,
) -> None:
    """Level and pattern adaptation of both excitations, shape (2, bands).

    Corrections are averaged over `below` and `above` neighbouring bands.
    """
    n = decay.size
    cross, power = 0.0, 0.0
    for b in range(n):
        a = decay[b]
        for s in range(2):
            state[LEVEL + s, b] = a * state[LEVEL + s, b] + (1.0 - a) * excitation[s, b]
        cross += math.sqrt(state[LEVEL, b] * state[LEVEL + 1, b])
        power += state[LEVEL + 1, b]
    # Level: L = (sum of sqrt(ref * test) / sum of test)^2; the louder one of both is lowered.
    level = (cross / power) ** 2
    ratio = np.empty((2, n))
    for b in range(n):
        out[0, b] = excitation[0, b] / level if level > 1.0 else excitation[0, b]
        out[1, b] = excitation[1, b] if level > 1.0 else excitation[1, b] * level
        # Pattern: <test, ref> / <ref, ref> by running sums, at most 1 for either signal.
        state[RATIO, b] = decay[b] * state[RATIO, b] + out[0, b] * out[1, b]
        state[RATIO + 1, b] = decay[b] * state[RATIO + 1, b] + out[0, b] * out[0, b]
        r = state[RATIO, b] / state[RATIO + 1, b]
        ratio[0, b] = min(1.0, r)
        ratio[1, b] = min(1.0, 1.0 / r)
    for b in range(n):
        low, high = max(0, b - below), min(n - 1, b + above)
        for s in range(2):
            mean = 0.0
            for m in range(low, high + 1):
                mean += ratio[s, m]
            mean /= high - low + 1
            row = PATTERN + s
            state[row, b] = decay[b] * state[row, b] + (1.0 - decay[b]) * mean
            out[s, b] *= state[row, b]


@njit(cache=True, error_model="numpy", inner=True)
def modulation_into(
    excitation: FloatArray, decay: FloatArray, frame_rate: float, state: FloatArray, out: FloatArray
) -> None:
    """Modulation of the envelope in each band of both signals, shape (2, bands)."""
    for s in range(2):
        for b in range(decay.size):
            a = decay[b]
            loudness = raised(excitation[s, b], 0.3)
            change = frame_rate * abs(loudness - state[PREVIOUS + s, b])
            state[CHANGE + s, b] = a * state[CHANGE + s, b] + (1.0 - a) * change
            state[MEAN + s, b] = a * state[MEAN + s, b] + (1.0 - a) * loudness
            state[PREVIOUS + s, b] = loudness
            out[s, b] = state[CHANGE + s, b] / (1.0 + state[MEAN + s, b] / 0.3)


@njit(cache=True, error_model="numpy", inner=True)
def loudness(
    excitation: FloatArray, threshold: FloatArray, index: FloatArray, scale: FloatArray
) -> float:
    """Total loudness in sone of one excitation pattern; see `loudness_scale_into`."""
    total, root = 0.0, np.empty(threshold.size)
    for b in range(threshold.size):
        s = index[b]
        root[b] = raised(1.0 - s + s * excitation[b] / threshold[b], 0.23)
    for b in range(threshold.size):
        total += max(0.0, scale[b] * (root[b] - 1.0))
    return total * 24.0 / threshold.size


@njit(cache=True, error_model="numpy", inner=True)
def loudness_scale_into(
    threshold: FloatArray, index: FloatArray, unit: float, scale: FloatArray
) -> None:
    """Loudness of each band's unit; `unit` belongs to the ear model."""
    for b in range(threshold.size):
        scale[b] = unit * (threshold[b] / (index[b] * 1e4)) ** 0.23


@njit(cache=True, error_model="numpy", inner=True)
def noise_loudness(
    masker: FloatArray,
    heard: FloatArray,
    masker_modulation: FloatArray,
    heard_modulation: FloatArray,
    noise: FloatArray,
    alpha: float,
    factor: float,
    offset: float,
) -> float:
    """Partial loudness in sone of what one excitation has above another that masks it.

    alpha, factor, offset : how masking falls with the difference, grows with the modulation, and
    its value without any.
    """
    total, part = 0.0, np.empty(noise.size)
    for b in range(noise.size):
        s_masker = factor * masker_modulation[b] + offset
        s_heard = factor * heard_modulation[b] + offset
        extra = s_heard * heard[b] - s_masker * masker[b]
        beta = exponential(-alpha * (heard[b] - masker[b]) / masker[b])
        ratio = 1.0 + max(extra, 0.0) / (noise[b] + s_masker * masker[b] * beta)
        part[b] = raised(noise[b] / s_heard, 0.23) * (raised(ratio, 0.23) - 1.0)
    for b in range(noise.size):
        total += part[b]
    return max(0.0, total * 24.0 / noise.size)


@njit(cache=True, error_model="numpy", inner=True)
def modulation_difference(
    modulation: FloatArray, mean: FloatArray, quiet: FloatArray
) -> tuple[float, float, float]:
    """Plain and asymmetric difference of the modulations in percent, and the frame's weight.

    Bands weigh less the nearer they are to the loudness `quiet`, see `quiet_into`.
    """
    plain, asymmetric, weight = 0.0, 0.0, 0.0
    n = quiet.size
    for b in range(n):
        ref, test = modulation[0, b], modulation[1, b]
        difference = abs(ref - test)
        plain += difference / (1.0 + ref)
        asymmetric += (0.1 if ref > test else 1.0) * difference / (0.01 + ref)
        weight += mean[b] / (mean[b] + quiet[b])
    return 100.0 * plain / n, 100.0 * asymmetric / n, weight


@njit(cache=True, error_model="numpy", inner=True)
def quiet_into(noise: FloatArray, times: float, quiet: FloatArray) -> None:
    """Fill in multiples of the internal noise's loudness in each band."""
    for b in range(noise.size):
        quiet[b] = times * noise[b] ** 0.3


@njit(cache=True, error_model="numpy")
def bandwidths(ref: FloatArray, test: FloatArray) -> tuple[int, int]:
    """Bandwidths in bins, or (-1, -1) where the reference reaches no more than 8.1 kHz."""
    floor = 0.0
    for k in range(921, 1024):
        floor = max(floor, test[k])
    k = 921
    while k > 0 and ref[k - 1] < 10.0 * floor:
        k -= 1
    if k <= 346:
        return -1, -1
    width = k
    while k > 0 and test[k - 1] < 10.0**0.5 * floor:
        k -= 1
    return width, k


@njit(cache=True, error_model="numpy", inner=True)
def detection_into(excitation: FloatArray, probability: FloatArray, steps: FloatArray) -> None:
    """Detect a difference: probability per band, and its size in just noticeable steps."""
    for b in range(probability.size):
        ref = DECIBEL * logarithm(excitation[0, b])
        test = DECIBEL * logarithm(excitation[1, b])
        mix = 0.3 * max(ref, test) + 0.7 * test
        loud = max(mix, 1e-9)
        step = 5.95072 * raised(6.39468 / loud, 1.71332) - 0.198719
        step += mix * (0.0550197 + mix * (-0.00102438 + mix * (5.05622e-6 + mix * 9.01033e-11)))
        step = step if mix > 0.0 else 1e30
        difference = ref - test
        square = (difference / step) ** 2
        exponent = square * square if ref > test else square * square * square
        p = 1.0 - exponential(LOG_HALF * exponent)
        probability[b] = max(probability[b], p)
        steps[b] = max(steps[b], abs(np.trunc(difference)) / step)


@njit(cache=True, error_model="numpy")
def frames_into(
    power: FloatArray,
    outer_ear: FloatArray,
    first: IntArray,
    last: IntArray,
    first_share: FloatArray,
    last_share: FloatArray,
    bands: FloatArray,
    frame_rate: float,
    state: FloatArray,
    out: FloatArray,
    probability: FloatArray,
    steps: FloatArray,
) -> None:
    """Run consecutive frames of one channel through the model.

    power : (2, T, bins), reference then test; bands : the rows `noise, upper_slope, lower_gain,
    spread_unit, smear, adapt, loudness_threshold, loudness_index, mask_ratio` of shape (9, bands);
    out : (T, 10); probability, steps : (T, bands), raised to the largest over the channels.
    """
    noise, upper_slope, lower_gain, unit = bands[0], bands[1], bands[2], bands[3]
    smear, decay = bands[4], bands[5]
    n = noise.size
    bins = last[n - 1] + 1
    weighted = np.empty((3, bins))
    grouped = np.empty(n)
    disturbance = np.empty(n)
    spread = np.empty((2, n))
    excitation = np.empty((2, n))
    adapted = np.empty((2, n))
    modulation = np.empty((2, n))
    quiet, scale = np.empty(n), np.empty(n)
    quiet_into(noise, 100.0, quiet)
    loudness_scale_into(bands[6], bands[7], 1.07664, scale)
    for t in range(power.shape[1]):
        # Outer ear, grouping into bands, internal noise, spreading over bands, smearing over time
        # (BS.1387, the model with the Fourier transform).
        for s in range(2):
            for k in range(bins):
                weighted[s, k] = outer_ear[k] * power[s, t, k]
        for k in range(bins):
            weighted[2, k] = (math.sqrt(weighted[0, k]) - math.sqrt(weighted[1, k])) ** 2
        group_into(weighted[2], first, last, first_share, last_share, disturbance)
        for s in range(2):
            group_into(weighted[s], first, last, first_share, last_share, grouped)
            for b in range(n):
                grouped[b] += noise[b]
            spread_into(grouped, upper_slope, lower_gain, unit, spread[s])
            for b in range(n):
                row = SMEARED + s
                state[row, b] = smear[b] * state[row, b] + (1.0 - smear[b]) * spread[s, b]
                excitation[s, b] = max(state[row, b], spread[s, b])
        adapt_into(excitation, decay, 3, 4, state, adapted)
        modulation_into(spread, decay, frame_rate, state, modulation)

        mean, largest = 0.0, 0.0
        for b in range(n):
            ratio = disturbance[b] / (bands[8, b] * excitation[0, b])
            mean += ratio / n
            largest = max(largest, ratio)
        out[t, NMR_MEAN], out[t, NMR_MAX] = mean, largest
        plain, asymmetric, weight = modulation_difference(modulation, state[MEAN], quiet)
        out[t, MOD_1], out[t, MOD_2], out[t, MOD_WEIGHT] = plain, asymmetric, weight
        out[t, NOISE_LOUDNESS] = noise_loudness(
            adapted[0], adapted[1], modulation[0], modulation[1], noise, 1.5, 0.15, 0.5
        )
        out[t, LOUDNESS_REF] = loudness(excitation[0], bands[6], bands[7], scale)
        out[t, LOUDNESS_TEST] = loudness(excitation[1], bands[6], bands[7], scale)
        width_ref, width_test = bandwidths(power[0, t], power[1, t])
        out[t, BANDWIDTH_REF], out[t, BANDWIDTH_TEST] = width_ref, width_test
        detection_into(excitation, probability[t], steps[t])


@njit(cache=True, error_model="numpy")
def ratios_into(power: FloatArray, floor: float, out: FloatArray) -> None:
    """out[t, k] = logarithm of test over reference, both at least `floor`.

    power : (2, T, bins); the first and the last column of `out` are left as they are.
    """
    for t in range(out.shape[0]):
        ref, test, row = power[0, t], power[1, t], out[t]
        for k in range(1, row.size - 1):
            row[k] = logarithm(max(test[k], floor) / max(ref[k], floor))


@njit(cache=True, error_model="numpy")
def normalise_into(x: FloatArray, product: FloatArray, out: FloatArray) -> None:
    """Divide correlations of the first half of rows with the rows by both parts' root energies.

    x, product : (T, 2 lags), the correlations are in the first half; out : (T, lags), 1 where there
    is nothing.
    """
    lags = out.shape[1]
    squares = np.zeros(2 * lags)
    for t in range(out.shape[0]):
        for k in range(2 * lags - 1):
            squares[k + 1] = squares[k] + x[t, k] * x[t, k]
        older, newer, row, given = squares[:lags], squares[lags:], out[t], product[t]
        for k in range(lags):
            norm = math.sqrt(max((newer[k] - older[k]) * squares[lags], 0.0))
            row[k] = given[k] / norm if norm > 1e-20 else 1.0


@njit(cache=True, error_model="numpy")
def polyphase_into(
    history: FloatArray, taps: FloatArray, down: int, first: int, start: int, out: FloatArray
) -> None:
    """Resample: output m reads the input around sample m * down // up with phase m * down % up.

    history : (half + n, channels), whose row `half` is input sample `first`; taps : (up, 2 half).
    """
    up, width = taps.shape
    for i in range(out.shape[0]):
        position = (start + i) * down
        row = position // up - first + 1  # of the first tap: half + (n - half + 1) - first
        phase = position % up
        for c in range(out.shape[1]):
            total = 0.0
            for j in range(width):
                total += taps[phase, j] * history[row + j, c]
            out[i, c] = total


@njit(cache=True, error_model="numpy")
def count_frames(
    features: FloatArray,
    ehs: FloatArray,
    detection: FloatArray,
    steps: FloatArray,
    settled: NDArray[np.bool_],
    audible: NDArray[np.bool_],
    disturbed: float,
    sums: FloatArray,
    whole: FloatArray,
) -> None:
    """Add frames to the averages, see `watermark.quality.movs.MovAverages`."""
    for t in range(steps.size):
        for c in range(ehs.shape[1]):
            x = features[t, c]
            if x[BANDWIDTH_REF] >= 0:
                sums[BANDWIDTH, c] += x[BANDWIDTH_REF]
                sums[BANDWIDTH + 1, c] += x[BANDWIDTH_TEST]
                sums[BANDWIDTH + 2, c] += 1.0
            sums[NMR, c] += x[NMR_MEAN]
            if x[NMR_MAX] > disturbed:
                sums[NMR + 1, c] += 1.0
            if ehs[t, c] >= 0:
                sums[EHS, c] += ehs[t, c]
                sums[EHS + 1, c] += 1.0
            if settled[t]:
                sums[MODULATION, c] += x[MOD_WEIGHT] * x[MOD_1]
                sums[MODULATION + 1, c] += x[MOD_WEIGHT] * x[MOD_2]
                sums[MODULATION + 2, c] += x[MOD_WEIGHT]
                mean = 0.0
                for n in range(WINDOW_FRAMES - 1):
                    sums[WINDOW + n, c] = sums[WINDOW + n + 1, c]
                    mean += sums[WINDOW + n, c]
                sums[WINDOW + WINDOW_FRAMES - 1, c] = math.sqrt(x[MOD_1])
                mean = (mean + math.sqrt(x[MOD_1])) / WINDOW_FRAMES
                if not math.isnan(mean):
                    # Fourth power of the mean root over a window of frames.
                    sums[WINDOWED, c] += mean**4
                    sums[WINDOWED + 1, c] += 1.0
            if settled[t] and audible[t]:
                sums[NOISE, c] += x[NOISE_LOUDNESS] ** 2
                sums[NOISE + 1, c] += 1.0
        whole[SMOOTH_DETECTION] = 0.9 * whole[SMOOTH_DETECTION] + 0.1 * detection[t]
        whole[LARGEST_DETECTION] = max(whole[LARGEST_DETECTION], whole[SMOOTH_DETECTION])
        if detection[t] > 0.5:
            whole[DISTORTED] += steps[t]
            whole[DISTORTED + 1] += 1.0
        whole[FRAMES] += 1.0
