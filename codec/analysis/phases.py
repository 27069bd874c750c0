"""Phasing: when each gesture begins and ends, against the sound it belongs to.

Two measurements. The *extent* of a gesture is the time while the probability of its shape or
placement dominates all others (Gibert, Bailly, Elisei 2004, section 4); a key that repeats its
neighbour's shape or placement has no extent of its own. The *stroke* is the movement to the
target, from the speed of the hand: it begins (M1) and ends (M2) where the speed has fallen to a
tenth of its peak (Attina 2005).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.phonology import VOWELS
from codec.cues.score import PLACEMENT_NUMBER, Key, Score

_RIGID_FACE = layout.marker_indices(layout.RIGID_FACE)
_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])

_SMOOTHING_S = 0.07
"""Length in seconds of the polynomial that smooths positions: shorter than the shortest stroke."""

_STROKE_BEFORE_S = 0.5
"""Seconds before a key's start within which its stroke is looked for: real strokes last up to 0.535
s (90th percentile)."""

_LATEST_PEAK_S = 0.03
"""Latest peak of a key's stroke, in seconds after the key's start."""

_STILL_SHARE = 0.1
"""Share of the stroke's peak speed below which the hand counts as arrived or not yet gone."""

_LEAST_PEAK_MM_S = 100.0
"""Least peak speed of a stroke in mm/s: above sway and noise."""


@dataclass(frozen=True, slots=True)
class Phase:
    """Begin and end of a gesture on the programme's clock, and the key it belongs to.

    Attributes
    ----------
    key : Key
    start_s, end_s : float
        Seconds.
    """

    key: Key
    start_s: float
    end_s: float

    @property
    def lead_s(self) -> float:
        """Seconds from the gesture's begin to the key's acoustic onset; positive: hand first."""
        return self.key.start - self.start_s

    @property
    def lag_s(self) -> float:
        """Seconds from the key's acoustic onset to the gesture's end."""
        return self.end_s - self.key.start


def key_kind(key: Key) -> str:
    """Return how a key is made of phones: ``CV``, ``V`` or ``C``.

    Examples
    --------
    >>> key_kind(Key(0.0, 0.2, ("b", "ɔ̃"), 4, "mouth")), key_kind(Key(0.0, 0.1, ("ʁ",), 3, "side"))
    ('CV', 'C')
    """
    if len(key.phones) == 2:
        return "CV"
    return "V" if key.phones[0] in VOWELS else "C"


def extents(
    posteriors: NDArray[np.float64],
    score: Score,
    *,
    rate_hz: float,
    start_s: float = 0.0,
    options: CueingOptions = DEFAULT_OPTIONS,
) -> list[Phase]:
    """Return the extents of the keys' shapes or placements.

    Parameters
    ----------
    posteriors : ndarray of float64, shape (T, 9) or (T, 6)
        Probabilities of the shapes or of the placements (`codec.analysis.recognise.Recogniser`).
    score : Score
    rate_hz, start_s : float
        Clock of the frames.
    options : CueingOptions
        Tells which gaps between keys return to rest.

    Returns
    -------
    list of Phase
        In order of time; keys that repeat a neighbour, or were never recognised, are missing.
    """
    best = posteriors.argmax(1)
    of_placement = posteriors.shape[1] == len(PLACEMENT_NUMBER)
    found = []
    for before, key, after in _neighbours(score.keys, options.rest_gap_s):
        label = _label(key, of_placement)
        if label in (_label(before, of_placement), _label(after, of_placement)):
            continue
        reach = 0.5 * (key.end - key.start)
        earliest = max(before.start if before else -np.inf, key.start - _STROKE_BEFORE_S)
        latest = after.start if after else key.end + reach
        window = _frames(earliest, latest, rate_hz, start_s, len(best))
        span = _longest_run(best == label, window)
        if span:
            found.append(Phase(key, start_s + span[0] / rate_hz, start_s + span[1] / rate_hz))
    return found


def _label(key: Key | None, of_placement: bool) -> int:
    if key is None:
        return 0
    return PLACEMENT_NUMBER[key.placement] if of_placement else key.shape


def _neighbours(
    keys: Sequence[Key], rest_gap_s: float
) -> Iterable[tuple[Key | None, Key, Key | None]]:
    """Yield each key between its neighbours, None where the hand rests instead."""
    line = [None, *keys, None]
    for before, key, after in zip(line[:-2], keys, line[2:], strict=True):
        yield (
            before if before and key.start - before.end < rest_gap_s else None,
            key,
            after if after and after.start - key.end < rest_gap_s else None,
        )


