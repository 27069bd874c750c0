"""Compiled search of the aligner: the cheapest cut of frames into units."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True)
def segment_into(
    cumulated: NDArray[np.float64],
    kinds: NDArray[np.int64],
    entry: NDArray[np.float64],
    lengths: NDArray[np.float64],
    shortest: int,
    window: NDArray[np.int64],
    slope: float,
    skips: NDArray[np.int64],
    skip_cost: float,
    starts: NDArray[np.int64],
) -> bool:
    """Cut frames into a given row of units at the least cost.

    cumulated : float64 (kinds, frames + 1), running sums of the cost of a frame under each kind of
    unit; kinds : int64 (units,); entry : float64 (units,), at least 0 for units
    that may be absent and have no price for their length (silence, other speech): what their
    presence costs; -1 for the others; lengths : float64 (units, longest), cost of a unit of
    shortest + index frames; window : int64 (units, 4), the first and last frame at which a unit
    may start, and between them those at which it is expected to: farther away each frame costs
    `slope`; skips : int64 (units,), how many units up to and with this one may be
    left out together, 0 for none; starts : int64 (units + 1,), filled with the first frames; an
    absent unit starts with its successor. The result is False if nothing fits.
    """
    units, frames = kinds.shape[0], cumulated.shape[1] - 1
    # best[u, t]: least cost of the first u units ending at frame t; came[u, t]: start of unit u.
    #   best[u + 1, t] = min over begin of best[u, begin] + length[t - begin] + slope * outside
    #                                     + C[kind, t] - C[kind, begin],  C: running sums
    best = np.full((units + 1, frames + 1), np.inf)
    came = np.zeros((units + 1, frames + 1), np.int32)
    best[0, 0] = 0.0
    for u in range(units):
        kind = kinds[u]
        if entry[u] >= 0.0:
            # Without a price for length the minimum over all begins is a running one:
            #   min over begin of (best[u, begin] + entry - C[begin]), plus C[t]; or absent.
            running, since = np.inf, 0
            for t in range(frames + 1):
                cost = cumulated[kind, t]
                here = best[u, t]
                if running + cost < here:
                    best[u + 1, t] = running + cost
                    came[u + 1, t] = since
                else:
                    best[u + 1, t] = here
                    came[u + 1, t] = t
                if here + entry[u] - cost < running:
                    running, since = here + entry[u] - cost, t
        else:
            last = min(frames, window[u, 3] + shortest + lengths.shape[1])
            for t in range(window[u, 0] + shortest, last + 1):
                for k in range(min(lengths.shape[1], t - shortest - window[u, 0] + 1)):
                    begin = t - shortest - k
                    if best[u, begin] == np.inf:
                        continue
                    cost = best[u, begin] + lengths[u, k]
                    if begin < window[u, 1]:
                        cost += slope * (window[u, 1] - begin)
                    elif begin > window[u, 2]:
                        cost += slope * (begin - window[u, 2])
                    cost += cumulated[kind, t] - cumulated[kind, begin]
                    if cost < best[u + 1, t]:
                        best[u + 1, t] = cost
                        came[u + 1, t] = begin
            if skips[u] > 0:
                for t in range(frames + 1):
                    cost = best[u + 1 - skips[u], t] + skip_cost
                    if cost < best[u + 1, t]:
                        best[u + 1, t] = cost
                        came[u + 1, t] = -1
    # Follow `came` back from the end; -1 marks units that were left out together.
    t = frames
    starts[units] = frames
    u = units
    while u > 0:
        if came[u, t] < 0:
            for left_out in range(skips[u - 1]):
                starts[u - 1 - left_out] = t
            u -= skips[u - 1]
        else:
            t = came[u, t]
            u -= 1
            starts[u] = t
    return bool(best[units, frames] < np.inf)
