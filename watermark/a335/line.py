"""The luma line of ATSC A/335: 240 symbols across the full width of the picture.

In: 30 or 60 payload bytes; out: the values of one line of luma, and back. Section 5 of ATSC
A/335:2022. System 1X has two levels per symbol, 2X four; the payload starts with the run-in in
the system's own modulation.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError

SYMBOLS = 240
"""Symbols across the picture's width (ATSC A/335)."""

RUN_IN = b"\xeb\x52"

LINES = 2
"""Luma lines at the top of the picture that carry the symbols."""

MIN_WIDTH = 480  # two pixels a symbol; the standard's narrowest picture has 720


@dataclass(frozen=True, slots=True)
class LineSystem:
    """One of the two modulations.

    Attributes
    ----------
    name : str
        "1X" or "2X".
    bits : int
        Bits per symbol.
    levels : tuple of int
        Luma of each symbol value at 8 bits, values in ascending order.
    levels_10, levels_12 : tuple of int
        The same at 10 and at 12 bits.
    """

    name: str
    bits: int
    levels: tuple[int, ...]
    levels_10: tuple[int, ...]
    levels_12: tuple[int, ...]

    @property
    def payload_bytes(self) -> int:
        """Bytes of a line, run-in included."""
        return SYMBOLS * self.bits // 8

    def levels_at(self, depth: int) -> NDArray[np.int64]:
        """Luma of each symbol value at `depth` bits per sample."""
        table = {8: self.levels, 10: self.levels_10, 12: self.levels_12}
        if depth not in table:
            raise CueError(f"luma of {depth} bits: the line is defined for 8, 10 and 12")
        return np.array(table[depth], dtype=np.int64)


def system_1x(low: int = 4, high: int = 40) -> LineSystem:
    """System 1X with chosen levels.

    Parameters
    ----------
    low, high : int
        Luma of symbols 0 and 1 at 8 bits: 4..16 and 20..100, at least 16 apart.

    Raises
    ------
    CueError
        If the levels are outside the standard's range.

    Examples
    --------
    >>> system_1x().payload_bytes
    30
    """
    if not 4 <= low <= 16 or not 20 <= high <= 100 or high - low < 16:
        raise CueError(f"levels {low} and {high}: 4..16 and 20..100, at least 16 apart")
    return LineSystem("1X", 1, (low, high), (4 * low, 4 * high), (16 * low, 16 * high))


SYSTEM_1X = system_1x()
SYSTEM_2X = LineSystem("2X", 2, (16, 89, 162, 235), (64, 356, 648, 940), (256, 1424, 2592, 3760))


