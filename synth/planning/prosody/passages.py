"""A score cut into passages that are performed one after the other, in constant memory.

In: the pieces of a score in order of time.  Out: passages between silences, none much longer
than `LONGEST_S`, each with what sounds around it. Where a passage is cut depends on the score
alone, not on how it is cut into pieces.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from codec.cues.phonology import PAUSE
from codec.cues.score import Key, Phone, Score

SILENCE_S = 1.0
"""A silence of this length ends a passage."""

LONGEST_S = 30.0
"""A passage without such a silence is cut at its widest gap before it is longer than this."""

AROUND_S = 3.0
"""How much of its neighbours a passage knows."""

LEAD_S = 1.0
"""A passage reaches at most this far beyond its sounds; what lies between two is still."""

_SAME_S = 1e-6
"""Seconds within which times count as the same: what rounding leaves."""


@dataclass(frozen=True, slots=True)
class ScorePassage:
    """A stretch of a score that is performed in one go.

    Attributes
    ----------
    start_s, end_s : float
        On the programme's clock.
    score : Score
        The keys of the passage.
    around : Score
        The same with up to `AROUND_S` before and after it, at least one key of each
        neighbour: where the hand comes from, and until when it may rest.
    """

    start_s: float
    end_s: float
    score: Score
    around: Score


@dataclass(frozen=True, slots=True)
class _Sound:
    """The phones of one key; or one phone that no key shows."""

    phones: tuple[Phone, ...]
    key: Key | None

    @property
    def start(self) -> float:
        return self.phones[0].start

    @property
    def end(self) -> float:
        return self.phones[-1].end


def passages(pieces: Iterable[Score]) -> Iterator[ScorePassage]:
    """Yield the passages of a score.

    Parameters
    ----------
    pieces : iterable of Score
        In order of time; a whole score is one piece.

    Examples
    --------
    >>> line = tuple(Phone("a", start, start + 0.2) for start in (1.0, 1.3, 3.5))
    >>> [(p.start_s, p.end_s, len(p.score.phones)) for p in passages([Score(line, ())])]
    [(0.0, 2.5, 2), (2.5, 4.7, 1)]
    """
    groups = itertools.chain(_groups(_sounds(pieces)), [None])
    before: list[_Sound] = []
    own = next(groups)
    for after in groups:
        assert own is not None
        first, last = own[0].start, own[-1].end
        lead_s = min(LEAD_S, (first - before[-1].end) / 2) if before else LEAD_S
        tail_s = min(LEAD_S, (after[0].start - last) / 2) if after else LEAD_S
        earlier = [s for s in before if s.end > first - AROUND_S] or before[-1:]
        later = [s for s in after or () if s.start < last + AROUND_S] or (after or [])[:1]
        yield ScorePassage(
            first - lead_s, last + tail_s, _score(own), _score([*earlier, *own, *later])
        )
        before, own = own, after


def _sounds(pieces: Iterable[Score]) -> Iterator[_Sound]:
    """Yield the phones of a score by their keys."""
    for piece in pieces:
        phones = [phone for phone in piece.phones if phone.symbol != PAUSE]
        keys = iter(piece.keys)
        key = next(keys, None)
        at = 0
        while at < len(phones):
            while key is not None and key.end <= phones[at].start + _SAME_S:
                key = next(keys, None)
            if key is None or key.start > phones[at].start + _SAME_S:
                yield _Sound((phones[at],), None)
                at += 1
                continue
            end = at + 1
            while end < len(phones) and phones[end].start < key.end - _SAME_S:
                end += 1
            yield _Sound(tuple(phones[at:end]), key)
            key = next(keys, None)
            at = end


def _groups(sounds: Iterable[_Sound]) -> Iterator[list[_Sound]]:
    """Yield the sounds of each passage."""
    group: list[_Sound] = []
    for sound in sounds:
        if group and sound.start - group[-1].end >= SILENCE_S:
            yield group
            group = []
        group.append(sound)
        if sound.end - group[0].start > LONGEST_S and len(group) > 1:
            cut = _widest_gap(group)
            yield group[:cut]
            group = group[cut:]
    if group:
        yield group


def _widest_gap(group: list[_Sound]) -> int:
    """Return the number of the sound after the widest gap in the second half of a passage."""
    later = [i for i in range(1, len(group)) if group[i].start - group[0].start > LONGEST_S / 2]
    return max(later or [1], key=lambda i: (round(group[i].start - group[i - 1].end, 6), i))


def _score(sounds: list[_Sound]) -> Score:
    phones = tuple(phone for sound in sounds for phone in sound.phones)
    return Score(phones, tuple(sound.key for sound in sounds if sound.key is not None))
