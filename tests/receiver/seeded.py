"""Seeded speech without sense, its keys, and the question whether a key shown had been sent."""

from collections.abc import Iterable

import numpy as np

from codec.cues.cueing import cue
from codec.cues.phonology import CONSONANTS, VOWELS
from codec.cues.score import Key, Phone, Score


def seeded_speech(duration_s: float, seed: int = 11) -> Score:
    """Phones on the codec's grid in groups with pauses between, the first at 0.3 s; their keys.

    The last group may end up to 2 s after `duration_s`.
    """
    rng = np.random.default_rng(seed)
    phones, time_s = [], 0.3
    while time_s < duration_s:
        for _ in range(int(rng.integers(4, 14))):
            kind = CONSONANTS if rng.random() < 0.55 else VOWELS
            length = 0.02 * int(rng.integers(3, 9))
            symbol = kind[int(rng.integers(len(kind)))]
            phones.append(Phone(symbol, round(time_s, 2), round(time_s + length, 2)))
            time_s = round(time_s + length, 2)
        time_s = round(time_s + 0.02 * int(rng.integers(5, 45)), 2)
    return Score(tuple(phones), tuple(cue(phones)))


def was_sent(key: Key, sent: Iterable[Key], zeros: Iterable[float], tolerance_s: float) -> bool:
    """Whether a key of this shape and placement was due near that time.

    Parameters
    ----------
    key : Key
        On the receiver's clock.
    sent : iterable of Key
        On the programme's clock.
    zeros : iterable of float
        Times on the receiver's clock at which the programme may have begun.
    tolerance_s : float
        Beside a loss the start of a key is known by a nominal length only.
    """
    return any(
        (key.shape, key.placement) == (other.shape, other.placement)
        and abs(key.start - zero_s - other.start) < tolerance_s
        for zero_s in zeros
        for other in sent
    )
