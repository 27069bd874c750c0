"""The cuer's own clock: words with the times of the speaker in, words at a pace one can read out.

People speak 5 to 7 syllables a second and cue 2.5 to 4 (Attina 2005; Duchnowski et al. 2000): real
cuers were measured at 3.0 to 3.9 keys a second. She keeps to `Pace.keys_per_s`; `FASTER` bounds how
fast she is at any time, `_HURRY_S` for how long. Readers of human transliterators do best 0.6 to
1.8 s behind the speech (Krause and Lopez 2017), so she may fall behind the programme by
`Pace.max_lag_s`, and uses the pauses before and after speech: the time beyond the
least of each key is shared as evenly as the room allows. Words that still do not fit are left out:
first mute e, then words, function words first.

The even course is the taut string between the earliest and the latest time of each key (the
schedule of least greatest speed of Yao, Demers, Shenker 1995, for jobs that keep their order).
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.cueing import (
    DEFAULT_OPTIONS,
    NO_CONSONANT_SHAPE,
    NO_VOWEL_PLACEMENT,
    SHAPE_OF,
    CueingOptions,
)
from codec.cues.phonology import VOWELS
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, Phone
from codec.errors import CueError
from synth.language.subtitles import Subtitle
from synth.language.text.words import Word
from synth.planning.prosody.importance import importance, links
from synth.planning.prosody.key_times import Form, least_s
from synth.planning.prosody.simulation import (
    CLAIRE,
    PerformanceSimulation,
    PerformerChoice,
    mirror_of,
)
from synth.planning.prosody.taut_string import taut_string
from synth.planning.prosody.timing_optimiser import REST_ROOM_S
from synth.planning.prosody.visible_keys import GRID_HZ, SAME_S, Keys, Said, VisibleKeys, spans

FloatArray = NDArray[np.float64]

KEYS_PER_SYLLABLE = 1.41
"""Keys per syllable of French, by frequency of words (Lexique 3.83)."""

FASTER = 1.25
"""She is never faster than she means to be by more than this factor: every key gets its time."""

_HURRY_S = 6.0
"""What she may have saved by hurrying, against her even pace: half a minute a quarter faster."""

LEAD_S = 0.5
"""How far she may be ahead of the programme where that saves words."""

LONGEST_LAG_S = 1e6
"""Without a programme there is no lag: so long is any text."""

LONGEST_S = 30.0
"""Words are paced together up to this length of programme; then at the widest pause."""

_REACH_S = 8.0
"""Words this long before the place where she falls behind can still make room for it."""

_LEAST_PHONE_S = 0.04
"""Seconds that a phone keeps however dense the text: two ticks."""

_LONGEST_CONSONANT = 0.55
"""Of a key's length; consonants of cued syllables take 47 to 59 % (Attina 2005)."""

_LEAST_PAUSE_S = 0.06
"""Seconds of a pause that still reads as one."""

_PAUSE_FROM_S = 0.1
"""A silence of the speaker that is a pause, where the text has no mark for it."""

_RISE_S = 0.3
"""Nothing is shown earlier: the hand has to rise first."""


@dataclass(frozen=True, slots=True)
class Pace:
    """How the cuer's clock may differ from the programme's.

    Attributes
    ----------
    max_lag_s : float
        How far she may fall behind, 0 to `LONGEST_LAG_S`.
    syllables_per_s : float
        As slow as she goes where there is room, 1 to 8.
    keys_per_s : float
        As fast as she means to be, 1 to 10; never more than `FASTER` times as fast.

    Examples
    --------
    >>> Pace(keys_per_s=3.0).keys_per_s
    3.0
    """

    max_lag_s: float = 1.5
    syllables_per_s: float = 2.5
    keys_per_s: float = 4.0

    def __post_init__(self) -> None:
        if not 0 <= self.max_lag_s <= LONGEST_LAG_S:
            raise CueError(f"lag of {self.max_lag_s} s is not within 0..{LONGEST_LAG_S:g}")
        if not 1 <= self.syllables_per_s <= 8:
            raise CueError(f"{self.syllables_per_s} syllables/s are not within 1..8")
        if not 1 <= self.keys_per_s <= 10:
            raise CueError(f"{self.keys_per_s} keys/s are not within 1..10")

    @property
    def least_s(self) -> float:
        """Seconds that a key gets at least."""
        return 1.0 / (FASTER * self.keys_per_s)


READABLE = Pace()


