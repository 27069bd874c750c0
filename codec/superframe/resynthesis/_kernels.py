"""Compiled loops of the resynthesis."""

import numpy as np
from numpy.typing import NDArray

from codec.compiled import njit


@njit(cache=True)
def pull_into(
    sounds: NDArray[np.int64],
    first_tick: int,
    reach: float,
    rise: float,
    share: float,
    weights: NDArray[np.float64],
) -> None:
    """Add the dominances of sounds to ``weights`` (T, 38), then divide its rows by their sums (P7).

    sounds are rows of phone number, start and end in ticks; frame t lies at ``first_tick + t``.
    """
    for i in range(sounds.shape[0]):
        number, start, end = sounds[i, 0], sounds[i, 1], sounds[i, 2]
        if number == 0:
            continue
        half, middle = 0.5 * (end - start), 0.5 * (start + end)
        width, scale = max(reach - half, rise), share * half + rise
        for t in range(weights.shape[0]):
            away = abs(first_tick + t - middle)
            fade = max((away - half) / width, 0.0)
            if fade < 1.0:
                ratio = away / scale
                pull = np.exp(-ratio * np.sqrt(ratio)) * (1.0 - fade) ** 2
                weights[t, number] += pull
    for t in range(weights.shape[0]):
        total = 0.0  # numba's sum of arrays takes seconds to compile
        for c in range(weights.shape[1]):
            total += weights[t, c]
        for c in range(weights.shape[1]):
            weights[t, c] /= total


@njit(cache=True, inner=True)
def _jerk(phase: float, power: float) -> float:
    """Return the minimum-jerk course of a phase 0..1 that is raised to a power."""
    u = phase if power == 1.0 else phase**power
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


@njit(cache=True)
def moved_into(
    leave: NDArray[np.int64],
    reach: NDArray[np.int64],
    first: int,
    step: int,
    begins: NDArray[np.float64],
    ends: NDArray[np.float64],
    stroke: float,
    power: float,
    held: NDArray[np.float64],
    distance: NDArray[np.float64],
    arc: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill ``out`` (T, C) with where the strokes have brought each channel (P4, P5).

    Frame t lies at ``first + t * step``. held (G, C) are the targets; begins and ends (C,) say how
    much later than its movement a channel's stroke begins and ends, in strokes of the length
    `stroke` or more. ``distance`` (G,) is that of a stroke's ends, ``arc`` (C,) the deviation of
    its middle per unit of it.
    """
    for c in range(out.shape[1]):
        done = 0
        for t in range(out.shape[0]):
            time = float(first + t * step)
            value, begun = 0.0, False
            for g in range(done + 1, leave.size):
                # Delays of begin and end shrink with strokes shorter than usual.
                duration = float(reach[g] - leave[g])
                part = 1.0 if duration >= stroke else duration / stroke
                begin = leave[g] + part * begins[c]
                if begin > time:
                    break
                length = max(reach[g] + part * ends[c] - begin, duration / 2, 1.0)
                # Strokes that are over become the held position; a channel has at most a few at
                # once.
                if not begun and time >= begin + length:
                    done = g
                    continue
                # Minimum-jerk share of the way, with an arc that is greatest at half.
                p = _jerk(min((time - begin) / length, 1.0), power)
                value += p * (held[g, c] - held[g - 1, c])
                value += 4.0 * p * (1.0 - p) * distance[g] * arc[c]
                begun = True
            out[t, c] = held[done, c] + value
