"""Whether a text and a sound belong together, and how sure every subtitle is.

A text can be aligned to any sound: models that adapt to what was found fit music as well. What
tells is the comparison with other words on the same sound, aligned in the same way: where the
programme is noisy both fit badly, where text and sound do not belong together both fit alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from synth.alignment.align import Aligned, Passage, align
from synth.text.pronounce import phonemise
from synth.text.sentences import read_sentences
from synth.text.words import Word

LEAST_EVIDENCE = 3.0
"""Standard errors by which the words must fit better than other words. Measured on three readers
and two pieces of music: 10 and more where they belong together, 5 to 9 with music 5 dB below the
voice, 0 to 4 with music as loud; between -3.3 and 1.0 where they do not."""

FEWEST_WORDS = 8
"""Fewer words than this are believed: they are too few to judge."""


@dataclass(frozen=True, slots=True)
class Trust:
    """How well words fit their sound, against others.

    Attributes
    ----------
    evidence : float
        Difference of the means in standard errors.
    own, other : float
        Mean fit of the words, and of others in their place.
    """

    evidence: float
    own: float
    other: float

    @property
    def holds(self) -> bool:
        """Whether text and sound belong together."""
        return self.evidence >= LEAST_EVIDENCE

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
    own = np.concatenate([np.zeros(0), *(item.fits for item in found)])
    if len(own) < FEWEST_WORDS:
        mean = float(own.mean()) if len(own) else 0.0
        return Trust(LEAST_EVIDENCE, mean, 0.0)
    strangers = decoys(passages)
    other = np.concatenate([np.zeros(0), *(item.fits for item in align(strangers))])
    error = np.sqrt(own.var() / len(own) + other.var() / len(other)) + 1e-9
    evidence = float((own.mean() - other.mean()) / error)
    return Trust(evidence, float(own.mean()), float(other.mean()))


def decoys(passages: Sequence[Passage]) -> list[Passage]:
    """Return the passages with other words, of no more phones, from a list of sentences."""
    strangers = _strangers(sum(len(word.phones) for p in passages for word in p.words))
    result = []
    for passage in passages:
        room = sum(len(word.phones) for word in passage.words)
        words: list[Word] = []
        while strangers and room > 0:
            word = strangers.pop()
            room -= len(word.phones)
            if room >= 0 or not words:
                words.append(word)
        result.append(Passage(tuple(words), passage.samples, passage.start_s))
    return [passage for passage in result if passage.long_enough]


def _strangers(phones: int) -> list[Word]:
    """Return words of sentences that nobody said here, last one first."""
    sentences = read_sentences()
    words: list[Word] = []
    for number in count():
        if phones <= 0:
            return words[::-1]
        said = phonemise(sentences[number % len(sentences)])
        words += said
        # Every passage may waste one word that does not fit.
        phones -= sum(len(word.phones) for word in said[1:])
    return words
