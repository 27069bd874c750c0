"""Phones of a text to their times in a recording of it.

In: the words of passages and the sound of each.  Out: phones with times.  Evidence in the
sound (`synth.planning.alignment.recogniser`) gives how well each phone fits each frame; the
recording is cut into the phones of the text, with the usual durations of phones as a prior, silence
and other speech allowed between words, and words that are not spoken left out. Source: segmental
Viterbi search with explicit durations (L. Rabiner 1989, section IV.D).

Models that adapt to the recording itself were tried and left out: models of each phone's cepstra,
estimated on the cuts that were found, moved the borders in 14 recordings by less than 1 ms in the
median.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES
from codec.cues.score import Phone
from synth.planning.alignment import _kernels
from synth.planning.alignment.recogniser import FRAME_RATE
from synth.planning.alignment.rows import (
    FILLER,
    OUTSIDE,
    SHORTEST_FRAMES,
    Row,
    SpokenPassage,
    is_phone,
    kinds_of,
    length_costs,
    row_of,
    skips_of,
)

__all__ = ["Aligned", "SpokenPassage", "align_passages"]

ROUNDS = 2
"""The second time the rate of speech is known."""

FILLER_COST = 3.3
"""Cost of a frame of other speech above the likeliest phone, in the logarithm: the right phones
cost 0.1 to 1.3 more than the likeliest, under music more, those of other texts 1.8 to 3.1."""

OUTSIDE_COST = 1.0
"""The same before and after a text without times, which may be of a part of the sound: less than
the phones of the text cost where others are spoken. Silence costs there what it costs in a pause:
otherwise a word is moved out of the text to the other side of a long pause."""

FILLER_ENTRY = 10.0
"""Cost of a stretch of other speech, however long; of 10 and 20 both misplace as few words."""

SKIP_COST = 100.0
"""Cost of a word that is not spoken, as much as some 30 frames of other speech."""

SLOPE = 0.17
"""Cost of each frame between a word and the subtitle that it begins outside."""

LEAST_FIT = -4.0
"""Log likelihood ratio of a word that is not spoken, and the least that any word has."""

_ENTRY = {PAUSE: 0.0, FILLER: FILLER_ENTRY, OUTSIDE: FILLER_ENTRY}

_BEST = len(PHONES)
"""Row of the costs of other speech."""


@dataclass(frozen=True, slots=True)
class Aligned:
    """Where the phones of a passage were found.

    Attributes
    ----------
    phones : tuple of Phone
        On the programme's clock. Those of words that are not spoken lie where they would be.
    fits : ndarray of float64, shape (words,)
        How much less likely the frames of each word are under its own phones than under the
        likeliest phone, in the logarithm per frame: 0 at best, `LEAST_FIT` for words that are not
        spoken.
    spoken : ndarray of bool, shape (words,)
        Whether the word was found at all.
    """

    phones: tuple[Phone, ...]
    fits: NDArray[np.float64]
    spoken: NDArray[np.bool_]


def align_passages(passages: Sequence[SpokenPassage]) -> list[Aligned]:
    """Return the phones of each passage with their times on the programme's clock.

    Parameters
    ----------
    passages : sequence of SpokenPassage

    Raises
    ------
    CueError
        If a passage is too short for its phones.

    Examples
    --------
    >>> from synth.planning.alignment.sound import mono
    >>> from synth.units.speech.espeak_voice import render
    >>> from synth.language.text.pronounce import phonemise
    >>> words = tuple(phonemise("Bonjour à tous."))
    >>> spoken = render([s for word in words for s in word.phones])
    >>> found = align_passages([SpokenPassage(words, mono(spoken.samples, 22_050))])[0].phones
    >>> max(abs(a.start - b.start) for a, b in zip(found, spoken.phones)) < 0.06
    True
    """
    return [_aligned(passage) for passage in passages]


def _aligned(passage: SpokenPassage) -> Aligned:
    if not passage.words:
        return Aligned((), np.zeros(0), np.zeros(0, np.bool_))
    costs = _costs(passage)
    row = row_of(passage, costs.shape[1] - 1)
    for _ in range(ROUNDS):
        _cut(row, costs)
    return _found(passage, row, costs)


def _costs(passage: SpokenPassage) -> NDArray[np.float64]:
    """Return running sums of the cost of each phone, and of other speech, in each frame."""
    cost = -passage.likelihoods().astype(np.float64).T
    silence = cost[PHONE_NUMBER[PAUSE]]
    best = np.delete(cost, PHONE_NUMBER[PAUSE], axis=0).min(axis=0)
    sums = np.zeros((len(cost) + 2, cost.shape[1] + 1))
    other = (best + FILLER_COST, np.minimum(best + OUTSIDE_COST, silence))
    np.cumsum(np.vstack([cost, *other]), axis=1, out=sums[:, 1:])
    return sums


def _cut(row: Row, costs: NDArray[np.float64]) -> None:
    """Cut a passage; keep the old cuts if nothing fits."""
    starts = np.zeros(len(row.symbols) + 1, np.int64)
    if _kernels.segment_into(
        costs, kinds_of(row.symbols),
        np.array([_ENTRY.get(symbol, -1.0) for symbol in row.symbols]), length_costs(row),
        SHORTEST_FRAMES, row.window, SLOPE, skips_of(row.symbols), SKIP_COST, starts,
    ):  # fmt: skip
        row.starts = starts


def _found(passage: SpokenPassage, row: Row, costs: NDArray[np.float64]) -> Aligned:
    phones: list[Phone] = []
    fits, said = np.full(len(passage.words), LEAST_FIT), np.zeros(len(passage.words), np.bool_)
    units = iter([unit for unit in row.units() if is_phone(unit[0])])
    for number, word in enumerate(passage.words):
        own = [next(units) for _ in word.phones]
        said[number] = own[-1][2] > own[0][1]
        if said[number]:
            fit = np.mean([_fit(PHONE_NUMBER[s], first, end, costs) for s, first, end in own])
            fits[number] = max(LEAST_FIT, float(fit))
        for symbol, first, end in own:
            start_s = passage.start_s + first / FRAME_RATE
            end_s = passage.start_s + max(end, first + 1) / FRAME_RATE
            phones.append(Phone(symbol, start_s, end_s))
    return Aligned(tuple(phones), fits, said)


def _fit(number: int, first: int, end: int, costs: NDArray[np.float64]) -> float:
    """Return how much less likely a phone is per frame than the likeliest in its place."""
    own = costs[number, end] - costs[number, first]
    best = costs[_BEST, end] - costs[_BEST, first]
    return float(best - own) / (end - first) - FILLER_COST