@dataclass(frozen=True, slots=True)
class TimedWord:
    """A word with the programme's times of its phones.

    Attributes
    ----------
    word : Word
    phones : tuple of Phone
        On the programme's clock, as many as the word has.
    subtitle : Subtitle, optional
        Its subtitle.

    Examples
    --------
    >>> from synth.language.text.pronounce import phonemise
    >>> (word,) = phonemise("Oui")
    >>> TimedWord(word, (Phone("w", 1.0, 1.1), Phone("i", 1.1, 1.3))).word.text
    'oui'
    """

    word: Word
    phones: tuple[Phone, ...]
    subtitle: Subtitle | None = None


@dataclass(frozen=True, slots=True)
class PacedWord:
    """What became of a word.

    Attributes
    ----------
    source : TimedWord
    phones : tuple of Phone
        On the cuer's clock; none if the word is left out.
    lag_s : float
        How far she is behind the programme at its first key.
    mute : int
        Mute e that were left out.

    Examples
    --------
    >>> from synth.language.text.pronounce import phonemise
    >>> (word,) = phonemise("Oui")
    >>> timed = TimedWord(word, (Phone("w", 1.0, 1.1), Phone("i", 1.1, 1.3)))
    >>> (paced,) = pace_words([timed])
    >>> [phone.symbol for phone in paced.phones], paced.mute
    (['w', 'i'], 0)
    """

    source: TimedWord
    phones: tuple[Phone, ...]
    lag_s: float = 0.0
    mute: int = 0


def pace_words(
    words: Iterable[TimedWord],
    pace: Pace = READABLE,
    options: CueingOptions = DEFAULT_OPTIONS,
    performing: PerformerChoice = CLAIRE,
) -> Iterator[PacedWord]:
    """Yield the words on the cuer's clock, in order and in constant memory.

    Parameters
    ----------
    words : iterable of TimedWord
        In order of time.
    pace : Pace
    options : CueingOptions
        Where charts of the code differ.
    performing : PerformerChoice
        Who is to cue: what she would show is looked at.
    """
    before, even_s, mirror = Said(), 0.0, mirror_of(performing, options)
    for words_of_block in _blocks(words, pace):
        block = _Block(words_of_block, pace, options, before, even_s, mirror)
        yield from block.paced()
        before, even_s = block.before, block.even_s


def _blocks(words: Iterable[TimedWord], pace: Pace) -> Iterator[list[TimedWord]]:
    """Yield words that cannot hurry each other, or are enough for one time."""
    block: list[TimedWord] = []
    for word in words:
        if block and word.phones[0].start - block[-1].phones[-1].end > pace.max_lag_s + LEAD_S:
            yield block
            block = []
        block.append(word)
        if word.phones[-1].end - block[0].phones[0].start > LONGEST_S and len(block) > 1:
            cut = _widest_pause(block)
            yield block[:cut]
            block = block[cut:]
    if block:
        yield block


def _widest_pause(block: Sequence[TimedWord]) -> int:
    middle = block[0].phones[0].start + LONGEST_S / 2
    later = [i for i in range(1, len(block)) if block[i].phones[0].start > middle] or [
        len(block) - 1
    ]
    return max(
        later, key=lambda i: (round(block[i].phones[0].start - block[i - 1].phones[-1].end, 6), i)
    )


@dataclass(frozen=True, slots=True)
class _Draft:
    """Keys of the words that stay, as far as it takes to see whether there is time for them.

    `members`, `first`, `least` and `pause` are those of `Keys`; `forms` are shape, placement and
    number of phones.
    """

    members: list[list[tuple[int, int]]]
    forms: list[Form]
    first: list[float]
    least: list[float]
    pause: list[float]


