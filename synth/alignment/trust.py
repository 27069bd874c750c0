"""Whether a text and a sound belong together, and how sure every subtitle is.

A text can be aligned to any sound: models that adapt to what was found fit music as well. What
tells is the comparison with other words on the same sound, aligned in the same way: where the
programme is noisy both fit badly, where text and sound do not belong together both fit alike.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from synth.alignment.align import Aligned, Passage, align
from synth.text.pronounce import phonemise
from synth.text.sentences import read_sentences
from synth.text.words import Word

LEAST_EVIDENCE = 3.0
"""Standard errors by which the words must fit better than other words. Measured: 4.6 to 10.3 in
passages of 26 to 50 s of several speakers that belong together, less in clips of 10 s; below 2.3 in
126 pairs of seven voices and other texts, below 1.4 with music as loud as the voice, -1.3 to 3.1
where a third of the words was not in the text."""

FEWEST_WORDS = 8
"""Fewer words than twice these do not tell an offset."""

TEXTS = 3
"""Other texts with which the words are compared."""


@dataclass(frozen=True, slots=True)
class Trust:
    """How well words fit their sound, against others.

    Attributes
    ----------
    evidence : float
        Difference of the means in standard errors.
    own, other : float
        Mean fit of the words, and of others in their place.
    spread : float
        Standard deviation of the fits of others.
    """

    evidence: float
    own: float
    other: float
    spread: float

    @property
    def holds(self) -> bool:
        """Whether text and sound belong together."""
        return self.evidence >= LEAST_EVIDENCE

    @property
    def leans(self) -> bool:
        """Whether the words fit better than others at all: not enough to be sure.

        Measured on 55 sounds of one to seven words: so do 89 % with their own text, 55 % with
        another one.
        """
        return self.evidence > 0

    def confidence(self, fits: NDArray[np.float64]) -> float:
        """Return 0 for words that fit like any others, 1 for such as fit like their neighbours."""
        if not self.holds or not len(fits):
            return 0.0
        share = (float(fits.mean()) - self.other) / max(self.own - self.other, 1e-9)
        return min(max(share, 0.0), 1.0)


def trust(passages: Sequence[Passage], found: Sequence[Aligned]) -> Trust:
    """Compare the words that were aligned with others in their place.

    Parameters
    ----------
    passages : sequence of Passage
    found : sequence of Aligned
        What `synth.alignment.align.align` found in them.
    """
    own = _fits(found)
    if not len(own):
        return Trust(0.0, 0.0, 0.0, 1.0)
    other = [_fits(align(strangers)) for strangers in decoys(passages)]
    means = np.array([fits.mean() for fits in other if len(fits)])
    every = np.concatenate([np.zeros(0), *other])
    if not len(every):
        return Trust(0.0, float(own.mean()), 0.0, 1.0)
    error = np.sqrt(own.var() / len(own) + every.var() / len(every) + means.var()) + 1e-9
    evidence = float((own.mean() - means.mean()) / error)
    return Trust(evidence, float(own.mean()), float(means.mean()), float(every.std()) + 1e-9)


def _fits(found: Sequence[Aligned]) -> NDArray[np.float64]:
    return np.concatenate([np.zeros(0), *(item.fits for item in found)])


def decoys(passages: Sequence[Passage]) -> Iterator[list[Passage]]:
    """Yield the passages with other words, of no more phones, from a list of sentences."""
    phones = sum(len(word.phones) for p in passages for word in p.words)
    strangers = _strangers(TEXTS * phones)
    for _ in range(TEXTS):
        yield _with_other_words(passages, strangers)


def _with_other_words(passages: Sequence[Passage], strangers: list[Word]) -> list[Passage]:
    result = []
    for passage in passages:
        room = sum(len(word.phones) for word in passage.words)
        words: list[Word] = []
        while strangers and room > 0:
            word = strangers.pop()
            room -= len(word.phones)
            if room >= 0 or not words:
                words.append(word)
        expected = passage.expected_s
        if expected is not None and words:
            places = np.linspace(0, len(expected) - 1, len(words)).round().astype(int)
            expected = expected[places]
        result.append(replace(passage, words=tuple(words), expected_s=expected))
    return [passage for passage in result if passage.long_enough]


def _strangers(phones: int) -> list[Word]:
    """Return words of sentences that nobody said here, last one first."""
    sentences = read_sentences()
    words: list[Word] = []
    phones += 2 * TEXTS * 20
    for number in count():
        if phones <= 0:
            return words[::-1]
        said = phonemise(sentences[number % len(sentences)])
        words += said
        # Every passage may waste one word that does not fit.
        phones -= sum(len(word.phones) for word in said[1:])
    return words
