"""A reading to breath groups: stretches between two silences, checked.

In: a text and the sound of its reading, with other sound before and after. Out: stretches
of the sound with their phones. The whole is aligned; readers of verse sound mute vowels and link
words where speech does not, so the sounds at the ends of words correct the phones, and the
whole is aligned once more. Kept are the groups whose words all fit their sound.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES, VOWELS
from codec.cues.score import Phone
from synth.language.text.words import Word
from synth.planning.alignment.align import Aligned, SpokenPassage, align_passages
from synth.planning.alignment.recogniser import FRAME_RATE, FS

_PAUSE_S = 0.12
"""Least silence in seconds between two words that ends a group."""

_MARGIN_S = 0.15
"""Silence that a group keeps on either side, at most."""

_CLOSE_S, _LONGEST_S = 0.6, 8.0
"""Groups so close to each other make one recording, up to this length."""

_QUIET = 0.1
"""Strength of a silence at most, of that of the speech: 20 dB below it."""

_LEAST_WORD, _LEAST_MEAN = -2.2, -0.9
"""Fit of the worst word of a group, and of its phones in the mean, at least."""

_SHORT_WORD = 2
"""Words of so few phones may fit badly: one that is heard as its neighbour (o, ɔ) is all of it."""

_LEAST_PHONE_S = 0.025
"""A phone that is cut shorter was hardly there."""

_MUTE = ("ə", "ø", "œ")
"""Sounds of a mute vowel."""

_MUTE_FRAMES, _LINK_FRAMES = 4, 3
"""Hundredths of a second for which a mute vowel, or a linking consonant, must be the likeliest."""

_LINKS = {"s": "z", "x": "z", "z": "z", "t": "t", "d": "t", "n": "n", "r": "ʁ", "p": "p"}
"""Silent letters at the ends of words, and how they sound before a vowel."""


@dataclass(frozen=True, slots=True)
class BreathGroup:
    """A stretch of speech between two silences.

    Attributes
    ----------
    start_s, end_s : float
        The stretch of the recording, with silence on either side.
    phones : tuple of Phone
        On the recording's clock.
    """

    start_s: float
    end_s: float
    phones: tuple[Phone, ...]


def joined_groups(groups: Sequence[BreathGroup]) -> Iterator[BreathGroup]:
    """Yield groups that follow each other closely as one, up to some seconds.

    Examples
    --------
    >>> a, b = (BreathGroup(t, t + 1, (Phone("a", t + 0.2, t + 0.8),)) for t in (0.0, 1.2))
    >>> [(group.start_s, group.end_s) for group in joined_groups([a, b])]
    [(0.0, 2.2)]
    """
    last: BreathGroup | None = None
    for group in groups:
        if last is not None and (
            group.start_s - last.end_s <= _CLOSE_S and group.end_s - last.start_s <= _LONGEST_S
        ):
            last = BreathGroup(last.start_s, group.end_s, last.phones + group.phones)
            continue
        if last is not None:
            yield last
        last = group
    if last is not None:
        yield last


def breath_groups(passage: SpokenPassage) -> list[BreathGroup]:
    """Return the groups of a reading whose words all fit their sound.

    Parameters
    ----------
    passage : SpokenPassage
        The whole text and the whole sound; its clock begins with the sound.

    Raises
    ------
    CueError
        If the sound is too short for the text.
    """
    passage = replace(passage, heard=passage.likelihoods())
    found = align_passages([passage])[0]
    words = tuple(_as_heard(passage, found))
    if words != passage.words:
        passage = replace(passage, words=words)
        found = align_passages([passage])[0]
    return list(_groups(passage, found))


def _by_word(words: Sequence[Word], found: Aligned) -> list[tuple[Phone, ...]]:
    phones = iter(found.phones)
    return [tuple(itertools.islice(phones, len(word.phones))) for word in words]


def _as_heard(passage: SpokenPassage, found: Aligned) -> Iterator[Word]:
    """Yield the words with the mute vowels and links that were heard."""
    likely = passage.likelihoods()
    best = np.argmax(np.delete(likely, PHONE_NUMBER[PAUSE], axis=1), axis=1)
    names = [symbol for symbol in PHONES if symbol != PAUSE]
    spoken = _by_word(passage.words, found)
    for number, (word, phones) in enumerate(zip(passage.words, spoken, strict=True)):
        if not found.spoken[number]:
            yield word
            continue
        follows = spoken[number + 1][0] if number + 1 < len(spoken) else None
        before = spoken[number - 1][-1] if number else None
        last = phones[-1]
        until_s = last.end + _PAUSE_S
        if follows is not None:
            until_s = min(until_s, (follows.start + follows.end) / 2)
        symbols = list(word.phones)
        ending = _sounding(best, names, _MUTE, last.start, until_s)
        # A mute e that is not heard is dropped, one that is heard after a consonant added.
        if last.symbol == "ə" and len(symbols) > 2 and ending < _MUTE_FRAMES:
            symbols.pop()
        elif last.symbol not in VOWELS and _mute_at_end(word.text) and ending >= _MUTE_FRAMES:
            symbols.append("ə")
        link = _link(passage.words[number - 1].text if number else "", word)
        # A liaison consonant counts if it is heard between the words.
        if link and before is not None and phones[0].start - before.end < _PAUSE_S:
            middle = (phones[0].start + phones[0].end) / 2
            heard = _sounding(best, names, (link,), (before.start + before.end) / 2, middle)
            if heard >= _LINK_FRAMES and before.symbol != link:
                symbols.insert(0, link)
        yield replace(word, phones=tuple(symbols))


def _mute_at_end(text: str) -> bool:
    return text.endswith(("e", "es", "ent"))


def _link(before: str, word: Word) -> str:
    """Return the consonant that may link two words, "" if none may."""
    starts_with_vowel = word.phones[0] in VOWELS and not word.text.startswith("h")
    return _LINKS.get(before[-1:], "") if starts_with_vowel else ""


def _sounding(
    best: NDArray[np.int64], names: Sequence[str], wanted: Sequence[str], from_s: float, to_s: float
) -> int:
    """Return for how many frames in a row some phones are the likeliest."""
    first, end = round(from_s * FRAME_RATE), round(to_s * FRAME_RATE)
    longest = run = 0
    for number in best[first:end].tolist():
        run = run + 1 if names[number] in wanted else 0
        longest = max(longest, run)
    return longest


def _groups(passage: SpokenPassage, found: Aligned) -> Iterator[BreathGroup]:
    spoken = _by_word(passage.words, found)
    level = np.sqrt(np.mean(passage.samples**2)) + 1e-12
    first = 0
    for number, phones in enumerate(spoken):
        end_s = phones[-1].end
        last = number + 1 == len(spoken)
        next_s = len(passage.samples) / FS if last else spoken[number + 1][0].start
        if not last and next_s - end_s < _PAUSE_S:
            continue
        group = spoken[first : number + 1]
        before_s = spoken[first - 1][-1].end if first else 0.0
        start_s = group[0][0].start
        fits = found.fits[first : number + 1]
        shortest = min(p.end - p.start for word in group for p in word)
        lengths = np.array([len(word) for word in group])
        worst = fits[lengths > _SHORT_WORD].min(initial=0.0)
        sure = worst >= _LEAST_WORD and np.average(fits, weights=lengths) >= _LEAST_MEAN
        from_s = max(0.0, start_s - min(_MARGIN_S, (start_s - before_s) / 2))
        to_s = end_s + min(_MARGIN_S, (next_s - end_s) / 2)
        # The ends of a file that is cut closely hold nothing else.
        before = 0.0 if not first and start_s < _CLOSE_S else _level(passage, from_s, start_s)
        after = 0.0 if last and next_s - end_s < _CLOSE_S else _level(passage, end_s, to_s)
        quiet = max(before, after) < _QUIET * level
        if sure and quiet and shortest >= _LEAST_PHONE_S and found.spoken[first : number + 1].all():
            yield BreathGroup(from_s, to_s, tuple(p for word in group for p in word))
        first = number + 1


def _level(passage: SpokenPassage, from_s: float, to_s: float) -> float:
    """Return the strength of the quieter half of a stretch."""
    x = passage.samples[round(from_s * FS) : round(to_s * FS)]
    return float(np.median(np.abs(x))) if len(x) else 0.0
