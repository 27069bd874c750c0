"""The melody of read French: a falling line with a movement at the end of every group.

French has its accent on the last full syllable of a group. There the pitch rises before a pause
that continues, rises farther where a question ends, and falls at the end of a statement, over a
declining baseline (Vaissière 1991; Di Cristo 1998). Interrogations that begin with their asking
word and exclamations fall from a high start (Delattre 1966). Numbers are those of an adult woman
reading. Where a phone does not know its contour, the length of the silence behind it decides.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, VOWELS
from codec.cues.score import SENTENCE_ENDS, Phone

_GROUP_GAP_S = 0.02
"""Seconds of silence that end a group."""

_SENTENCE_GAP_S = 0.4
"""Seconds of silence that end a sentence, where the text does not say that it goes on."""

_BREATH_S = 1.0
"""Seconds of silence after which the baseline starts anew in any case."""

_KNOT_S = 0.01
"""Seconds between the points of the melody's curve."""

MOVEMENT_ST = {
    "continuation": 4.5,
    "statement": -5.0,
    "question": 9.0,
    "interrogation": -6.0,
    "exclamation": -7.0,
}
"""Movement of a group's last full vowel, in semitones. Delattre's four levels of pitch, some
three semitones apart: a continuation goes from level 2 to 3 or 4, a question from 2 to above 4,
the others down to 1."""

ONSET_ST = {"interrogation": 6.0, "exclamation": 4.0}
"""Rise of a sentence's start in semitones, level 4 instead of 2; it falls from there."""

_LEVEL_ASKED = 0.4
"""Share of the baseline's decline that is left in a question (Di Cristo 1998, section 3.2)."""


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
    phones: Sequence[Phone], *, f0_hz: float = 205.0, declination_st_per_s: float = -1.5
) -> Melody:
    """Return the melody of a line of phones.

    Parameters
    ----------
    phones : sequence of Phone
        In order of time; gaps and contours separate groups and sentences.
    f0_hz : float
        Frequency at the onset of a statement.
    declination_st_per_s : float
        Slope of the baseline in semitones per second; it levels off after four seconds.

    Examples
    --------
    >>> said = [Phone("m", 0.0, 0.1), Phone("a", 0.1, 0.4)]
    >>> asked = [said[0], Phone("a", 0.1, 0.4, "question")]
    >>> start, end = np.array([0.1]), np.array([0.4])
    >>> [bool(plan_melody(line).at(end)[0] > plan_melody(line).at(start)[0])
    ...  for line in (said, asked)]
    [False, True]
    """
    found = accents(phones)
    if not found:
        return Melody(np.zeros(1), np.full(1, f0_hz))
    times: list[NDArray[np.float64]] = []
    semitones: list[NDArray[np.float64]] = []
    for accent in found:
        knots = np.append(np.arange(accent.group_s, accent.after_s, _KNOT_S), accent.after_s)
        line = declination_st_per_s * 4.0 * np.tanh((knots - accent.sentence_s) / 4.0)
        if accent.ends == "question":
            line *= _LEVEL_ASKED
        past = (knots - accent.sentence_s) / max(accent.last_s - accent.sentence_s, _KNOT_S)
        line += ONSET_ST.get(accent.ends, 0.0) * np.clip(1.0 - past, 0.0, 1.0)
        part = np.clip((knots - accent.start_s) / (accent.end_s - accent.start_s), 0.0, 1.0)
        line += MOVEMENT_ST[accent.contour] * part * part * (3 - 2 * part)
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
    contour : str
        How the group ends, one of `codec.cues.score.CONTOURS` but not "".
    ends : str
        How its sentence ends.
    sentence_s, last_s : float
        Start of the sentence and end of its last accent.
    group_s, after_s : float
        Start and end of the group.
    """

    start_s: float
    end_s: float
    contour: str
    ends: str
    sentence_s: float
    last_s: float
    group_s: float
    after_s: float

    @property
    def falls(self) -> bool:
        """Whether the pitch falls here: a sentence ends, and is no question."""
        return MOVEMENT_ST[self.contour] < 0


def accents(phones: Sequence[Phone]) -> list[Accent]:
    """Return the accents of a line of phones, one for each group.

    Examples
    --------
    >>> line = [Phone("m", 0.0, 0.1), Phone("a", 0.1, 0.4), Phone("l", 0.4, 0.5)]
    >>> [(accent.start_s, accent.contour) for accent in accents(line)]
    [(0.1, 'statement')]
    """
    found = []
    for sentence in _split([p for p in phones if p.symbol != PAUSE], _ends_sentence):
        groups = _split(sentence, _ends_group)
        vowels = [_accented(group) for group in groups]
        ends = sentence[-1].contour or "statement"
        for group, vowel in zip(groups, vowels, strict=True):
            found.append(
                Accent(
                    vowel.start,
                    max(vowel.end, vowel.start + 1e-3),
                    ends if group is groups[-1] else "continuation",
                    ends,
                    sentence[0].start,
                    vowels[-1].end,
                    group[0].start,
                    group[-1].end,
                )
            )
    return found


def _accented(group: Sequence[Phone]) -> Phone:
    full = [p for p in group if p.symbol in VOWELS and p.symbol != "ə"]
    return (full or group)[-1]


def _ends_sentence(before: Phone, after: Phone) -> bool:
    gap_s = after.start - before.end
    if before.contour in SENTENCE_ENDS:
        return True
    return gap_s >= (_BREATH_S if before.contour else _SENTENCE_GAP_S)


def _ends_group(before: Phone, after: Phone) -> bool:
    return after.start - before.end >= _GROUP_GAP_S


def _split(phones: Sequence[Phone], ends: Callable[[Phone, Phone], bool]) -> list[list[Phone]]:
    """Split a line where `ends` says so of two neighbours."""
    parts = [[phone] for phone in phones[:1]]
    for before, after in itertools.pairwise(phones):
        if ends(before, after):
            parts.append([])
        parts[-1].append(after)
    return parts