class _Block:
    """Words that are paced together, after others.

    `before` are the keys before, and `even_s` the time of their end if she
    never hurried.
    """

    def __init__(
        self,
        words: Sequence[TimedWord],
        pace: Pace,
        options: CueingOptions,
        before: Said,
        even_s: float,
        mirror: PerformanceSimulation,
    ) -> None:
        self.even_s = even_s
        self._mirror = mirror
        self._words, self._pace, self._options, self.before = words, pace, options, before
        self._free_s = before.phones[-1].end if before.phones else _RISE_S
        self._latest_s = max(pace.max_lag_s - 0.5 / GRID_HZ, 0.0)
        self._kept = [True] * len(words)
        self._mute = [False] * len(words)
        symbols = {p.symbol for word in words for p in word.phones}
        self._placement = {x: options.placement(x) if x in VOWELS else "" for x in symbols}
        gaps = [b.phones[0].start - a.phones[-1].end for a, b in itertools.pairwise(words)]
        self._breaks = [
            bool(word.word.pause) or gap > _PAUSE_FROM_S
            for word, gap in zip(words, [*gaps, 0.0], strict=True)
        ]

    def paced(self) -> Iterator[PacedWord]:
        """Yield the words on the cuer's clock."""
        draft = self._with_room()
        keys = self._keys(draft)
        self.even_s = self._even(keys)
        start, length = self._schedule(keys, in_time=not self._late(draft, 0.0))
        found = spans(keys, start, length)
        lags = {
            member: self._lag_s(float(start[k] - keys.first[k]))
            for k, members in enumerate(keys.members)
            for member in members
        }
        for w, word in enumerate(self._words):
            phones = tuple(
                Phone(p.symbol, *found[w, i]) for i, p in enumerate(word.phones) if (w, i) in found
            )
            lag = next((lags[w, i] for i in range(len(word.phones)) if (w, i) in lags), 0.0)
            mute = sum(p.symbol == "ə" for p in word.phones) if self._mute[w] else 0
            yield PacedWord(word, phones, lag, mute)

    def _lag_s(self, found_s: float) -> float:
        """Return a lag without the excess over its bounds from rounding to the grid."""
        bounded_s = min(max(found_s, -LEAD_S), self._pace.max_lag_s)
        rounded = abs(found_s - bounded_s) <= 0.5 / GRID_HZ + SAME_S
        return bounded_s if rounded else found_s

    def _said(self) -> Iterator[tuple[int, int, bool]]:
        """Yield word and phone number of what stays, and whether a pause comes before it."""
        before = -1
        for w, word in enumerate(self._words):
            if not self._kept[w]:
                continue
            paused = any(self._breaks[max(before, 0) : w])
            orphan = w - before > 1 and w > 0 and links(word.word)
            for i, phone in enumerate(word.phones):
                silent = (i == 0 and orphan) or (self._mute[w] and phone.symbol == "ə")
                if not silent:
                    yield w, i, paused
                    paused = False
            before = w

    def _draft(self) -> _Draft:
        # A vowel joins the consonant before it unless a pause lies between them; any other phone
        # begins a key of its own.
        members: list[list[tuple[int, int]]] = []
        form: list[tuple[int, str]] = []
        paused: list[bool] = []
        open_consonant = False
        for w, i, after_pause in self._said():
            symbol = self._words[w].phones[i].symbol
            placement = self._placement[symbol]
            if placement and open_consonant and not after_pause:
                members[-1].append((w, i))
                form[-1] = form[-1][0], placement
                open_consonant = False
                continue
            open_consonant = not placement
            members.append([(w, i)])
            paused.append(after_pause and len(members) > 1)
            form.append(
                (SHAPE_OF[symbol], NO_VOWEL_PLACEMENT)
                if open_consonant
                else (NO_CONSONANT_SHAPE, placement)
            )
        forms = [(*two, len(m)) for two, m in zip(form, members, strict=True)]
        afters: list[Form | None] = [*forms[1:], None][: len(forms)]
        befores: list[Form | None] = [None, *forms[:-1]][: len(forms)]
        # At least: the gesture between neighbours, the shortest phones, and the pace's own limit.
        least = [
            max(least_s(before, here, after), _LEAST_PHONE_S * here[2], self._pace.least_s)
            for before, here, after in zip(befores, forms, afters, strict=True)
        ]
        first = [self._words[m[0][0]].phones[m[0][1]].start for m in members]
        return _Draft(members, forms, first, least, [_LEAST_PAUSE_S * x for x in paused])

    def _keys(self, draft: _Draft) -> Keys:
        phones = [[self._words[w].phones[i] for w, i in m] for m in draft.members]
        part = [
            (p[0].end - p[0].start) / max(p[-1].end - p[-1].start + p[0].end - p[0].start, SAME_S)
            for p in phones
        ]
        consonant = np.clip(part, 1 - _LONGEST_CONSONANT, _LONGEST_CONSONANT)
        said = np.array([sum(x.end - x.start for x in p) for p in phones])
        key = np.array(
            [len(PLACEMENTS) * f[0] + PLACEMENT_NUMBER[f[1]] for f in draft.forms], np.int64
        )
        symbols = [[p.symbol for p in x] for x in phones]
        first, least, pause = map(np.array, (draft.first, draft.least, draft.pause))
        return Keys(draft.members, first, least, pause, said, consonant, key, symbols)

    def _late(self, keys: _Draft, lead_s: float) -> tuple[int, int] | None:
        """Return the first key that comes too late at the quickest, and where the hurry began.

        So does one that could be there only if she had hurried for too long.
        """
        clock, begun = self._free_s, 0
        even, evenly = self.even_s, 0
        for k, (first, least, pause) in enumerate(
            zip(keys.first, keys.least, keys.pause, strict=True)
        ):
            latest = first + self._latest_s + SAME_S
            clock += pause
            if clock <= first - lead_s:
                clock, begun = first - lead_s, k
            if clock > latest:
                return begun, k
            if even <= first - lead_s:
                even, evenly = first - lead_s, k
            if even > latest + _HURRY_S:
                return evenly, k
            clock += least
            even += max(least, 1.0 / self._pace.keys_per_s)
        return None

    def _even(self, keys: Keys) -> float:
        """Return when she would have said all, had she never hurried."""
        even = self.even_s
        for first, least in zip(keys.first.tolist(), keys.least.tolist(), strict=True):
            even = max(even, first - LEAD_S) + max(least, 1.0 / self._pace.keys_per_s)
        return even

    def _with_room(self) -> _Draft:
        """Leave out what there is no time for, and return the keys of the rest."""
        keys, dropped = self._draft(), list[int]()
        # Mute e go first, then the least important word near the late key, until no key is late.
        while late := self._late(keys, LEAD_S):
            begun, k = late
            low, high = keys.members[begun][0][0], keys.members[k][0][0]
            since = keys.first[k] - _REACH_S
            near = [
                w
                for w in range(low, high + 1)
                if self._kept[w] and self._words[w].phones[-1].end >= since
            ]
            mute = [w for w in near if not self._mute[w] and _has_mute(self._words[w])]
            if mute:
                for w in mute:
                    self._mute[w] = True
            else:
                out = min(
                    near,
                    key=lambda w: (importance(self._words[w].word), -len(self._words[w].phones), w),
                )
                self._kept[out] = False
                dropped.append(out)
            keys = self._draft()
        # Greedy choices may drop too much: words come back, the most important first, if no key
        # gets late by it.
        for w in sorted(dropped, key=lambda w: (-importance(self._words[w].word), w)):
            self._kept[w] = True
            again = self._draft()
            if self._late(again, LEAD_S):
                self._kept[w] = False
            else:
                keys = again
        return keys

    def _schedule(self, keys: Keys, *, in_time: bool) -> tuple[FloatArray, FloatArray]:
        """Return start and length of each key, seconds; `in_time` if none needs a lead."""
        n = len(keys.first)
        if n == 0:
            return np.zeros(0), np.zeros(0)
        mean = float(keys.least.mean())
        ease = max(0.0, 1.0 / self._pace.keys_per_s - mean)
        slowest = max(0.0, 1.0 / (KEYS_PER_SYLLABLE * self._pace.syllables_per_s) - mean)
        place, taken = np.cumsum(np.append(0, keys.parts)), np.cumsum(np.append(0.0, keys.work))
        # The evenest course between earliest and latest starts; a lead only where there is no ease
        # without one.
        for lead_s in (0.0, LEAD_S):
            if lead_s == 0.0 and not in_time:
                continue
            early = np.maximum.accumulate(np.maximum(keys.first - lead_s, self._free_s))
            latest = keys.first + self._latest_s
            end = latest[-1] + max(keys.least[-1], keys.said[-1])
            even = taut_string(place, np.append(early, end) - taken, np.append(latest, end) - taken)
            spare = np.diff(even) / keys.parts
            if spare.min() >= min(ease, slowest):
                break
        due = even + taken
        extra = np.clip(spare, 0.0, slowest)
        length = keys.least + extra
        start, clock = np.empty(n), self._free_s
        for k in range(n):
            pause = keys.pause[k] + (extra[k - 1] if k and keys.pause[k] else 0.0)
            # start[k] = max(min(spoken, due), start[k - 1] + length[k - 1] + pause)
            start[k] = max(min(keys.first[k], due[k]), clock + pause)
            clock = start[k] + length[k]
        ends = start + np.maximum(length, keys.said)
        ends[:-1] = np.minimum(ends[:-1], start[1:] - keys.pause[1:])
        gap = start[1:] - ends[:-1]
        hurried = (gap >= self._options.rest_gap_s) & (gap < REST_ROOM_S)
        ends[:-1][hurried] = start[1:][hurried] - self._options.rest_gap_s + 2.0 / GRID_HZ
        early = np.minimum(np.maximum(keys.first - lead_s, self._free_s), start)
        late = keys.first + self._latest_s
        ends = start + np.maximum(ends - start, length)
        seen = VisibleKeys(keys, self._options, self.before, self._mirror, self._pace.least_s)
        start, length, self.before = seen.settled(start, ends, early, late)
        return start, length


def _has_mute(word: TimedWord) -> bool:
    symbols = {p.symbol for p in word.phones}
    return "ə" in symbols and len(symbols & set(VOWELS)) > 1
