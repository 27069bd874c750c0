"""Statistics of the hand's strokes, and those of real cuers to compare with.

A stroke is a rise and fall of the knuckles' speed in the picture's plane. Its ends lie where the
speed has fallen to 15 % of its peak, or at the valley before its neighbour.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from codec.cuer import layout

RATE_HZ = 30.0
"""Pictures per second of the films that the real cuers' figures come from."""

REAL = {
    "keys_per_s": (3.0, 3.9), "stroke_ms": (300, 333), "hold_ms": (0, 8),
    "short_hold_share": (0.69, 0.73), "peak_mm_s": (283, 320), "amplitude_mm": (56, 56),
    "path_over_chord": (1.17, 1.20), "way_and_length": (0.22, 0.38), "drift_mm_s": (30, 47),
}  # fmt: skip
"""Medians of three groups of utterances by two real cuers, filmed; the tracker's noise included."""

_EAR_TO_EAR_MM = 153.0
"""Distance in mm between the ears by which pictures are scaled."""

_LEAST_PEAK_MM_S = 120.0
"""Peak speed in mm/s from which a movement counts as a stroke."""

_ENDS = 0.15
"""Share of the peak speed at which a stroke begins and ends."""

_VALLEY = 0.5
"""Share of the lower peak to which speed has to fall between two strokes."""

_FINE = 4
"""Points between frames at which ends are looked for."""

_LONG_MM = 25.0
"""Way in mm from which a stroke's form is judged."""

_SHORT_HOLD_S = 0.04
"""Seconds below which a hold counts as none."""

_LONG_HOLD_S = 0.1
"""Seconds from which the hand's speed in a hold is judged."""

_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])
_WRIST = layout.marker_indices(layout.WRIST)
_EARS = layout.marker_indices(layout.EARS)


@dataclass(frozen=True, slots=True)
class Stroke:
    """Begin, peak and end of a stroke, as numbers of samples."""

    begin: int
    peak: int
    end: int


def stroke_figures(performances: list[NDArray[np.floating]]) -> dict[str, float]:
    """Return the statistics of the strokes of performances, under the names of `REAL`.

    Parameters
    ----------
    performances : list of ndarray, shape (T, 113, 3)
        Markers at `RATE_HZ`, mm.
    """
    lengths: list[float] = []
    peaks: list[float] = []
    ways: list[float] = []
    paths: list[float] = []
    holds: list[float] = []
    drifts: list[float] = []
    for markers in performances:
        place, speed = _seen(np.asarray(markers, dtype=np.float64))
        rate = RATE_HZ * _FINE
        found = [s for s in strokes_of(speed) if s.begin > 1 and s.end < len(speed) - 2]
        for number, stroke in enumerate(found):
            chord = float(np.linalg.norm(place[stroke.end] - place[stroke.begin]))
            steps = np.diff(place[stroke.begin : stroke.end + 1], axis=0)
            lengths.append((stroke.end - stroke.begin) / rate)
            peaks.append(speed[stroke.peak])
            ways.append(chord)
            paths.append(float(np.linalg.norm(steps, axis=1).sum()) / max(chord, 1e-9))
            if number + 1 < len(found):
                rest = speed[stroke.end : found[number + 1].begin]
                holds.append(len(rest) / rate)
                if holds[-1] > _LONG_HOLD_S:
                    drifts.append(rest.mean())
    if len(lengths) < 3:
        return {}
    way, length = np.array(ways), np.array(lengths)
    long = way > _LONG_MM
    together = float(np.corrcoef(way[long], length[long])[0, 1]) if long.sum() > 2 else 0.0
    return {
        "stroke_ms": 1000 * float(np.median(length)),
        "hold_ms": 1000 * float(np.median(holds)) if holds else 0.0,
        "short_hold_share": float(np.mean(np.array(holds) < _SHORT_HOLD_S)) if holds else 1.0,
        "peak_mm_s": float(np.median(peaks)),
        "amplitude_mm": float(np.median(way)),
        "path_over_chord": float(np.median(np.array(paths)[long])) if long.any() else 1.0,
        "way_and_length": together,
        "drift_mm_s": float(np.median(drifts)) if drifts else 0.0,
    }


def _seen(markers: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the knuckles are in the picture and their speed, four times as fine."""
    ears = markers[:, _EARS, :2]
    apart = np.median(np.linalg.norm(ears[:, 0] - ears[:, 1], axis=1))
    knuckles = markers[:, _KNUCKLES, :2].sum(axis=1)
    hand = (knuckles + markers[:, _WRIST, :2].mean(axis=1)) / (len(_KNUCKLES) + 1)
    hand = (hand - ears.mean(axis=1)) * (_EAR_TO_EAR_MM / apart)
    speed = np.linalg.norm(
        savgol_filter(hand, 5, 2, deriv=1, delta=1 / RATE_HZ, axis=0, mode="nearest"), axis=1
    )
    at, fine = np.arange(len(hand)), np.arange(0, len(hand) - 1, 1 / _FINE)
    place = np.stack([np.interp(fine, at, hand[:, c]) for c in (0, 1)], axis=1)
    return place, np.interp(fine, at, speed)


def strokes_of(speed: NDArray[np.float64]) -> list[Stroke]:
    """Return the strokes in a line of speeds, mm/s.

    Examples
    --------
    >>> strokes_of(np.array([0.0, 100.0, 400.0, 100.0, 0.0]))
    [Stroke(begin=0, peak=2, end=4)]
    """
    inner = np.arange(1, len(speed) - 1)
    tops = inner[
        (speed[inner] >= speed[inner - 1])
        & (speed[inner] > speed[inner + 1])
        & (speed[inner] > _LEAST_PEAK_MM_S)
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
