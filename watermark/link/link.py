"""Link layer: two classes of bytes to the coded bits of a superframe's data cells, and back.

In: L0 and L1 bytes; out: one bit per data cell in the interleaver's order; and back from one
log-likelihood ratio per bit, so that the ratios of several carriers may be added before decoding.
Specification: spec/audio-carrier.md, W29 to W34.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link.crc import crc_bits, passes
from watermark.link.polar import PolarCode, make_code

L0_CHECK = 24
"""Check bits of the first class: each path of a decoder's list passes by chance once in 2**24."""

L1_CHECK = 16
"""Check bits of the second class, which is looked at only when the first was accepted."""


SIGNIFICANCE = 0.97
"""Least correlation of a message's codeword with the ratios, in units of the largest one that 2**K
random codewords are expected to have with noise. The output of a list decoder for noise reaches
0.83 to 0.97 and passes by its check alone once in 2**24; true messages near the limit of decoding
have 0.97 (one in a hundred) to 1.2."""

SECOND_PATHS, LONG_SECOND_PATHS = 64, 16
"""How many paths of its list are asked for the second class's check, of short and long messages:
each wrong one passes by chance once in 2**16. Where that class fails beside a right first one,
wrong paths lie near the true one and are significant, too: of `standard` 5 %, of `high` 60 %."""

LONG_MESSAGE, LONG_SIGNIFICANCE = 200, 1.0
"""Least message bits of a long second class, and the limit for it instead of
`SIGNIFICANCE`: 13 % of the wrong paths reach that. With 512 paths at 0.97, one in fifty of the
superframes of `high` that failed gave a wrong message (`tests/bench/second_class.py`)."""

SIGNIFICANT_RATE = 1 / 3
"""Code rate up to which noise is Gaussian in that sense.

Where few values carry most, as in pictures, their squares dominate the limit and true messages miss
it: of 220 second classes whose message was the decoder's best one, 9 missed 0.97 and 14 missed 1.
There each ratio r counts as tanh(r / 2), the agreement with the true bit that is expected of it;
no other weight has a better ratio of signal to noise. Then 1 of 220 misses 0.97; of 816 wrong
messages beside a right first class 2 % reach it, of 5152 found in noise none (the best has 0.96).
"""


class Rates(Protocol):
    """The part of a carrier's profile that the link needs."""

    @property
    def l0_bytes(self) -> int:
        """Payload of the first class."""

    @property
    def l1_bytes(self) -> int:
        """Payload of the second class, 0 if there is none."""

    @property
    def l0_coded(self) -> int:
        """Coded bits of the first class."""

    @property
    def l0_mother(self) -> int:
        """Bits of the mother code of the first class."""

    @property
    def l1_coded(self) -> int:
        """Coded bits of the second class."""

    @property
    def uneven(self) -> bool:
        """Whether few values may carry most of what arrives."""


@dataclass(frozen=True, slots=True)
class Decoded:
    """The link's result for one superframe.

    Attributes
    ----------
    l0, l1 : bytes or None
        Payload, None where the check failed. L1 is never given without L0.
    coded : ndarray of int64, shape (data_cells,)
        Coded bits of the accepted classes; -1 where unknown.
    """

    l0: bytes | None
    l1: bytes | None
    coded: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Class:
    name: str
    size: int
    check: int
    code: PolarCode
    paths: int | None = None
    significance: float = SIGNIFICANCE
    uneven: bool = False

    def encode(self, payload: bytes) -> NDArray[np.int64]:
        if len(payload) != self.size:
            raise CueError(f"{self.name} holds {len(payload)} bytes, the profile {self.size}")
        bits = np.unpackbits(np.frombuffer(payload, dtype=np.uint8)).astype(np.int64)
        return self.code.encode(np.concatenate([bits, crc_bits(bits, self.check)]))

    def decode(
        self, llr: NDArray[np.float64], list_size: int
    ) -> tuple[bytes, NDArray[np.int64]] | None:
        """Payload and coded bits."""
        shown = np.tanh(llr / 2) if self.uneven else llr
        least = self._least(shown)
        # The decoder leaves out paths by the ratios themselves.
        bound = -math.inf if self.uneven else least
        messages = self.code.paths(llr, list_size, bound)[: self.paths]
        for message in messages[self._passes(messages)]:
            coded = self.code.encode(message)
            if shown @ (1.0 - 2.0 * coded) >= least:
                return np.packbits(message[: 8 * self.size].astype(np.uint8)).tobytes(), coded
        return None

    def _passes(self, messages: NDArray[np.int64]) -> NDArray[np.bool_]:
        return passes(messages, self.check)

    def _least(self, shown: NDArray[np.float64]) -> float:
        """Least correlation of a significant message with the values."""
        if self.code.message > SIGNIFICANT_RATE * self.code.length:
            return -math.inf
        largest = np.sqrt(2 * np.log(2) * self.code.message * (shown @ shown))
        return float(self.significance * largest)


