"""Which phones a key stands for: those of its shape and placement that look most like the lips.

The lips about a key, at several moments, are brought to few components (principal ones, Pearson
1901); consonants and vowels each have a normal distribution there with a common covariance (linear
discriminants, Fisher 1936), drawn towards a round one since examples are few.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.cueing import NO_CONSONANT_SHAPE, NO_VOWEL_PLACEMENT, PLACEMENT_OF, SHAPE_OF
from codec.cues.score import PLACEMENTS
from cuecast.evaluate.reading.reader import Asked, CueReader, ReaderTake, ReadKey
from cuecast.evaluate.reading.view import RATE_HZ, TakeView

FloatArray = NDArray[np.float64]

_MOMENTS_S = np.array([-0.17, -0.1, -0.03, 0.03, 0.1, 0.17, 0.27, 0.37])
"""When the lips are looked at, seconds from the first frame of a key: the vowel's lips come about
0.17 s after the hand."""

_COMPONENTS = 5
"""Components of the lips at each moment."""

_ROUND = 0.2
"""How far the covariance is drawn towards a round one."""

_ALIKE = {"ə": "ø", "œ": "ø", "ɔ": "o", "ɑ": "a"}
"""Phones that the labels of real takes, or speakers, do not keep apart."""

NONE = ""
"""The consonant of a vowel alone, the vowel of a consonant alone."""


def canonical(phone: str) -> str:
    """Return the phone that stands for those that count as the same."""
    return _ALIKE.get(phone, phone)


_CONSONANTS_OF = {
    shape: {canonical(c) for c, own in SHAPE_OF.items() if own == shape}
    | ({NONE} if shape == NO_CONSONANT_SHAPE else set())
    for shape in set(SHAPE_OF.values())
}
_VOWELS_OF = {
    number: {canonical(v) for v, own in PLACEMENT_OF.items() if own == name}
    | ({NONE} if name == NO_VOWEL_PLACEMENT else set())
    for number, name in enumerate(PLACEMENTS)
}


def parts(one: Asked) -> tuple[str, str]:
    """Return consonant and vowel of a key."""
    vowel = canonical(one.phones[-1]) if one.phones[-1] in PLACEMENT_OF else NONE
    consonant = canonical(one.phones[0]) if one.phones[0] in SHAPE_OF else NONE
    return consonant, vowel


@dataclass(frozen=True, slots=True)
class _Discriminants:
    """Classes over the lips: names, means (C, D), inverse of the covariance (D, D), log priors."""

    names: tuple[str, ...]
    means: FloatArray
    precision: FloatArray
    priors: FloatArray

    def best(self, x: FloatArray, among: set[str]) -> str:
        """Return the likeliest class of a row (D,) among some; the first known if none is."""
        away = self.means - x
        fit = self.priors - 0.5 * np.einsum("ci,ij,cj->c", away, self.precision, away)
        known = [number for number, name in enumerate(self.names) if name in among]
        if not known:
            return min(among)
        return self.names[max(known, key=lambda number: float(fit[number]))]


def _discriminants(x: FloatArray, names: Sequence[str]) -> _Discriminants:
    known = tuple(sorted(set(names)))
    of = np.array([known.index(name) for name in names])
    means = np.stack([x[of == number].mean(0) for number in range(len(known))])
    within = (x - means[of]).T @ (x - means[of]) / len(x)
    size = len(within)
    within = (1 - _ROUND) * within + _ROUND * np.trace(within) / size * np.eye(size)
    counts = np.bincount(of, minlength=len(known))
    return _Discriminants(known, means, np.linalg.inv(within), np.log(counts / len(x)))


@dataclass(frozen=True, slots=True)
class LipReader:
    """A fitted model of lips.

    Attributes
    ----------
    mean, axes : ndarray of float64, shapes (24,) and (24, `_COMPONENTS`)
        Of the lips' components.
    consonants, vowels : _Discriminants
    """

    mean: FloatArray
    axes: FloatArray
    consonants: _Discriminants
    vowels: _Discriminants

    def phones(self, seen: TakeView, keys: Sequence[ReadKey]) -> list[str]:
        """Return the phones of keys that were read, in order."""
        out: list[str] = []
        for key in keys:
            x = _about(seen, key.begin, self.mean, self.axes)
            consonant = self.consonants.best(x, _CONSONANTS_OF[key.shape])
            among = _VOWELS_OF[key.place]
            # No key stands for no phone.
            vowel = self.vowels.best(x, among - {NONE} if consonant == NONE else among)
            out += [phone for phone in (consonant, vowel) if phone != NONE]
        return out


def teach_lips(takes: Sequence[ReaderTake], reader: CueReader) -> LipReader:
    """Return the lip readings of takes, at the keys where the reader finds them."""
    raised = [take.view.lips[take.view.raised] for take in takes]
    every = np.concatenate(raised)
    mean = every.mean(0)
    _, _, axes = np.linalg.svd(every - mean, full_matrices=False)
    main = axes[:_COMPONENTS].T
    x, consonants, vowels = [], [], []
    for take in takes:
        line = reader.align(take)
        for number, one in enumerate(take.asked):
            at = np.flatnonzero(line == 2 * number + 2)
            x.append(_about(take.view, int(at[0]), mean, main))
            consonant, vowel = parts(one)
            consonants.append(consonant)
            vowels.append(vowel)
    rows = np.array(x)
    return LipReader(mean, main, _discriminants(rows, consonants), _discriminants(rows, vowels))


def _about(seen: TakeView, begin: int, mean: FloatArray, axes: FloatArray) -> FloatArray:
    at = np.clip(begin + np.round(_MOMENTS_S * RATE_HZ).astype(int), 0, len(seen) - 1)
    return np.asarray(((seen.lips[at] - mean) @ axes).ravel())
