"""Compiled loops of the resynthesis."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


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
        total = weights[t].sum()
        for c in range(weights.shape[1]):
            weights[t, c] /= total


@njit(cache=True)
def _jerk(phase: float, power: float) -> float:
    """Return the minimum-jerk course of a phase 0..1 that is raised to a power."""
    u = phase if power == 1.0 else phase**power
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


@njit(cache=True)
def progress_into(
    leave: NDArray[np.int64],
    reach: NDArray[np.int64],
    first: int,
    step: int,
    earlier: float,
    power: float,
    number: NDArray[np.int64],
    progress: NDArray[np.float64],
) -> None:
    """Find the movement under way in frames at ``first``, ``first + step``... (P5).

    ``progress[t]`` are those of fingers and carrier; what was before everything has arrived.
    """
    g = 0
    for t in range(number.size):
        time = first + t * step
        while g + 1 < leave.size and leave[g + 1] <= time:
            g += 1
        number[t] = g
        progress[t, 0] = progress[t, 1] = 1.0
        if g > 0:
            elapsed, duration = float(time - leave[g]), float(reach[g] - leave[g])
            sooner = max(duration - earlier, duration / 2, 1.0)
            progress[t, 0] = _jerk(min(elapsed / sooner, 1.0), power)
            progress[t, 1] = _jerk(min(elapsed / max(duration, 1.0), 1.0), power)


@njit(cache=True)
def course_into(
    number: NDArray[np.int64],
    progress: NDArray[np.float64],
    hand: NDArray[np.float64],
    carried: NDArray[np.float64],
    distance: NDArray[np.float64],
    arc: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill ``out`` (T, H + C) with what moves between the ends of movements (P4).

    hand (G, H) and carried (G, C) are held at each movement's end; ``distance`` is that of its
    ends, ``arc`` the deviation of a middle per unit of it.
    """
    width = hand.shape[1]
    for t in range(number.size):
        goal = number[t]
        start = max(goal - 1, 0)
        fingers, part = progress[t, 0], progress[t, 1]
        bend = 4.0 * part * (1.0 - part) * distance[goal]
        for c in range(width):
            out[t, c] = hand[start, c] + fingers * (hand[goal, c] - hand[start, c])
        for c in range(carried.shape[1]):
            straight = carried[start, c] + part * (carried[goal, c] - carried[start, c])
            out[t, width + c] = straight + bend * arc[c]