def line_values(
    payload: bytes, width: int, *, system: LineSystem = SYSTEM_1X, depth: int = 8
) -> NDArray[np.int64]:
    """Luma of one marked line.

    A pixel that two symbols share gets the mean of their levels weighted by their parts of it,
    rounded to nearest, halves up.

    Parameters
    ----------
    payload : bytes
        The whole payload, run-in first; shorter ones are padded with zeros.
    width : int
        Pixels of the line.
    system : LineSystem
        Modulation.
    depth : int
        Bits per sample: 8, 10 or 12.

    Returns
    -------
    ndarray of int64, shape (width,)

    Raises
    ------
    CueError
        If the payload is too long or the line too short.

    Examples
    --------
    >>> line_values(RUN_IN, 1280)[:16].tolist()
    [40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 40, 40]
    """
    if len(payload) > system.payload_bytes:
        raise CueError(f"payload of {len(payload)} bytes, limit {system.payload_bytes}")
    check_width(width)
    bits = np.unpackbits(np.frombuffer(payload.ljust(system.payload_bytes, b"\0"), dtype=np.uint8))
    values = bits.reshape(SYMBOLS, system.bits) @ (1 << np.arange(system.bits)[::-1])
    level = system.levels_at(depth)[values]
    first, share, last = _shares(width)
    return (level[first] * share + level[last] * (SYMBOLS - share) + SYMBOLS // 2) // SYMBOLS


def check_width(width: int) -> None:
    """Raise `CueError` if a line of `width` pixels cannot hold the symbols."""
    if width < MIN_WIDTH:
        raise CueError(f"picture of width {width}: the line needs at least {MIN_WIDTH}")


def _shares(width: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """First symbol of each pixel, that symbol's part of it in 1/240, last symbol."""
    start = np.arange(width, dtype=np.int64) * SYMBOLS
    first = start // width
    share = np.minimum(SYMBOLS, (first + 1) * width - start)
    return first, share, np.minimum(first + (share < SYMBOLS), SYMBOLS - 1)


def symbol_levels(line: ArrayLike) -> NDArray[np.float64]:
    """Mean luma over the middle 60 % of each symbol of a line, shape (240,)."""
    luma = np.asarray(line, dtype=np.float64)
    total = np.concatenate([[0.0], np.cumsum(luma)])
    first, share = _edges(luma.size)
    area = total[first] + share * (total[first + 1] - total[first])
    return np.asarray((area[:, 1] - area[:, 0]) / (0.6 * luma.size / SYMBOLS), dtype=np.float64)


@cache
def _edges(width: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Pixels where the middle of each symbol begins and ends, and the parts of them before that."""
    edge = (np.arange(SYMBOLS)[:, None] + np.array([0.2, 0.8])) * (width / SYMBOLS)
    return edge.astype(np.int64), edge % 1


def line_candidates(
    line: ArrayLike, *, depth: int = 8, doubtful: int = 8
) -> Iterator[tuple[LineSystem, bytes]]:
    """Read a line in several ways, the likeliest first; a checksum has to choose.

    The line has no error correction, so after coding one or two symbols near a slice level decide
    over the whole frame. Readings that change up to two of the `doubtful` least certain symbols to
    their neighbouring value follow the plain one (Chase, 1972).

    Parameters
    ----------
    line : array_like, shape (width,)
        Luma of one line, or the mean of several.
    depth : int
        Bits per sample.
    doubtful : int
        Number of symbols that may be changed.

    Yields
    ------
    (LineSystem, bytes)
        The system and the payload with its run-in; only readings that start with that.

    Examples
    --------
    >>> system, payload = next(line_candidates(line_values(RUN_IN + b"mark", 1920)))
    >>> system.name, payload[2:6]
    ('1X', b'mark')
    """
    luma = np.asarray(line)
    if luma.size < MIN_WIDTH:
        return
    level = symbol_levels(luma)
    # 1X has two levels, so its slice level follows the line; 2X has four at fixed places.
    for system, slices in ((SYSTEM_1X, _two_means(level)), (SYSTEM_2X, _midpoints(depth))):
        run_in = _run_in_values(system.bits)
        if np.count_nonzero(run_in != np.searchsorted(slices, level[: run_in.size])) > 2:
            continue
        values = np.searchsorted(slices, level).astype(np.int64)
        distance = level[:, None] - slices
        nearest = np.abs(distance).argmin(axis=1)
        # Distance to the nearest slice level, and the value on its other side.
        margin = np.take_along_axis(distance, nearest[:, None], axis=1)[:, 0]
        other = np.where(margin > 0, nearest, nearest + 1)
        weakest = np.argsort(np.abs(margin), kind="stable")[:doubtful]
        for count in range(min(doubtful, 2) + 1):
            for changed in combinations(weakest.tolist(), count):
                reading = values.copy()
                reading[list(changed)] = other[list(changed)]
                payload = _pack(reading, system)
                if payload.startswith(RUN_IN):
                    yield system, payload


@cache
def _run_in_values(bits: int) -> NDArray[np.int64]:
    """Symbols of the run-in with so many bits each."""
    sent = np.unpackbits(np.frombuffer(RUN_IN, dtype=np.uint8))
    return np.asarray(sent.reshape(-1, bits) @ (1 << np.arange(bits)[::-1]))


def _pack(values: NDArray[np.int64], system: LineSystem) -> bytes:
    bits = values[:, None] >> np.arange(system.bits)[::-1] & 1
    return np.packbits(bits.astype(np.uint8).reshape(-1)).tobytes()


def _two_means(level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half-way between the means of the dark and the bright symbols."""
    ordered = np.sort(level)
    total = np.cumsum(ordered)
    cut = (ordered[0] + ordered[-1]) / 2
    for _ in range(8):
        dark = int(np.searchsorted(ordered, cut, side="right"))
        bright = level.size - dark
        if dark == 0 or bright == 0:
            break
        before = cut
        cut = (total[dark - 1] / dark + (total[-1] - total[dark - 1]) / bright) / 2
        if cut == before:
            break
    return np.array([cut])


@cache
def _midpoints(depth: int) -> NDArray[np.float64]:
    levels = SYSTEM_2X.levels_at(depth)
    return np.asarray((levels[1:] + levels[:-1]) / 2)
