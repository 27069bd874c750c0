"""Whether a text and a sound belong together, and how sure every subtitle is.

A text can be aligned to any sound. The evidence is the comparison with other words on the same
sound, aligned in the same way: where the programme is noisy both fit badly, where text and sound do
not belong together both fit alike. The logarithms of likelihood are those of
`synth.planning.alignment.recogniser`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from synth.language.text.pronounce import phonemise
from synth.language.text.sentences import read_sentences
from synth.language.text.words import Word
from synth.planning.alignment.align import LEAST_FIT, Aligned, SpokenPassage, align_passages

LEAST_EVIDENCE = 3.0
"""Least advantage over other words, in standard errors. Measured: 7.3 to 12 with the
right text, 5.6 to 9.8 where a third of the words is not in it, 0.8 to 6.7 under music as loud as
the voice; below 2.2 with other texts."""

LEANING_EVIDENCE = 1.5
"""From which a text without times is cut by its sound."""

FEWEST_WORDS = 8
"""Fewer words than twice these give no offset."""

TEXT_SPREAD = 0.25
"""Standard deviation of the mean fit of other texts on one sound: 0.09 to 0.28 in 18 clips."""

WITHIN_S = 0.165
"""A word counts as found within two thirds of a usual key."""

NEAR = 2
"""Words on either side whose fit bears on a word's place as well."""

CERTAIN = 0.97
"""Least confidence of a certain word: 98 % of such words are within `WITHIN_S`."""

_LOGISTIC = (0.45, 1.81, 6.08)
"""Weights of a word's fit and of that of its neighbours, and constant: a logistic regression on the
accepted words of four programmes; `cuecast evaluate alignment` shows its worth on others."""

TEXTS = 3
"""Other texts that the words are compared with."""


@dataclass(frozen=True, slots=True)
class AlignmentTrust:
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

    @property
    def leans(self) -> bool:
        """Whether the words fit better than others at all: not enough to be sure."""
        return self.evidence >= LEANING_EVIDENCE

    def confidence(self, fits: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how likely each word of a row is found within `WITHIN_S` of its time.

        Parameters
        ----------
        fits : ndarray of float64, shape (words,)
            Of words that follow each other, as `Aligned.fits`.

        Returns
        -------
        ndarray of float64, shape (words,)
            0 where text and sound do not belong together.
        """
        if not self.holds:
            return np.zeros(len(fits))
        return certainty(fits)


def certainty(fits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how likely each word of a row that belongs to its sound is where it was found.

    Parameters
    ----------
    fits : ndarray of float64, shape (words,)

    Examples
    --------
    >>> certainty(np.array([-0.2, -0.4, -3.0, -2.5])).round(2).tolist()
    [0.98, 0.96, 0.88, 0.8]
    """
    near = np.array([fits[max(0, i - NEAR) : i + NEAR + 1].mean() for i in range(len(fits))])
    by_own, by_near, constant = _LOGISTIC
    return np.asarray(1 / (1 + np.exp(-(by_own * fits + by_near * near + constant))))


def trust(passages: Sequence[SpokenPassage], found: Sequence[Aligned]) -> AlignmentTrust:
    """Compare the words that were aligned with others in their place.

    Parameters
    ----------
    passages : sequence of SpokenPassage
    found : sequence of Aligned
        What `synth.planning.alignment.align.align_passages` found in them.
    """
    own = _fits(found)
    if not len(own):
        return AlignmentTrust(0.0, LEAST_FIT, LEAST_FIT)
    known = [replace(passage, heard=passage.likelihoods()) for passage in passages]
    other = [fits for strangers in decoys(known) if len(fits := _fits(align_passages(strangers)))]
    if not other:
        return AlignmentTrust(0.0, float(own.mean()), float(own.mean()))
    every = np.concatenate(other)
    mean = float(np.mean([fits.mean() for fits in other]))
    error = np.sqrt(own.var() / len(own) + every.var() / len(every) + TEXT_SPREAD**2)
    return AlignmentTrust(float((own.mean() - mean) / error), float(own.mean()), mean)


def _fits(found: Sequence[Aligned]) -> NDArray[np.float64]:
    return np.concatenate([np.zeros(0), *(item.fits for item in found)])


def decoys(passages: Sequence[SpokenPassage]) -> Iterator[list[SpokenPassage]]:
    """Yield the passages with other words, of no more phones, from a list of sentences."""
    phones = sum(len(word.phones) for p in passages for word in p.words)
    strangers = _strangers(TEXTS * phones)
    for _ in range(TEXTS):
        yield _with_other_words(passages, strangers)


def _with_other_words(
    passages: Sequence[SpokenPassage], strangers: list[Word]
) -> list[SpokenPassage]:
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
