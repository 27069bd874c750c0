"""Whether a cuer can be read: how long each key is shown, how fast the hand is.

A key is *held* while the hand is nearer to its shape and to its placement than to any other
(nearest class), which needs no dead stop: real cuers hardly stop. Shapes are compared by the
markers of the fingers after the back of the hand has been laid on that of the target; placements
by where the finger that the shape points with is against the head.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.analysis.shapes import shapes_apart
from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, SHAPES, Key, Score

FloatArray = NDArray[np.float64]

HELD_S = 0.1
"""A target should be seen this long (Duchnowski et al. 2000)."""

_FINE_HZ = 200.0
"""Moments per second at which the hand is looked at."""

_BEFORE_S, _AFTER_S = 0.6, 0.5
"""How far from a key's sound it is looked for."""

_ROUNDS = 3
"""Fits of the back of the hand, each without the markers that the one before left far off."""

_RIGID_FACE = layout.marker_indices(layout.RIGID_FACE)
_BACK = layout.marker_indices((*layout.PALM, *layout.KNUCKLES[1:], *layout.WRIST))
_FINGERS = layout.marker_indices([n for f in layout.FINGERS for n in f])
_KNUCKLES = layout.marker_indices(layout.KNUCKLES[1:])
_TIPS = layout.marker_indices([layout.longest_finger_tip(shape) for shape in SHAPES])
_HAND = slice(layout.N_FACE, None)
_TIPS_OF = _TIPS - layout.N_FACE
_ALL = slice(None)


@dataclass(frozen=True, slots=True)
class Shown:
    """How long a key is shown.

    Attributes
    ----------
    key : Key
    start_s, held_s : float
        From when on and how long, seconds; keys that repeat their neighbour share their time.
    """

    key: Key
    start_s: float
    held_s: float


