"""How long each phone of a French sentence lasts when read aloud.

A sum of regression trees over the phone, its neighbours and its place between two pauses, in
integers of one microsecond, so that every machine gives the same durations. The trees were grown
by `lab.durations` on the labels of one reader (enst-camille, CC BY-SA 4.0).
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, VOWELS
from codec.errors import CueError
from codec.files.npz import read_arrays

ASSET = Path(__file__).parents[2] / "assets" / "durations.npz"

_MAX_ASSET_BYTES = 4_000_000
"""Bytes of the asset, unpacked, at most."""

_REACH = 3
"""Phones on either side that the trees look at."""

_LONGEST_COUNT = 255
"""Largest count that fits into the trees' bytes."""

_MANNER = dict.fromkeys(VOWELS, 0) | {
    symbol: manner
    for manner, symbols in enumerate(
        ("p t k", "b d g", "f s ʃ", "v z ʒ", "m n ɲ ŋ", "l ʁ", "j ɥ w", "ɑ̃ ɔ̃ ɛ̃ œ̃", PAUSE), 1
    )
    for symbol in symbols.split()
}
"""Class of each phone: oral vowels, stops, fricatives, nasals, liquids, glides, nasal vowels."""


@dataclass(frozen=True, slots=True)
class DurationTrees:
    """Regression trees of equal size, as arrays.

    Attributes
    ----------
    rank : ndarray of uint8, shape (38,)
        Phones ranked by their mean duration, the first feature of each neighbour.
    feature, threshold, left, right : ndarray of uint8, shape (trees, nodes)
        A sample goes left where its feature does not exceed the threshold; a leaf points to
        itself.
    value : ndarray of int16, shape (trees, nodes)
        Contribution of a leaf in microseconds.
    base_us : int
        Mean duration in microseconds.
    """

    rank: NDArray[np.uint8]
    feature: NDArray[np.uint8]
    threshold: NDArray[np.uint8]
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    value: NDArray[np.int16]
    base_us: int

    def predict_us(self, features: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Return durations in microseconds, shape (n,), of features of shape (n, columns)."""
        count, size = self.feature.shape
        first = size * np.arange(count)
        row = features.shape[1] * np.arange(len(features))[:, None]
        node = np.zeros((len(features), count), dtype=np.uint8)
        while True:
            at = first + node
            goes_left = features.take(row + self.feature.take(at)) <= self.threshold.take(at)
            below = np.where(goes_left, self.left.take(at), self.right.take(at))
            if np.array_equal(below, node):
                break
            node = below
        return np.asarray(self.base_us + self.value.take(at).sum(axis=1, dtype=np.int64))


def features(symbols: Sequence[str], rank: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the features of the trees, shape (n, 19), for a line of phones and pauses.

    Parameters
    ----------
    symbols : sequence of str
        IPA symbols of `codec.cues.phonology.PHONES`; the line's ends count as pauses.
    rank : ndarray of uint8, shape (38,)
        Rank of each phone number.
    """
    margin = [PAUSE] * _REACH
    padded = [*margin, *symbols, *margin]
    ranks = rank[[PHONE_NUMBER[s] for s in padded]]
    manners = np.array([_MANNER[s] for s in padded], dtype=np.uint8)
    n = len(symbols)
    columns = [line[k : k + n] for line in (ranks, manners) for k in range(2 * _REACH + 1)]
    ahead = _counts(symbols)
    behind = [counted[::-1] for counted in _counts(symbols[::-1])]
    counts = [*ahead, *behind, np.minimum(ahead[0] + behind[0], _LONGEST_COUNT)]
    columns += [c.astype(np.uint8) for c in counts]
    return np.stack(columns, axis=1)


def _counts(symbols: Sequence[str]) -> list[NDArray[np.int64]]:
    """Return the phones and the vowels since the last pause, both with the phone itself."""
    result = np.zeros((2, len(symbols)), dtype=np.int64)
    phones = vowels = 0
    for i, symbol in enumerate(symbols):
        if symbol == PAUSE:
            phones = vowels = 0
        else:
            phones += 1
            vowels += symbol in VOWELS
        result[:, i] = min(phones, _LONGEST_COUNT), min(vowels, _LONGEST_COUNT)
    return [result[0], result[1]]


def predict_durations(symbols: Sequence[str]) -> NDArray[np.float64]:
    """Predict how long the phones of a line last at a reader's normal rate.

    Parameters
    ----------
    symbols : sequence of str
        Phones in IPA, with ``"_"`` for pauses.

    Returns
    -------
    ndarray of float64, shape (n,)
        Seconds, at least 0.02; 0 for pauses, whose length is the caller's.

    Raises
    ------
    CueError
        If a symbol is not a phone of French.

    Examples
    --------
    >>> [round(float(d), 2) for d in predict_durations(["b", "ɔ̃", "ʒ", "u", "ʁ"])]
    [0.11, 0.14, 0.09, 0.21, 0.14]
    """
    unknown = [s for s in symbols if s not in PHONE_NUMBER]
    if unknown:
        raise CueError(f"unknown phone {unknown[0]!r}")
    if not symbols:
        return np.zeros(0)
    trees = _trees()
    seconds = trees.predict_us(features(symbols, trees.rank)) * 1e-6
    pause = np.array([s == PAUSE for s in symbols])
    return np.where(pause, 0.0, np.maximum(seconds, 0.02))


@functools.cache
def _trees() -> DurationTrees:
    arrays = read_arrays(ASSET, max_bytes=_MAX_ASSET_BYTES)
    base_us = int(arrays.pop("base_us"))
    return DurationTrees(base_us=base_us, **arrays)
