"""How alike two motions are: their markers in millimetres, their keys in number.

Both are taken on the programme's clock over the time that they share. A key of the first counts
as correct if the second has the same shape and placement within the time that a viewer forgives.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from codec.layout import N_FACE
from codec.motion import Motion
from codec.score import Key
from codec.voice import Voice
from cuecast.motions import RATE_HZ, check_voice
from receiver.render import sample_params

FORGIVEN_S = 0.1
"""A cue may be this late at most (architecture: 33 ms unnoticed, 100 ms at most)."""

_LARGEST_OFFSET_S = 1.0
_BLOCK = 1024
_MARGIN_S = 0.02
"""A key that starts this close to the beginning of what was received may lack its first phone."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Result of `compare`; lengths in mm, times in seconds.

    Attributes
    ----------
    marker_rms_mm, hand_rms_mm, face_rms_mm : float
        Root mean square distance between the markers of both: all, of the hand, of the face.
    keys_total : int
        Keys of the first motion within the time that both share.
    keys_correct : int
        Those that the second motion has too.
    offset_s : float
        How much later the second motion moves than the first.
    shared_s : float
        Length of the time that both share.
    """

    marker_rms_mm: float
    hand_rms_mm: float
    face_rms_mm: float
    keys_total: int
    keys_correct: int
    offset_s: float
    shared_s: float

    def as_dict(self) -> dict[str, Any]:
        """Return the fields under the names of the command line's JSON."""
        return {
            "marker_rms_mm": round(self.marker_rms_mm, 4),
            "hand_rms_mm": round(self.hand_rms_mm, 4),
            "face_rms_mm": round(self.face_rms_mm, 4),
            "keys_total": self.keys_total,
            "keys_correct": self.keys_correct,
            "offset_s": round(self.offset_s, 4),
            "shared_s": round(self.shared_s, 3),
        }


def compare(a: Motion, b: Motion, voice: Voice) -> Comparison:
    """Compare motion `b` with motion `a`, both of `voice`.

    Raises
    ------
    VoiceError
        If a motion was made with another voice.
    CueError
        If the motions share no time.
    """
    for motion in (a, b):
        check_voice(motion, voice)
    start = max(a.start_s, b.start_s)
    end = min(a.start_s + a.duration_s, b.start_s + b.duration_s)
    if end - start < 2 / RATE_HZ:
        raise CueError(
            f"the motions share no time: {a.start_s:.2f}..{a.start_s + a.duration_s:.2f} s and "
            f"{b.start_s:.2f}..{b.start_s + b.duration_s:.2f} s"
        )
    times = start + np.arange(int((end - start) * RATE_HZ)) / RATE_HZ
    face, hand = _marker_rms(sample_params(a, times), sample_params(b, times), voice)
    n_markers = face.size + hand.size
    whole = np.sqrt((np.sum(face**2) + np.sum(hand**2)) / n_markers)
    total, correct = count_keys(
        a.score.keys if a.score else (), b.score.keys if b.score else (), start, end
    )
    return Comparison(
        float(whole), float(np.sqrt(np.mean(hand**2))), float(np.sqrt(np.mean(face**2))),
        total, correct, _offset(a, b, times), end - start,
    )  # fmt: skip


def _marker_rms(
    p: NDArray[np.float32], q: NDArray[np.float32], voice: Voice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the root mean square distance of every face and hand marker over time."""
    squares = np.zeros(113)
    for at in range(0, len(p), _BLOCK):  # constant memory: markers are many
        x = voice.reconstruct(p[at : at + _BLOCK]).astype(np.float64)
        y = voice.reconstruct(q[at : at + _BLOCK]).astype(np.float64)
        squares += ((x - y) ** 2).sum(axis=(0, 2))
    rms = np.sqrt(squares / len(p))
    return rms[:N_FACE], rms[N_FACE:]


def count_keys(
    sent: tuple[Key, ...], received: tuple[Key, ...], start_s: float, end_s: float
) -> tuple[int, int]:
    """Count the keys of `sent` within a stretch of time, and those of them that were received.

    Examples
    --------
    >>> key = Key(1.0, 1.2, ("b", "a"), 4, "side")
    >>> late = Key(1.05, 1.25, ("b", "a"), 4, "side")
    >>> count_keys((key,), (late,), 0.0, 2.0), count_keys((key,), (), 0.0, 2.0)
    ((1, 1), (1, 0))
    """
    inside = [k for k in sent if k.start >= start_s + _MARGIN_S and k.end <= end_s]
    first, correct = 0, 0
    for key in inside:
        while first < len(received) and received[first].start < key.start - FORGIVEN_S:
            first += 1
        for other in received[first:]:
            if other.start > key.start + FORGIVEN_S:
                break
            if (other.shape, other.placement) == (key.shape, key.placement):
                correct += 1
                break
    return len(inside), correct


def _offset(a: Motion, b: Motion, times: NDArray[np.float64]) -> float:
    """Return the delay of `b` against `a` at which their parameters' speeds agree best."""
    step = 1 / RATE_HZ
    lags = np.arange(-round(_LARGEST_OFFSET_S * RATE_HZ), round(_LARGEST_OFFSET_S * RATE_HZ) + 1)
    inner = times[
        (times >= times[0] + _LARGEST_OFFSET_S) & (times <= times[-1] - _LARGEST_OFFSET_S)
    ]
    if len(inner) < 10:
        return 0.0
    scale = sample_params(a, inner).std(axis=0) + 1e-6
    x = np.diff(sample_params(a, inner), axis=0) / scale
    score = np.array(
        [np.sum(x * np.diff(sample_params(b, inner + lag * step), axis=0) / scale) for lag in lags]
    )
    best = int(score.argmax())
    if not 0 < best < len(lags) - 1 or score[best] <= 0:
        return 0.0
    left, top, right = score[best - 1 : best + 2]
    curvature = left - 2 * top + right
    between = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float((lags[best] + between) * step)
