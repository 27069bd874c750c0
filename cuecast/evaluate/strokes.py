"""Statistics of the hand's strokes, and those of real cuers to compare with.

A stroke is a rise and fall of the knuckles' speed in the picture's plane. Its ends lie where the
speed has fallen to 15 % of its peak, or at the valley before its neighbour. Ours are measured as
those of real cuers were, on the landmarks that a tracker finds in a film
(`cuecast.evaluate.films`).
"""

import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from codec.cues.phonology import VOWELS
from codec.cues.score import Key, Score
from cuecast.evaluate.films import ASPECT, WIDTH_MM, film
from synth.capture.sources.landmark_maps import FACE_LANDMARKS
from synth.motion.measured.cuer import Performer

RATE_HZ = 30.0
"""Pictures per second of the films that the real cuers' figures come from."""

REAL = {
    "keys_per_s": (3.0, 3.9), "stroke_ms": (300, 333), "hold_ms": (0, 8),
    "short_hold_share": (0.69, 0.73), "peak_mm_s": (283, 320), "amplitude_mm": (56, 56),
    "path_over_chord": (1.17, 1.20), "way_and_length": (0.22, 0.38), "drift_mm_s": (30, 47),
    "fingers_ahead_ms": (33, 58), "hand_before_lips_ms": (167, 167),
}  # fmt: skip
"""Medians of three groups of utterances by two real cuers, filmed; the tracker's noise included."""

_EAR_TO_EAR_MM = 153.0
"""Distance in mm between the ears; pictures are scaled by it."""

_LEAST_PEAK_MM_S = 120.0
"""Least peak speed of a stroke in mm/s."""

_ENDS = 0.15
"""Share of the peak speed at which a stroke begins and ends."""

_VALLEY = 0.5
"""Share of the lower peak to which speed has to fall between two strokes."""

_FINE = 4
"""Points between frames at which ends are looked for."""

_LONG_MM = 25.0
"""Least way in mm of a stroke whose form is judged."""

_SHORT_HOLD_S = 0.04
"""Seconds below which a hold counts as none."""

_LONG_HOLD_S = 0.1
"""Least seconds of a hold whose speed is judged."""

_LEAST_CHANGE_MM_S = 150.0
"""The same of the fingers' distances, for a change of shape."""

_TOGETHER_S = 0.2
"""Seconds between the peaks of a stroke and of the change of shape that belongs to it."""

_ARRIVAL_S = 0.15
"""Seconds within which a stroke that ends is the arrival at a key."""

_AROUND_S = 0.3
"""Seconds of film before the first sound and after the last one."""

_FEWEST = 2
"""Strokes that are too few for statistics."""

_LISTS = ("length", "peak", "way", "path", "hold", "drift", "fingers", "lips")

_KNUCKLES = [0, 5, 9, 13, 17]
"""Landmarks of the wrist and of the knuckles."""