class Link:
    """Encoder and decoder of a profile's superframes.

    Examples
    --------
    >>> from watermark.audio.signal.profile import STANDARD
    >>> link = Link(STANDARD)
    >>> coded = link.encode(bytes(20), bytes(7))
    >>> link.decode(1.0 - 2.0 * coded).l1 == bytes(7)
    True
    """

    def __init__(self, profile: Rates) -> None:
        self.profile = profile
        first, second = profile.l0_bytes, profile.l1_bytes
        code = make_code(8 * first + L0_CHECK, profile.l0_coded, profile.l0_mother)
        self._first = _Class("L0", first, L0_CHECK, code, uneven=profile.uneven)
        self._second = None
        if second:
            code = make_code(8 * second + L1_CHECK, profile.l1_coded)
            paths, asked = SECOND_PATHS, SIGNIFICANCE
            if code.message > LONG_MESSAGE:
                paths = LONG_SECOND_PATHS
                asked = SIGNIFICANCE if profile.uneven else LONG_SIGNIFICANCE
            self._second = _Class("L1", second, L1_CHECK, code, paths, asked, profile.uneven)

    def encode(self, l0: bytes, l1: bytes) -> NDArray[np.int64]:
        """Coded bits of a superframe, shape (data_cells,): first L0's, then L1's.

        Raises
        ------
        CueError
            If a payload does not have the profile's length.
        """
        if self._second is None:
            if l1:
                raise CueError(f"L1 holds {len(l1)} bytes, the profile 0")
            return self._first.encode(l0)
        return np.concatenate([self._first.encode(l0), self._second.encode(l1)])

    def decode(self, llr: NDArray[np.float64], *, list_size: int = 8) -> Decoded:
        """Payloads behind one log-likelihood ratio per data cell, shape (data_cells,)."""
        cut = self._first.code.length
        coded = np.full(llr.size, -1, dtype=np.int64)
        first = self._first.decode(llr[:cut], list_size)
        if first is None:
            return Decoded(None, None, coded)
        l0, coded[:cut] = first
        if self._second is None:
            return Decoded(l0, b"", coded)
        second = self._second.decode(llr[cut:], list_size)
        if second is None:
            return Decoded(l0, None, coded)
        l1, coded[cut:] = second
        return Decoded(l0, l1, coded)

    def beliefs(self, llr: NDArray[np.float64]) -> NDArray[np.float64]:
        """Expect each coded bit by all others, see `PolarCode.beliefs`."""
        cut = self._first.code.length
        parts = [self._first.code.beliefs(llr[:cut])]
        if self._second is not None:
            parts.append(self._second.code.beliefs(llr[cut:]))
        return np.concatenate(parts)

    def complete(self, first: Decoded, l1: bytes) -> Decoded:
        """Join L1 to a superframe that had only L0."""
        coded = first.coded.copy()
        if self._second is not None:
            coded[self._first.code.length :] = self._second.encode(l1)
        return Decoded(first.l0, l1, coded)

    def second(self, llr: NDArray[np.float64], *, list_size: int = 8) -> bytes | None:
        """L1 behind the ratios of all data cells, where L0 is known already; None if it failed."""
        if self._second is None:
            return b""
        second = self._second.decode(llr[self._first.code.length :], list_size)
        return None if second is None else second[0]
