"""Comparison of two motions: distances of their markers, agreement of their keys, offset."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import N_FACE
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key
from codec.errors import CueError, check_kind

Array = NDArray[np.float64]

KEY_TOLERANCE_S = 0.1
"""A key counts as right if it starts at most so much earlier or later."""

_RATE_HZ = 50.0
"""Rate in Hz at which two motions are compared, that of the bitstream's ticks."""

_MAX_OFFSET_S = 1.0
"""Offset in seconds that is looked for either way: more than any lag of a receiver."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """How alike two motions are.

    Attributes
    ----------
    marker_rms_mm, hand_rms_mm, face_rms_mm : float
        RMS distance of all markers, those of the hand, those of the face.
    keys_total, keys_correct : int
        Keys of the first motion within the common time, and how many the second one has too.
    offset_s : float
        Delay of the second motion against the first at which they agree best.

    Examples
    --------
    >>> from codec import compare_motions, load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> motion = motion_of(score_of_text("Oui"), voice)
    >>> found = compare_motions(motion, motion, voice)
    >>> found.marker_rms_mm, found.keys_correct
    (0.0, 1)
    """

    marker_rms_mm: float
    hand_rms_mm: float
    face_rms_mm: float
    keys_total: int
    keys_correct: int
    offset_s: float


def compare_motions(a: Motion, b: Motion, voice: Voice) -> Comparison:
    """Compare motion `b` with motion `a` where both are defined.

    Distances are measured as the motions stand, the offset is only reported.

    Parameters
    ----------
    a, b : Motion
        Of the same voice, at any rates.
    voice : Voice

    Returns
    -------
    Comparison

    Raises
    ------
    CueError
        If they have no time in common or belong to another voice.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> motion = motion_of(score_of_text("Oui"), voice)
    >>> compare_motions(motion, motion, voice).offset_s
    0.0
    """
    for motion in (a, b):
        check_kind(motion, Motion, "compare_motions", "load_motion reads one")
        voice.check_motion(motion)
    begin = max(a.start_s, b.start_s)
    end = min(a.start_s + a.duration_s, b.start_s + b.duration_s)
    if end - begin < 1 / _RATE_HZ:
        raise CueError(f"the motions have {max(0.0, end - begin):.3f} s in common")
    times = begin + np.arange(int((end - begin) * _RATE_HZ + 1e-6)) / _RATE_HZ
    params = [at_times(motion, times) for motion in (a, b)]
    squares = _squared_distances(params[0], params[1], voice)
    total, correct = _keys(a, b, begin, end)
    return Comparison(
        float(np.sqrt(squares.mean())),
        float(np.sqrt(squares[:, N_FACE:].mean())),
        float(np.sqrt(squares[:, :N_FACE].mean())),
        total,
        correct,
        _offset(params[0], params[1]),
    )


def at_times(motion: Motion, times: Array) -> Array:
    """Return parameters at `times` (seconds), shape (T, P), interpolated linearly."""
    own = motion.times_s
    return np.stack([np.interp(times, own, column) for column in motion.params.T], axis=1)


def _squared_distances(a: Array, b: Array, voice: Voice) -> Array:
    """Return squared distances of all markers, shape (T, 113), computed by pieces."""
    pieces = []
    for start in range(0, len(a), 3000):
        part = slice(start, start + 3000)
        gap = voice.reconstruct(a[part]).astype(np.float64) - voice.reconstruct(b[part])
        pieces.append(np.square(gap).sum(axis=-1))
    return np.concatenate(pieces)


def _keys(a: Motion, b: Motion, begin: float, end: float) -> tuple[int, int]:
    def within(motion: Motion) -> list[Key]:
        keys: Sequence[Key] = motion.score.keys if motion.score else ()
        return [key for key in keys if begin <= key.start < end - KEY_TOLERANCE_S]

    sent, received = within(a), list(b.score.keys if b.score else ())
    correct, place = 0, 0
    for key in sent:
        while place < len(received) and received[place].start < key.start - KEY_TOLERANCE_S:
            place += 1
        for i in range(place, len(received)):
            if received[i].start > key.start + KEY_TOLERANCE_S:
                break
            if (received[i].shape, received[i].placement) == (key.shape, key.placement):
                correct, place = correct + 1, i + 1
                break
    return len(sent), correct


def _offset(a: Array, b: Array) -> float:
    """Return the delay of `b` against `a` at which their mean squared difference is least."""
    spread = a.std(axis=0) + 1e-9
    x, y = a / spread, b / spread
    reach = min(int(_MAX_OFFSET_S * _RATE_HZ), len(x) - 1)

    def difference(lag: int) -> float:
        length = len(x) - abs(lag)
        return float(np.square(x[max(0, -lag) :][:length] - y[max(0, lag) :][:length]).mean())

    best = min(range(-reach, reach + 1), key=difference)
    if abs(best) == reach:
        return best / _RATE_HZ
    left, least, right = (difference(best + d) for d in (-1, 0, 1))
    # The vertex of the parabola through the minimum and its neighbours.
    bend = left - 2 * least + right
    return (best + (0.5 * (left - right) / bend if bend > 0 else 0.0)) / _RATE_HZ
