"""Lines of keys through frames (Viterbi 1967): given keys in order, or any.

Rest comes first and last; between two keys is a way, which may take no frame.
"""

import numpy as np

from codec.compiled import njit

_NEVER = -1e18
"""Log density of what never is."""


@njit(cache=True)
def aligned(fit, skip, line):  # type: ignore[no-untyped-def]
    """Lay states in order through all frames.

    Parameters
    ----------
    fit : ndarray of float64, shape (T, S)
        Log density of each state in each frame.
    skip : ndarray of bool, shape (S,)
        States that may take no frame; neither the first nor the last, and no two in a row.
    line : ndarray of int64, shape (T,)
        Set to the state of each frame.
    """
    frames, states = fit.shape
    best = np.full((frames, states), _NEVER)
    back = np.zeros((frames, states), np.int64)
    best[0, 0] = fit[0, 0]
    for t in range(1, frames):
        for s in range(states):
            value, where = best[t - 1, s], s
            if s > 0 and best[t - 1, s - 1] > value:
                value, where = best[t - 1, s - 1], s - 1
            if s > 1 and skip[s - 1] and best[t - 1, s - 2] > value:
                value, where = best[t - 1, s - 2], s - 2
            best[t, s], back[t, s] = value + fit[t, s], where
    state = states - 1
    for t in range(frames - 1, -1, -1):
        line[t] = state
        state = back[t, state]


@njit(cache=True)
def likeliest(key, way, rest, enter, line):  # type: ignore[no-untyped-def]
    """Lay the best line of any keys through all frames; no key follows itself.

    Parameters
    ----------
    key : ndarray of float64, shape (T, K)
    way, rest : ndarray of float64, shape (T,)
        Log densities of each key, of a way between keys, and of rest.
    enter : ndarray of float64, shape (K,)
        Price of each key.
    line : ndarray of int64, shape (T,)
        Set to 0 at rest, 1 to K at a key, K + 1 to 2K on the way after one, 2K + 1 on that from
        rest.
    """
    frames, keys = key.shape
    from_rest = 2 * keys + 1
    best = np.full((frames, 2 * keys + 2), _NEVER)
    back = np.zeros((frames, 2 * keys + 2), np.int64)
    best[0, 0] = rest[0]
    for t in range(1, frames):
        before = best[t - 1]
        # The two best ends of keys or of the ways after them: of different keys.
        top, first, next_top, second = _NEVER, 1, _NEVER, 1
        for k in range(1, keys + 1):
            end = k if before[k] >= before[keys + k] else keys + k
            if before[end] > top:
                top, first, next_top, second = before[end], end, top, first
            elif before[end] > next_top:
                next_top, second = before[end], end
        rested = 0 if before[0] >= before[from_rest] else from_rest
        back[t, 0] = 0 if before[0] >= top else first
        best[t, 0] = before[back[t, 0]] + rest[t]
        back[t, from_rest] = rested
        best[t, from_rest] = before[rested] + way[t]
        for k in range(1, keys + 1):
            came = second if first in (k, keys + k) else first
            if before[rested] > before[came]:
                came = rested
            stays = before[k] >= before[came] + enter[k - 1]
            back[t, k] = k if stays else came
            best[t, k] = max(before[k], before[came] + enter[k - 1]) + key[t, k - 1]
            left = keys + k if before[keys + k] >= before[k] else k
            back[t, keys + k] = left
            best[t, keys + k] = before[left] + way[t]
    state = int(best[frames - 1].argmax())
    for t in range(frames - 1, -1, -1):
        line[t] = state
        state = back[t, state]