class Classes:
    """The targets of a cuer, to compare a moving hand with.

    Parameters
    ----------
    targets : ndarray, shape (9, 6, 113, 3)
        Markers of every shape at every placement, mm, with the same head.

    Attributes
    ----------
    tips : ndarray of float64, shape (9, 6, 3)
        Where the finger that a shape points with is at each placement, mm.
    fingers : ndarray of float64, shape (9, F, 3)
        The fingers' markers of each shape at one placement, mm.
    """

    def __init__(self, targets: NDArray[np.floating]) -> None:
        keys = np.asarray(targets, dtype=np.float64)
        flat = keys.reshape(-1, *keys.shape[2:])
        relative = _against_head(flat, flat[0, _RIGID_FACE]).reshape(keys.shape)
        self._skull = flat[0, _RIGID_FACE]
        tips = relative[np.arange(9)[:, None], np.arange(len(PLACEMENTS)), _TIPS[:, None]]
        self.tips = tips
        self._back = relative[:, 1, _BACK]
        self.fingers = relative[:, 1, _FINGERS]

    def distances(self, markers: NDArray[np.floating]) -> tuple[FloatArray, FloatArray]:
        """Return how far a hand is from each shape and placement.

        Parameters
        ----------
        markers : ndarray, shape (T, 113, 3)
            Millimetres.

        Returns
        -------
        shapes : ndarray, shape (T, 9)
            Root mean square over the fingers' markers, mm.
        placements : ndarray, shape (T, 9, 6)
            Distance of the pointing finger's tip for a hand of each shape, mm.
        """
        return self.distances_of(self.seen_from_head(markers))

    def distances_of(self, hand: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the same of a hand (T, 50, 3) as `seen_from_head` gives it."""
        return self._shapes(hand), np.linalg.norm(hand[:, _TIPS_OF, None] - self.tips, axis=3)

    def seen_from_head(self, markers: NDArray[np.floating]) -> FloatArray:
        """Return the hand of markers (T, 113, 3) as it is where the head is at rest, (T, 50, 3)."""
        return _against_head(np.asarray(markers, dtype=np.float64), self._skull, _HAND)

    def pointing(self, markers: NDArray[np.floating]) -> tuple[FloatArray, FloatArray]:
        """Return how far a hand is from each shape, and where it points.

        Parameters
        ----------
        markers : ndarray, shape (T, 113, 3)
            Millimetres.

        Returns
        -------
        shapes : ndarray, shape (T, 9)
            As in `distances`.
        tips : ndarray, shape (T, 9, 3)
            Tip of the finger that each shape points with, against the head, mm.
        """
        hand = self.seen_from_head(markers)
        return self._shapes(hand), hand[:, _TIPS_OF]

    def _shapes(self, hand: FloatArray) -> FloatArray:
        return shapes_apart(
            hand[:, _BACK - layout.N_FACE],
            hand[:, _FINGERS - layout.N_FACE],
            self._back,
            self.fingers,
            outlier_mm=rigid.OUTLIER_MM,
            rounds=_ROUNDS,
        )


def classes_of(voice: Voice) -> Classes:
    """Return the keys of a voice's gesture table, to compare its moving hand with."""
    table, n = voice.gestures, len(SHAPES) * len(PLACEMENTS)
    params = np.zeros((n, len(voice.layout)), dtype=np.float32)
    face = len(voice.face_columns) - table.neutral_head.size
    hand = table.shape_targets.shape[1]
    params[:, face : face + hand] = np.repeat(table.shape_targets, len(PLACEMENTS), axis=0)
    params[:, face + hand : face + hand + table.neutral_head.size] = table.neutral_head
    params[:, face + hand + table.neutral_head.size :] = table.placement_targets.reshape(n, -1)
    markers = voice.reconstruct(params).astype(np.float64)
    return Classes(markers.reshape(len(SHAPES), len(PLACEMENTS), *markers.shape[1:]))


def _against_head(
    markers: FloatArray, skull: FloatArray, wanted: NDArray[np.int64] | slice = _ALL
) -> FloatArray:
    """Return some markers as seen from the head, whose rigid markers come to lie on `skull`."""
    motion, _ = rigid.estimate_motion(skull, markers[:, _RIGID_FACE])
    return rigid.inverse_rigid_motion(markers[:, wanted], motion)


def shown_keys(
    markers: NDArray[np.floating],
    score: Score,
    classes: Classes,
    *,
    rate_hz: float,
    start_s: float = 0.0,
    options: CueingOptions = DEFAULT_OPTIONS,
) -> list[Shown]:
    """Return how long each key of a score is shown by a hand.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
        Millimetres.
    score : Score
    classes : Classes
        Of the cuer.
    rate_hz, start_s : float
        Clock of the frames.
    options : CueingOptions
        Tells which gaps between keys return to rest.
    """
    shapes, placements = classes.distances(markers)
    return keys_shown_at(
        shapes, placements, score, rate_hz=rate_hz, start_s=start_s, options=options
    )


def keys_shown_at(
    shapes: FloatArray,
    placements: FloatArray,
    score: Score,
    *,
    rate_hz: float,
    start_s: float,
    options: CueingOptions,
) -> list[Shown]:
    """Return the same by a hand's distances.

    Parameters
    ----------
    shapes, placements : ndarray, shapes (T, 9) and (T, 9, 6)
        See `Classes.distances`.
    score, rate_hz, start_s, options
        As for `shown_keys`.
    """
    fine = int(max(1, round(_FINE_HZ / rate_hz)))
    at = np.arange(0, max(len(shapes) - 1, 0) + 0.5 / fine, 1 / fine)
    best = _finer(shapes, at).argmin(axis=1)
    # A place counts where the shape is its own: the nearest one's will do.
    where = _finer(placements, at, best).argmin(axis=1)
    rate = rate_hz * fine
    found: list[Shown] = []
    groups = _groups(score.keys, options.rest_gap_s)
    free_s = -np.inf
    for number, group in enumerate(groups):
        key = group[0]
        until = groups[number + 1][0].start if number + 1 < len(groups) else np.inf
        earliest = max(key.start - _BEFORE_S, free_s)
        latest = min(max(group[-1].end, until) + 0.1, group[-1].end + _AFTER_S)
        first, last = (
            int(np.clip(round((t - start_s) * rate), 0, len(best))) for t in (earliest, latest)
        )
        # Shown: nearest to its shape and its placement, for the longest run within its time.
        own = best[first:last] == key.shape
        own &= where[first:last] == PLACEMENT_NUMBER[key.placement]
        begin, length = longest_run(own)
        shown_s = start_s + (first + begin) / rate
        if length:
            free_s = shown_s + length / rate
        found += [Shown(item, shown_s, length / rate) for item in group]
    return found


def _finer(
    values: FloatArray, at: FloatArray, which: NDArray[np.int64] | None = None
) -> FloatArray:
    """Return the values (T, ...) at moments between them, of `which` of the second axis if set."""
    low = np.minimum(at.astype(np.int64), len(values) - 1)
    high = np.minimum(low + 1, len(values) - 1)
    part = (at - low)[:, None]
    one, other = (values[i] if which is None else values[i, which] for i in (low, high))
    return np.asarray(one * (1 - part) + other * part)


def _groups(keys: Sequence[Key], rest_gap_s: float) -> list[list[Key]]:
    """Return keys, those that repeat the one before without a rest together."""
    groups: list[list[Key]] = []
    for key in keys:
        before = groups[-1][-1] if groups else None
        if (
            before is not None
            and (before.shape, before.placement) == (key.shape, key.placement)
            and key.start - before.end < rest_gap_s
        ):
            groups[-1].append(key)
        else:
            groups.append([key])
    return groups


def longest_run(mask: NDArray[np.bool_]) -> tuple[int, int]:
    """Return begin and length of the longest run of true values, 0 and 0 if there is none."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    if not len(edges):
        return 0, 0
    lengths = edges[:, 1] - edges[:, 0]
    best = int(lengths.argmax())
    return int(edges[best, 0]), int(lengths[best])


def peak_speed(markers: NDArray[np.floating], rate_hz: float) -> float:
    """Return the greatest speed of the knuckles against the head, m/s."""
    x = np.asarray(markers, dtype=np.float64)
    if len(x) < 2:
        return 0.0
    return peak_speed_of(_against_head(x, x[0, _RIGID_FACE], _HAND), rate_hz)


def peak_speed_of(hand: FloatArray, rate_hz: float) -> float:
    """Return the same of a hand (T, 50, 3) as `Classes.seen_from_head` gives it."""
    knuckles = hand[:, _KNUCKLES - layout.N_FACE]
    steps = np.linalg.norm(np.diff(knuckles, axis=0), axis=2)
    return float(steps.max(initial=0.0) * rate_hz / 1000.0)
