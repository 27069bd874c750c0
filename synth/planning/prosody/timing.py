"""Words to phones with times, fitted into the interval of their subtitle.

In: words with pauses and an interval.  Out: phones on a grid of 20 ms.  The speech rate follows
the room: between `SLOWEST` and `FASTEST` phones a second it fills the interval; a longer
interval keeps the slowest rate and pauses, a shorter one first shortens the pauses, then borrows
the gap to the next subtitle, then compresses up to `HARDEST`, and words for which even that
leaves no room are left out.  The last two are reported.

The limits are the 5th and 95th percentile of the articulation rate of read French
(enst-camille, 1001 sentences: 8.8, 10.6, 12.5 phones a second at 5, 50, 95 %).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE
from codec.cues.score import Phone
from codec.errors import CueError
from synth.language.text.normalise import PAUSES, SHORT_PAUSE
from synth.language.text.words import Word
from synth.planning.prosody.duration import predict_durations

GRID_HZ = 50
"""Phone boundaries stand on multiples of 1/50 s, the step of the bitstream's times.

Half a step is 10 ms, under the 20 ms to which labels of speech are repeatable, and a key that
is sent is exactly the key that is received.
"""

SLOWEST, FASTEST, HARDEST = 8.8, 12.5, 20.0
"""Phones a second: never slower, not faster without a warning, never faster."""

PAUSE_S = dict.fromkeys(PAUSES, 0.46) | {SHORT_PAUSE: 0.28}
"""Natural pauses: quartiles of the pauses inside sentences of enst-camille."""

SHORTEST_PAUSE_S = 0.06
"""Seconds of a pause that still reads as one."""

LONGEST_PAUSE_S = 1.0
"""Seconds to which a pause is stretched at most."""


@dataclass(frozen=True, slots=True)
class CaptionFit:
    """The phones of one subtitle, and how they were made to fit.

    Attributes
    ----------
    phones : tuple of Phone
    rate : float
        Articulation rate in phones a second.
    borrowed_s : float
        How far the speech runs over the end of its subtitle.
    left_out : int
        Words at the end that had no room.
    """

    phones: tuple[Phone, ...]
    rate: float
    borrowed_s: float = 0.0
    left_out: int = 0


def on_grid(time_s: float) -> float:
    """Return the point of the grid nearest to `time_s`.

    Examples
    --------
    >>> on_grid(1.0099), on_grid(1.011)
    (1.0, 1.02)
    """
    return round(time_s * GRID_HZ) / GRID_HZ


def speak(words: Sequence[Word], start_s: float) -> CaptionFit:
    """Return the words at their natural rate from `start_s` on."""
    durations = _natural(words)
    pauses = np.array([PAUSE_S.get(word.pause, 0.0) for word in words])
    rate = len(durations) / float(durations.sum()) if len(durations) else 0.0
    return CaptionFit(_place(words, durations, pauses, start_s), rate)


def fit(
    words: Sequence[Word], start_s: float, end_s: float, limit_s: float, *, whole: bool = False
) -> CaptionFit:
    """Fit words into the interval of their subtitle.

    Parameters
    ----------
    words : sequence of Word
    start_s, end_s : float
        The interval in seconds.
    limit_s : float
        Start of the next subtitle: the gap from `end_s` to it may be borrowed.
    whole : bool
        Keep every word at whatever rate, off the grid: the speaker says them all.

    Raises
    ------
    CueError
        If the interval is empty.

    Examples
    --------
    >>> from synth.language.text.pronounce import phonemise
    >>> found = fit(phonemise("Bonjour à tous."), 1.0, 1.9, 2.0)
    >>> found.phones[0].start, found.phones[-1].end <= 1.9, round(found.rate, 1)
    (1.0, True, 12.5)
    """
    if end_s <= start_s:
        raise CueError(f"interval from {start_s} to {end_s} s is empty")
    kept = list(words)
    limit_s = max(limit_s, end_s)
    while kept and not whole and _shortest(kept, HARDEST) > limit_s - start_s:
        kept.pop()
    if not kept:
        return CaptionFit((), 0.0, 0.0, len(words))
    until_s = min(limit_s, max(end_s, start_s + _shortest(kept, FASTEST)))
    durations = _natural(kept)
    pauses = np.array([PAUSE_S.get(word.pause, 0.0) for word in kept])
    rate, pauses = _share(len(durations), pauses, until_s - start_s)
    durations *= len(durations) / rate / durations.sum()
    place = _place_freely if whole else _place
    phones = place(kept, durations, pauses, start_s)
    return CaptionFit(phones, rate, max(0.0, phones[-1].end - end_s), len(words) - len(kept))


def _natural(words: Sequence[Word]) -> NDArray[np.float64]:
    """Return the natural durations of all phones of `words` in a row, in seconds."""
    line = [symbol for word in words for symbol in (*word.phones, *(PAUSE if word.pause else ""))]
    durations = predict_durations(line)
    return durations[[symbol != PAUSE for symbol in line]]


def _shortest(words: Sequence[Word], rate: float) -> float:
    n_pauses = sum(bool(word.pause) for word in words)
    return sum(len(word.phones) for word in words) / rate + n_pauses * SHORTEST_PAUSE_S


def _share(n: int, pauses: NDArray[np.float64], room_s: float) -> tuple[float, NDArray[np.float64]]:
    """Return the rate and the pauses that share `room_s` among `n` phones and the pauses."""
    inner = pauses > 0
    least = np.where(inner, SHORTEST_PAUSE_S, 0.0)
    if n / SLOWEST + pauses.sum() <= room_s:
        slack = room_s - n / SLOWEST
        stretch = min(slack / pauses.sum(), 2.0) if inner.any() else 1.0
        return SLOWEST, np.asarray(np.minimum(pauses * stretch, LONGEST_PAUSE_S))
    if n / FASTEST + pauses.sum() <= room_s:
        return n / float(room_s - pauses.sum()), pauses
    if n / FASTEST + least.sum() <= room_s:
        share = (room_s - n / FASTEST - least.sum()) / max((pauses - least).sum(), 1e-9)
        return FASTEST, np.asarray(least + share * (pauses - least))
    least *= min(1.0, 0.5 * room_s / max(float(least.sum()), 1e-9))
    return n / float(room_s - least.sum()), least


def _place(
    words: Sequence[Word],
    durations: NDArray[np.float64],
    pauses: NDArray[np.float64],
    start_s: float,
) -> tuple[Phone, ...]:
    """Return phones on the grid, each at least one step long."""
    phones: list[Phone] = []
    clock, step = start_s, round(start_s * GRID_HZ)
    remaining = iter(durations.tolist())
    for word, pause in zip(words, pauses.tolist(), strict=True):
        for symbol in word.phones:
            clock += next(remaining)
            after = max(step + 1, round(clock * GRID_HZ))
            phones.append(Phone(symbol, step / GRID_HZ, after / GRID_HZ))
            step = after
        if pause:
            clock += pause
            step = max(step + 1, round(clock * GRID_HZ))
    return tuple(phones)


def _place_freely(
    words: Sequence[Word],
    durations: NDArray[np.float64],
    pauses: NDArray[np.float64],
    start_s: float,
) -> tuple[Phone, ...]:
    """Return phones at their own times."""
    phones: list[Phone] = []
    clock = start_s
    remaining = iter(durations.tolist())
    for word, pause in zip(words, pauses.tolist(), strict=True):
        for symbol in word.phones:
            after = clock + next(remaining)
            phones.append(Phone(symbol, clock, after))
            clock = after
        clock += pause
    return tuple(phones)
