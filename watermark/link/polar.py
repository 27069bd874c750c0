"""Polar codes of any length and rate: construction, encoding, list decoding with a check.

In: message bits; out: coded bits; and back from log-likelihood ratios. A code of length E has a
mother code of N = 2**n; when E > N the codeword is repeated cyclically, and the ratios of the
repeated bits add. Sources: Arikan 2009; order of reliability by the beta expansion of He et al.,
"Beta-expansion: a theoretical framework for fast and recursive construction of polar codes",
Globecom 2017; list decoding with a check of Tal and Vardy 2015.
Specification: spec/audio-carrier.md, W31 to W33.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link import _kernels

BELIEF_ROUNDS = 8
"""Rounds of belief propagation: near the limit of decoding further ones change nothing."""

CERTAIN = 1 - 1e-6
"""Largest belief that the channel may state."""

ROUNDING = 1e-4
"""Greatest relative error of a metric, which is computed in single precision."""

BETA = 2**0.25
"""Base of the polarisation weight."""


@dataclass(frozen=True, slots=True)
class PolarCode:
    """A code of `message` bits in `length` bits.

    Attributes
    ----------
    message : int
        Message bits, check bits included.
    length : int
        Bits on air.
    frozen : ndarray of int64, shape (N,)
        1 where the mother code's input is fixed to 0.
    """

    message: int
    length: int
    frozen: NDArray[np.int64]

    def encode(self, bits: NDArray[np.int64]) -> NDArray[np.int64]:
        """Coded bits, shape (length,), of message bits, shape (message,)."""
        x = np.zeros(self.frozen.size, dtype=np.int64)
        x[self.frozen == 0] = bits
        _kernels.polar_transform(x)
        return x[np.arange(self.length) % x.size]

    def decode(
        self,
        llr: NDArray[np.float64],
        *,
        accept: Callable[[NDArray[np.int64]], bool],
        list_size: int = 8,
    ) -> NDArray[np.int64] | None:
        """Most likely message that `accept` takes, or None.

        Parameters
        ----------
        llr : ndarray of float64, shape (length,)
            Log-likelihood ratios, positive for 0; zero for what did not arrive.
        accept : callable
            Check of a candidate message.
        list_size : int
            Paths that the decoder follows.

        Returns
        -------
        ndarray of int64, shape (message,), or None
            Not finding a message is a result.

        Examples
        --------
        >>> code = make_code(20, 100)
        >>> word = code.encode(np.arange(20) % 2)
        >>> code.decode(1.0 - 2.0 * word, accept=lambda message: True).tolist()[:5]
        [0, 1, 0, 1, 0]
        """
        for word in self.paths(llr, list_size):
            if accept(word):
                return np.asarray(word)
        return None

    def paths(
        self, llr: NDArray[np.float64], list_size: int, least: float = -math.inf
    ) -> NDArray[np.int64]:
        """Return the likeliest messages, shape (paths, message), best first; see `decode`.

        Those whose codeword's correlation with the ratios is below `least` are left out, as soon as
        the decoder knows it.
        """
        size = self.frozen.size
        mother = np.zeros(-(-self.length // size) * size)
        mother[: self.length] = llr
        words = np.empty((list_size, self.message), dtype=np.int64)
        metrics = np.zeros(list_size)
        folded = np.ascontiguousarray(mother.reshape(-1, size).sum(axis=0))
        whole = float(np.abs(folded).sum())
        # A path's metric is half of what its correlation lacks of the whole.
        largest = (whole * (1 + ROUNDING) - least) / 2
        count = _kernels.scl_decode(folded, self.frozen, list_size, largest, words, metrics)
        return words[:count]

    def beliefs(self, llr: NDArray[np.float64]) -> NDArray[np.float64]:
        """Expect each coded bit by all others: mean of 1 for 0 and -1 for 1.

        Parameters
        ----------
        llr : ndarray of float64, shape (length,)
            Log-likelihood ratios, positive for 0.

        Returns
        -------
        ndarray of float64, shape (length,)

        Examples
        --------
        >>> code = make_code(20, 100)
        >>> llr = 3.0 - 6.0 * code.encode(np.arange(20) % 2)
        >>> erased = np.where(np.arange(100) == 7, 0.0, llr)
        >>> bool(code.beliefs(erased)[7] * llr[7] > 2.9)
        True
        """
        size = self.frozen.size
        mother = np.zeros(-(-self.length // size) * size)
        mother[: self.length] = llr
        folded = mother.reshape(-1, size).sum(axis=0)
        told = np.clip(np.tanh(folded / 2), -CERTAIN, CERTAIN)
        code = np.empty(size)
        _kernels.polar_beliefs(told, self.frozen, BELIEF_ROUNDS, code)
        at = np.arange(self.length) % size
        repeated = np.clip(np.tanh((folded[at] - llr) / 2), -CERTAIN, CERTAIN)
        return np.asarray((code[at] + repeated) / (1 + code[at] * repeated))


def polarisation_weight(size: int) -> NDArray[np.float64]:
    """Reliability of each input of a mother code of `size` = 2**n bits."""
    index = np.arange(size)
    weight = np.zeros(size)
    for bit in range(size.bit_length() - 1):
        weight += ((index >> bit) & 1) * BETA**bit
    return weight


def longest_mother(length: int) -> int:
    """Return the greatest power of two up to `length`: the usual mother code."""
    return 1 << (length.bit_length() - 1)


@lru_cache(maxsize=16)
def make_code(message: int, length: int, mother: int | None = None) -> PolarCode:
    """Construct the code of `message` bits in `length` bits from one of `mother` = 2**n bits.

    Without `mother`, from the longest that `length` allows.

    Raises
    ------
    CueError
        If the mother code is too short for the message, or longer than the code.
    """
    size = longest_mother(length) if mother is None else mother
    if not 0 < message <= size <= length or size & (size - 1):
        raise CueError(f"{message} message bits in a polar code of {size}")
    frozen = np.ones(size, dtype=np.int64)
    frozen[np.argsort(polarisation_weight(size), kind="stable")[size - message :]] = 0
    return PolarCode(message, length, frozen)
