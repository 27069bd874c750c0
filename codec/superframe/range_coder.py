"""Range coder with static integer tables: symbols in, the shortest bytes out, and back.

A symbol of an alphabet is an interval of the 2**15 equal parts of [0, 1); the intervals of a
line of symbols nest, and the bytes are the shortest base-256 fraction inside the last one
(Martin 1979, with the carry put into bytes already written). Two ends of a code exist:
a *padded* one, which relies on zero bytes after the end, and a *certain* one, which decodes alike
whatever follows. Specification: spec/bitstream.md, paragraphs R1 to R6.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.compiled import lightly
from codec.errors import CueError
from codec.superframe import _kernels

TOTAL = 1 << _kernels.PRECISION
"""Sum of the frequencies of every table, a power of two."""

FLIP = np.array([0, TOTAL // 2, TOTAL], dtype=np.int64)
"""Table of two equally likely symbols."""


def cumulative(weights: Sequence[float] | NDArray[np.float64]) -> NDArray[np.int64]:
    """Return a coding table for symbols of the given weights.

    Parameters
    ----------
    weights : array_like, shape (n,)
        Not negative, n within 1..2**14; a weight of zero still receives one part.

    Returns
    -------
    ndarray of int64, shape (n + 1,)
        Lower ends of the symbols' intervals, then `TOTAL`.

    Examples
    --------
    >>> cumulative([3, 1]).tolist()
    [0, 24576, 32768]
    """
    w = np.maximum(np.asarray(weights, dtype=np.float64), 0)
    if not 1 <= len(w) <= TOTAL // 2 or not np.isfinite(w).all():
        raise CueError(f"a table of {len(w)} weights is not within 1..{TOTAL // 2}, or not finite")
    total = w.sum()
    share = w / total if total > 0 else np.full(len(w), 1 / len(w))
    freq = np.maximum(1, np.floor(share * TOTAL).astype(np.int64))
    # What rounding left over goes to, or comes from, the likeliest symbols.
    spare = TOTAL - int(freq.sum())
    for symbol in np.argsort(-share, kind="stable"):
        change = spare if spare >= 0 else max(spare, 1 - int(freq[symbol]))
        freq[symbol] += change
        spare -= change
    return np.concatenate([[0], np.cumsum(freq)]).astype(np.int64)


def code_length(freqs: NDArray[np.int64]) -> float:
    """Return the ideal length in bits of symbols with these frequencies.

    Examples
    --------
    >>> code_length(np.array([TOTAL // 2, TOTAL // 4]))
    3.0
    """
    return float(_kernels.PRECISION * len(freqs) - np.log2(freqs).sum())


class RangeEncoder:
    """A line of symbols on its way to bytes.

    Examples
    --------
    >>> table = cumulative([6, 1, 1])
    >>> encoder = RangeEncoder()
    >>> for symbol in (0, 0, 2, 0, 1):
    ...     encoder.put(symbol, table)
    >>> data = encoder.finish()
    >>> decoder = RangeDecoder(data)
    >>> [decoder.get(table) for _ in range(5)], len(data)
    ([0, 0, 2, 0, 1], 1)
    """

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._freqs: list[int] = []

    def put(self, symbol: int, cdf: NDArray[np.int64], limit: int | None = None) -> None:
        """Append `symbol` of table `cdf`; all symbols from `limit` on count as `limit`."""
        last = len(cdf) - 2 if limit is None else limit
        if not 0 <= symbol <= last:
            raise CueError(f"symbol {symbol} is not within 0..{last}")
        start = int(cdf[symbol])
        self._starts.append(start)
        self._freqs.append((TOTAL if symbol == last else int(cdf[symbol + 1])) - start)

    def put_bits(self, value: int, width: int) -> None:
        """Append `width` bits of `value`, high bit first, at one bit each."""
        for bit in range(width - 1, -1, -1):
            self.put(value >> bit & 1, FLIP)

    def __len__(self) -> int:
        """Return the number of symbols so far."""
        return len(self._starts)

    @property
    def bits(self) -> float:
        """Ideal length so far, in bits."""
        return code_length(np.array(self._freqs, dtype=np.int64))

    def intervals(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the starts and widths of the symbols so far."""
        return np.array(self._starts, dtype=np.int64), np.array(self._freqs, dtype=np.int64)

    def finish(self, *, certain: bool = False) -> bytes:
        """Return the code; see `encode_intervals`."""
        return encode_intervals(*self.intervals(), certain=certain)


def encode_intervals(
    starts: NDArray[np.int64], freqs: NDArray[np.int64], *, certain: bool = False
) -> bytes:
    """Return the bytes of a line of intervals.

    Parameters
    ----------
    starts, freqs : ndarray of int64, shape (n,)
        Lower end and width of every symbol's interval, in 2**-15.
    certain : bool
        End the code so that any continuation decodes alike; otherwise it is padded by zero bytes
        and its own trailing zero bytes are dropped.

    Returns
    -------
    bytes
    """
    out = np.empty(8 + 2 * len(starts), dtype=np.uint8)
    length = _kernels.range_encode(starts, freqs, len(starts), certain, out)
    data = out[:length].tobytes()
    return data if certain else data.rstrip(b"\0")


_LITTLE = 4096
"""Bytes that are decoded without compiled kernels where these are not loaded."""


class RangeDecoder:
    """Bytes on their way back to symbols; bits past the end count as zero.

    Parameters
    ----------
    data : bytes
    tail : int
        Bits at the end of the data that are no code.
    """

    def __init__(self, data: bytes, *, tail: int = 0) -> None:
        self.data = np.frombuffer(data[: len(data) - tail // 8], dtype=np.uint8)
        self.state = np.zeros(5, dtype=np.int64)
        self.state[_kernels.TAIL] = (1 << tail % 8) - 1
        little = len(data) <= _LITTLE
        self._decode = lightly(_kernels.decode_symbol) if little else _kernels.decode_symbol
        (lightly(_kernels.start_decoding) if little else _kernels.start_decoding)(
            self.data, self.state
        )

    def get(self, cdf: NDArray[np.int64], limit: int | None = None) -> int:
        """Return the next symbol of table `cdf`; `limit` as in `RangeEncoder.put`."""
        last = len(cdf) - 2 if limit is None else limit
        return int(self._decode(self.data, self.state, cdf, last, False))

    def get_certain(self, cdf: NDArray[np.int64], limit: int | None = None) -> int:
        """Return the next symbol if the data determine it, else -1 (R6)."""
        last = len(cdf) - 2 if limit is None else limit
        return int(self._decode(self.data, self.state, cdf, last, True))

    def get_bits(self, width: int) -> int:
        """Return a number of `width` bits."""
        value = 0
        for _ in range(width):
            value = 2 * value + self.get(FLIP)
        return value