def _frames(
    from_s: float, to_s: float, rate_hz: float, start_s: float, n_frames: int
) -> tuple[int, int]:
    first, last = np.round((np.array([from_s, to_s]) - start_s) * rate_hz)
    return int(np.clip(first, 0, n_frames)), int(np.clip(last, 0, n_frames))


def _longest_run(mask: NDArray[np.bool_], window: tuple[int, int]) -> tuple[int, int] | None:
    """Return begin and end of the run of true frames that is longest inside the window."""
    first, last = window
    edges = np.flatnonzero(np.diff(mask[first:last].astype(np.int8), prepend=0, append=0)) + first
    if not len(edges):
        return None
    begin, end = max(edges.reshape(-1, 2).tolist(), key=lambda run: run[1] - run[0])
    while begin > 0 and mask[begin - 1]:
        begin -= 1
    while end < len(mask) and mask[end]:
        end += 1
    return int(begin), int(end)


def strokes(
    markers: NDArray[np.floating], score: Score, *, rate_hz: float, start_s: float = 0.0
) -> list[Phase]:
    """Return the movements of the hand to its placements, from M1 to M2.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
        Millimetres, hidden markers recovered.
    score : Score
    rate_hz, start_s : float
        Clock of the frames.

    Returns
    -------
    list of Phase
        Keys to which the hand hardly moves are missing.
    """
    speed = hand_speed(markers, rate_hz)
    found = []
    for key in score.keys:
        first, last = _frames(
            key.start - _STROKE_BEFORE_S, key.start + _LATEST_PEAK_S, rate_hz, start_s, len(speed)
        )
        peak = _last_peak(speed, first, last)
        if peak is None:
            continue
        begin, end = _valley(speed, peak, -1), _valley(speed, peak, 1)
        found.append(Phase(key, start_s + begin / rate_hz, start_s + end / rate_hz))
    return found


def hand_speed(markers: NDArray[np.floating], rate_hz: float) -> NDArray[np.float64]:
    """Return the speed of the knuckles against the head, mm/s, shape (T,)."""
    x = np.asarray(markers, dtype=np.float64)
    skull = x[:, _RIGID_FACE]
    motion, _ = rigid.estimate_motion(skull.mean(0), skull)
    hand = rigid.inverse_rigid_motion(x[:, _KNUCKLES], motion).mean(1)
    window = max(5, 2 * round(0.5 * _SMOOTHING_S * rate_hz) + 1)
    if len(hand) < window:
        return np.zeros(len(hand))
    from scipy.signal import savgol_filter  # 2 s and 50 MB, needed only here

    velocity = savgol_filter(hand, window, 3, deriv=1, delta=1 / rate_hz, axis=0)
    return np.asarray(np.linalg.norm(velocity, axis=1))


def _last_peak(speed: NDArray[np.float64], first: int, last: int) -> int | None:
    """Return the last considerable peak of speed between two frames."""
    inner = np.arange(max(first, 1), min(last, len(speed) - 1))
    here = speed[inner]
    peaks = inner[(here >= speed[inner - 1]) & (here > speed[inner + 1])]
    peaks = peaks[speed[peaks] > _LEAST_PEAK_MM_S]
    return int(peaks[-1]) if len(peaks) else None


def _valley(speed: NDArray[np.float64], peak: int, step: int) -> int:
    """Return where the speed has fallen from its peak: a tenth of it, or a valley before."""
    at = peak
    while 0 < at + step < len(speed) - 1:
        if speed[at] <= _STILL_SHARE * speed[peak]:
            break
        if speed[at + step] > speed[at] and speed[at] < 0.5 * speed[peak]:
            break
        at += step
    return at


@dataclass(frozen=True, slots=True)
class PhaseProfile:
    """Mean and standard deviation of the phases of one kind of key, seconds."""

    kind: str
    count: int
    lead_s: float
    lead_sd_s: float
    lag_s: float
    lag_sd_s: float


def profiles(phases: Iterable[Phase]) -> list[PhaseProfile]:
    """Average the phases of each kind of key that occurs."""
    by_kind: dict[str, list[Phase]] = {}
    for phase in phases:
        by_kind.setdefault(key_kind(phase.key), []).append(phase)
    result = []
    for kind, group in sorted(by_kind.items()):
        lead = np.array([phase.lead_s for phase in group])
        lag = np.array([phase.lag_s for phase in group])
        figures = (lead.mean(), lead.std(), lag.mean(), lag.std())
        result.append(PhaseProfile(kind, len(group), *map(float, figures)))
    return result
