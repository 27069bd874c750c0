"""The melody of read French: a falling line with a rise at the end of every group.

French has its accent on the last full syllable of a group: the pitch rises there before a pause
that continues and falls at the end of a sentence, over a declining baseline (Vaissière 1991;
Di Cristo 1998). Numbers are those of an adult woman reading.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, VOWELS
from codec.cues.score import Phone

_GROUP_GAP_S = 0.02
"""Seconds of silence that end a group."""

_SENTENCE_GAP_S = 0.4
"""Seconds of silence that end a sentence."""

_KNOT_S = 0.01
"""Seconds between the points of the melody's curve."""


@dataclass(frozen=True, slots=True)
class Melody:
    """Fundamental frequency over time, linear between knots.

    Attributes
    ----------
    time_s : ndarray of float64, shape (k,)
        Ascending.
    f0_hz : ndarray of float64, shape (k,)
    """

    time_s: NDArray[np.float64]
    f0_hz: NDArray[np.float64]

    def at(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the frequency in Hz at `time_s`, constant beyond the ends."""
        return np.interp(time_s, self.time_s, self.f0_hz)


def plan_melody(
    phones: Sequence[Phone],
    *,
    f0_hz: float = 205.0,
    declination_st_per_s: float = -1.5,
    rise_st: float = 4.5,
    fall_st: float = -5.0,
) -> Melody:
    """Return the melody of a line of phones.

    Parameters
    ----------
    phones : sequence of Phone
        In order of time; gaps separate groups, gaps of 0.4 s or more sentences.
    f0_hz : float
        Frequency at the onset of a sentence.
    declination_st_per_s : float
        Slope of the baseline in semitones per second; it levels off after four seconds.
    rise_st, fall_st : float
        Movement on the last vowel of a group, and of a sentence.

    Examples
    --------
    >>> line = [Phone("m", 0.0, 0.1), Phone("a", 0.1, 0.4)]
    >>> melody = plan_melody(line)
    >>> bool(melody.at(np.array([0.4]))[0] < melody.at(np.array([0.1]))[0])
    True
    """
    found = accents(phones)
    if not found:
        return Melody(np.zeros(1), np.full(1, f0_hz))
    times: list[NDArray[np.float64]] = []
    semitones: list[NDArray[np.float64]] = []
    for accent in found:
        knots = np.arange(accent.group_s, accent.after_s + _KNOT_S, _KNOT_S)
        line = declination_st_per_s * 4.0 * np.tanh((knots - accent.sentence_s) / 4.0)
        part = np.clip((knots - accent.start_s) / (accent.end_s - accent.start_s), 0.0, 1.0)
        line += (fall_st if accent.final else rise_st) * part * part * (3 - 2 * part)
        times.append(knots)
        semitones.append(line)
    time = np.concatenate(times)
    order = np.argsort(time, kind="stable")
    return Melody(time[order], f0_hz * 2 ** (np.concatenate(semitones)[order] / 12))


@dataclass(frozen=True, slots=True)
class Accent:
    """The last full syllable of a group.

    Attributes
    ----------
    start_s, end_s : float
        Its vowel, at least 1 ms.
    final : bool
        Whether the group ends a sentence.
    sentence_s, group_s, after_s : float
        Start of the sentence, start and end of the group.
    """

    start_s: float
    end_s: float
    final: bool
    sentence_s: float
    group_s: float
    after_s: float


def accents(phones: Sequence[Phone]) -> list[Accent]:
    """Return the accents of a line of phones, one for each group.

    Examples
    --------
    >>> line = [Phone("m", 0.0, 0.1), Phone("a", 0.1, 0.4), Phone("l", 0.4, 0.5)]
    >>> [(accent.start_s, accent.final) for accent in accents(line)]
    [(0.1, True)]
    """
    spoken = [p for p in phones if p.symbol != PAUSE]
    found = []
    for sentence in _split(spoken, _SENTENCE_GAP_S) if spoken else []:
        groups = _split(sentence, _GROUP_GAP_S)
        for group in groups:
            full = [p for p in group if p.symbol in VOWELS and p.symbol != "ə"]
            last = (full or group)[-1]
            found.append(
                Accent(
                    last.start, max(last.end, last.start + 1e-3), group is groups[-1],
                    sentence[0].start, group[0].start, group[-1].end,
                )
            )  # fmt: skip
    return found


def _split(phones: Sequence[Phone], gap_s: float) -> list[list[Phone]]:
    """Split a line at gaps of at least `gap_s`."""
    parts = [[phones[0]]]
    for before, after in itertools.pairwise(phones):
        if after.start - before.end >= gap_s:
            parts.append([])
        parts[-1].append(after)
    return parts
