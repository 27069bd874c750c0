"""Compiled loops of the speech part: best paths and overlap-add."""

import math

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True)
def voicing_path(
    lag: NDArray[np.float64],
    strength: NDArray[np.float64],
    unvoiced: NDArray[np.float64],
    octave_jump_cost: float,
    voicing_cost: float,
    path: NDArray[np.int64],
) -> None:
    """Best path through pitch candidates (Boersma 1993, section 4).

    lag, strength : (T, C), candidate lags in samples (0: no candidate) and strengths;
    unvoiced : (T,), strength of the candidate that the frame has no pitch;
    path : (T,), out: candidate of each frame, C for unvoiced.
    """
    frames, candidates = lag.shape
    states = candidates + 1
    score = np.full((frames, states), -np.inf)
    back = np.zeros((frames, states), dtype=np.int64)
    for t in range(frames):
        for j in range(states):
            if j < candidates and lag[t, j] <= 0.0:
                continue
            own = strength[t, j] if j < candidates else unvoiced[t]
            if t == 0:
                score[t, j] = own
                continue
            # score[t, j] = own[t, j] + max over i of (score[t - 1, i] - cost of going from i to j)
            best = -np.inf
            for i in range(states):
                if score[t - 1, i] == -np.inf:
                    continue
                if (i == candidates) != (j == candidates):
                    cost = voicing_cost
                elif j == candidates:
                    cost = 0.0
                else:
                    cost = octave_jump_cost * abs(math.log2(lag[t, j] / lag[t - 1, i]))
                value = score[t - 1, i] - cost
                if value > best:
                    best = value
                    back[t, j] = i
            score[t, j] = best + own
    state = int(np.argmax(score[frames - 1]))
    for t in range(frames - 1, -1, -1):
        path[t] = state
        state = back[t, state]


@njit(cache=True)
def epoch_path(
    position: NDArray[np.int64],
    height: NDArray[np.float64],
    period: NDArray[np.float64],
    deviation_cost: float,
    break_cost: float,
    chosen: NDArray[np.bool_],
) -> None:
    """Choose one peak per pitch period out of candidate peaks of one voiced stretch.

    position : (N,), samples, ascending; height : (N,), 0..1; period : (N,), samples at the peak.
    A step from peak i to peak j costs the squared logarithm of its length over the period; one of
    more than 1.8 periods, where peaks are missing, has a fixed cost.
    """
    n = position.size
    score = np.full(n, -np.inf)
    back = np.full(n, -1, dtype=np.int64)
    leader = np.zeros(n, dtype=np.int64)
    for j in range(n):
        if position[j] - position[0] <= 1.3 * period[j]:
            score[j] = height[j]
        for i in range(j - 1, -1, -1):
            step = float(position[j] - position[i])
            local = 0.5 * (period[i] + period[j])
            if step > 1.8 * local:
                value = score[leader[i]] + height[j] - break_cost
                if value > score[j]:
                    score[j] = value
                    back[j] = leader[i]
                break
            if step < 0.55 * local:
                continue
            deviation = math.log(step / local)
            value = score[i] + height[j] - deviation_cost * deviation * deviation
            if value > score[j]:
                score[j] = value
                back[j] = i
        leader[j] = j if j == 0 or score[j] > score[leader[j - 1]] else leader[j - 1]
    # The path ends within 1.3 periods of the stretch's last peak.
    best = -1
    for j in range(n):
        near_end = position[n - 1] - position[j] <= 1.3 * period[j]
        if near_end and score[j] > -np.inf and (best < 0 or score[j] > score[best]):
            best = j
    while best >= 0:
        chosen[best] = True
        best = back[best]


@njit(cache=True)
def overlap_add(
    x: NDArray[np.float64],
    mark: NDArray[np.int64],
    target: NDArray[np.int64],
    source: NDArray[np.int64],
    mirrored: NDArray[np.bool_],
    shift: NDArray[np.int64],
    gain: NDArray[np.float64],
    y: NDArray[np.float64],
) -> None:
    """Add one two-sided grain of `x` per target mark to `y`.

    mark : (M,), analysis marks; target : (N,), synthesis marks, strictly ascending;
    source : (N,), index of the analysis mark whose grain goes to each target;
    mirrored : (N,), whether the grain is turned round in time;
    shift : (N,), samples by which the grain's middle lies off its mark; gain : (N,).
    Each half of a grain fades over the shorter of the two gaps, source's or target's: windows of
    unmoved marks add up to one, and no grain reaches a second epoch.
    """
    for k in range(target.size):
        if gain[k] == 0.0:
            continue
        m = source[k]
        middle = mark[m] + shift[k]
        turn = -1 if mirrored[k] else 1
        for side in (-1, 1):
            other = k + side
            inner = 0 <= other < target.size
            fades = inner
            if inner:
                reach = abs(target[other] - target[k])
                neighbour = m + turn * side
                if 0 <= neighbour < mark.size:
                    reach = min(reach, abs(mark[neighbour] - mark[m]))
            else:
                needed = y.size - target[k] if side > 0 else target[k] + 1
                reach = x.size - middle if turn * side > 0 else middle + 1
                fades = reach < needed
            for d in range(0 if side > 0 else 1, reach):
                to = target[k] + side * d
                come = middle + turn * side * d
                if to < 0 or to >= y.size or come < 0 or come >= x.size:
                    break
                # Half a Hann window to the next mark on either side: neighbours add up to 1.
                weight = 0.5 + 0.5 * math.cos(math.pi * d / reach) if fades else 1.0
                y[to] += gain[k] * weight * x[come]
