"""Compiled loops of the evidence that stretches of sound give together.

Contiguous arrays in, arrays filled in place out; no checks.
"""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit

Floats = NDArray[np.float32]

TINY = np.float32(1e-9)
"""Least deviation that is divided by."""


@njit(cache=True, inner=True, fastmath={"reassoc", "contract"})
def spread_of(values: Floats) -> tuple[np.float32, np.float32]:
    """Return the mean and the standard deviation of values that are near 0."""
    total, power = np.float32(0), np.float32(0)
    for i in range(values.size):
        total += values[i]
        power += values[i] * values[i]
    count = np.float32(values.size)
    mean = total / count
    return mean, np.sqrt(max(power / count - mean * mean, np.float32(0)))


@njit(cache=True, inner=True, fastmath={"nnan", "nsz"})
def highest_of(values: Floats) -> np.float32:
    """Return the highest value."""
    highest = np.float32(values[0])
    for i in range(values.size):
        highest = max(highest, np.float32(values[i]))
    return highest


@njit(cache=True, inner=True)
def highest_near(values: Floats, reach: int) -> Floats:
    """Return the highest value within `reach` places of each, round and round."""
    count, width, seen = values.size, 2 * reach + 1, 1
    near = np.empty(count + 2 * reach, dtype=np.float32)
    near[:reach], near[reach : reach + count] = values[count - reach :], values
    near[reach + count :] = values[:reach]
    while seen < width:
        # Of twice as many by two of them; out of place, or loops are not made vectors.
        step = min(seen, width - seen)
        one, other = near[: near.size - step], near[step:]
        near = np.empty(one.size, dtype=np.float32)
        for i in range(near.size):
            near[i] = one[i] if one[i] > other[i] else other[i]
        seen += step
    return near


@njit(cache=True, fastmath={"reassoc", "contract"})
def add_stretch(
    peaks: Floats,
    first: int,
    before: Floats,
    reach: int,
    fading: np.float32,
    best: Floats,
    where: NDArray[np.int64],
) -> None:
    """Add the scores of a stretch to those before it; note each pair's best place.

    peaks[n, i] are scores of place i, from place `first` of the period on; a period has as many
    places as `before`, shape (pairs, period), which holds the evidence of earlier stretches and is
    replaced. Evidence within `reach` places counts, weakened by `fading`. best[n] is the
    largest evidence in deviations, where[n] its place.
    """
    pairs, period = before.shape
    count = peaks.shape[1]
    own = np.empty(period, dtype=np.float32)
    for n in range(pairs):
        level = np.float32(0)
        for i in range(count):
            level += peaks[n, i]
        level /= np.float32(count)
        own[:] = np.float32(0)
        rounds = 0
        for begin in range(0, count, period):
            row = peaks[n, begin : min(begin + period, count)]
            for i in range(row.size):
                own[i] += row[i] - level
            rounds += 1
        # Places that came once more than the others stand for themselves the less.
        last = count - (rounds - 1) * period
        often = np.float32(1) / np.sqrt(np.float32(rounds))
        seldom = np.float32(1) / np.sqrt(np.float32(max(rounds - 1, 1)))
        for i in range(last):
            own[i] *= often
        for i in range(last, period):
            own[i] *= seldom
        scale = np.float32(1) / (spread_of(own)[1] + TINY)
        near = highest_near(before[n], reach)
        mean, rest = spread_of(near)[0], period - first
        on, back = near[first:], near[:first]
        own_on, own_back = own[:rest], own[rest:]
        for i in range(rest):
            own_on[i] = scale * own_on[i] + fading * (on[i] - mean)
        for i in range(first):
            own_back[i] = scale * own_back[i] + fading * (back[i] - mean)
        before[n, first:], before[n, :first] = own_on, own_back
        highest, top = highest_of(own), 0
        while own[top] != highest:
            top += 1
        best[n], where[n] = highest / (spread_of(own)[1] + TINY), top