_EARS = (454, 234)
"""Landmarks of the face beside the ears, her left one first."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """Begin, peak and end of a stroke, as numbers of samples."""

    begin: int
    peak: int
    end: int


@dataclass(frozen=True, slots=True)
class Filmed:
    """A film's measurements of a performance.

    Attributes
    ----------
    hand : ndarray of float64, shape (T, 21, 2)
        The 21 landmarks of trackers at `RATE_HZ`, mm from the middle between the ears.
    aims : tuple of (float, float)
        When the hand should be on the target of a key, and the middle of the key's vowel, seconds.
    """

    hand: NDArray[np.float64]
    aims: tuple[tuple[float, float], ...] = ()


def film_of(cuer: Performer, score: Score, *, noise_mm: float = 0.0, seed: int = 0) -> Filmed:
    """Return the film of a cuer of `RATE_HZ` who performs a score, from before it to after it.

    Parameters
    ----------
    cuer : Performer
    score : Score
    noise_mm : float
        Of the tracker.
    seed : int
        Of the noise.
    """
    end_s = score.phones[-1].end + _AROUND_S
    face, hand, _ = film(cuer, score, seconds=end_s, noise_mm=noise_mm, seed=seed)
    size = np.array([WIDTH_MM, WIDTH_MM / ASPECT])
    ears = face[:, [FACE_LANDMARKS.index(number) for number in _EARS], :2] * size
    apart = np.median(np.linalg.norm(ears[:, 0] - ears[:, 1], axis=1))
    seen = (hand[..., :2] * size - ears.mean(axis=1)[:, None]) * (_EAR_TO_EAR_MM / apart)
    first = max(0, round((score.phones[0].start - _AROUND_S) * RATE_HZ))
    aims = [
        (at - first / RATE_HZ, middle - first / RATE_HZ)
        for key, at in cuer.target_times(score)
        if key is not None and (middle := _middle_of_vowel(key, score)) is not None
    ]
    return Filmed(seen[first:], tuple(aims))


def _middle_of_vowel(key: Key, score: Score) -> float | None:
    if key.phones[-1] not in VOWELS:
        return None
    number = bisect.bisect_left(score.phones, key.end - 1e-6, key=lambda p: p.end)
    return 0.5 * (score.phones[number].start + score.phones[number].end)


def stroke_figures(films: Sequence[Filmed]) -> dict[str, float]:
    """Return the statistics of the strokes in films, under the names of `REAL`."""
    found: dict[str, list[float]] = {name: [] for name in _LISTS}
    for one in films:
        _measure(one, found)
    if len(found["length"]) < _FEWEST:
        return {}
    way, length, hold = (np.array(found[name]) for name in ("way", "length", "hold"))
    long = way > _LONG_MM
    together = float(np.corrcoef(way[long], length[long])[0, 1]) if long.sum() > _FEWEST else 0.0

    def middle(values: Sequence[float] | NDArray[np.float64]) -> float:
        return float(np.median(np.asarray(values))) if len(values) else 0.0

    return {
        "stroke_ms": 1000 * middle(length),
        "hold_ms": 1000 * middle(hold),
        "short_hold_share": float(np.mean(hold < _SHORT_HOLD_S)) if hold.size else 1.0,
        "peak_mm_s": middle(found["peak"]),
        "amplitude_mm": middle(way),
        "path_over_chord": middle(np.array(found["path"])[long]),
        "way_and_length": together,
        "drift_mm_s": middle(found["drift"]),
        "fingers_ahead_ms": 1000 * middle(found["fingers"]),
        "hand_before_lips_ms": 1000 * middle(found["lips"]),
    }


def rows_within(figures: Mapping[str, float], share: float = 0.1) -> int:
    """Return how many rows of the real cuers' table figures meet to a share of the bounds.

    The two figures of holds are one row of the table.
    """
    met = {
        name: low - share * abs(low) <= figures.get(name, np.inf) <= high + share * abs(high)
        for name, (low, high) in REAL.items()
    }
    met["hold_ms"] = met["hold_ms"] and met.pop("short_hold_share")
    return sum(met.values())


def _measure(one: Filmed, found: dict[str, list[float]]) -> None:
    """Add the figures of a film's strokes."""
    place, speed, shape_speed = _seen(one.hand)
    rate = RATE_HZ * _FINE
    every = strokes_of(speed)
    strokes = [s for s in every if s.begin > 1 and s.end < len(speed) - 2]
    changes = strokes_of(shape_speed, _LEAST_CHANGE_MM_S)
    for stroke in strokes:
        chord = float(np.linalg.norm(place[stroke.end] - place[stroke.begin]))
        steps = np.diff(place[stroke.begin : stroke.end + 1], axis=0)
        found["length"].append((stroke.end - stroke.begin) / rate)
        found["peak"].append(speed[stroke.peak])
        found["way"].append(chord)
        found["path"].append(float(np.linalg.norm(steps, axis=1).sum()) / max(chord, 1e-9))
        near = [c for c in changes if abs(c.peak - stroke.peak) < _TOGETHER_S * rate]
        if near and chord > _LONG_MM:
            change = min(near, key=lambda c: abs(c.peak - stroke.peak))
            found["fingers"].append((stroke.end - change.end) / rate)
        following = next((s for s in every if s.begin >= stroke.end), None)
        if following is not None:
            rest = speed[stroke.end : following.begin]
            found["hold"].append(len(rest) / rate)
            if found["hold"][-1] > _LONG_HOLD_S:
                found["drift"].append(float(rest.mean()))
    ends = np.array([stroke.end for stroke in every]) / rate
    for target, vowel in one.aims:
        if len(ends) and (late := np.abs(ends - target)).min() < _ARRIVAL_S:
            found["lips"].append(vowel - ends[late.argmin()])


def _seen(hand: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return where the knuckles are, their speed and that of the shape, four times as fine."""
    knuckles = hand[:, _KNUCKLES].mean(axis=1)
    shape = np.column_stack(
        [
            np.linalg.norm(hand[:, [8, 12, 16, 20]] - hand[:, [5, 9, 13, 17]], axis=2),
            np.linalg.norm(hand[:, 4] - hand[:, 17], axis=1),
        ]
    )
    at, fine = np.arange(len(hand)), np.arange(0, len(hand) - 1, 1 / _FINE)

    def speed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        slope = savgol_filter(values, 5, 2, deriv=1, delta=1 / RATE_HZ, axis=0, mode="nearest")
        return np.asarray(np.interp(fine, at, np.linalg.norm(slope, axis=1)))

    place = np.stack([np.interp(fine, at, knuckles[:, c]) for c in (0, 1)], axis=1)
    return place, speed(knuckles), speed(shape)


def strokes_of(speed: NDArray[np.float64], least_mm_s: float = _LEAST_PEAK_MM_S) -> list[Stroke]:
    """Return the strokes in a line of speeds, mm/s, whose peaks are above the least.

    Examples
    --------
    >>> strokes_of(np.array([0.0, 100.0, 400.0, 100.0, 0.0]))
    [Stroke(begin=0, peak=2, end=4)]
    """
    inner = np.arange(1, len(speed) - 1)
    tops = inner[
        (speed[inner] >= speed[inner - 1])
        & (speed[inner] > speed[inner + 1])
        & (speed[inner] > least_mm_s)
    ]
    peaks: list[int] = []
    for top in tops.tolist():
        if peaks and speed[peaks[-1] : top].min() > _VALLEY * min(speed[peaks[-1]], speed[top]):
            peaks[-1] = max(peaks[-1], top, key=lambda i: float(speed[i]))
        else:
            peaks.append(top)
    found = []
    for number, peak in enumerate(peaks):
        before = peaks[number - 1] if number else 0
        after = peaks[number + 1] if number + 1 < len(peaks) else len(speed) - 1
        first = before + int(speed[before : peak + 1].argmin()) if number else 0
        last = peak + int(speed[peak : after + 1].argmin())
        low = _ENDS * speed[peak]
        begin, end = peak, peak
        while begin > first and speed[begin] > low:
            begin -= 1
        while end < last and speed[end] > low:
            end += 1
        found.append(Stroke(begin, peak, end))
    return found
