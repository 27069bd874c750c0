"""Labels: keys of a filmed hand, without phones and with coarse times.

A filmed cuer moves in her own way: phones and exact times of her keys cost more bits on air than
the prediction from them saves. A filmed superframe lists its keys alone, and those of another one
against that one's loss. Keys and silences stand in cells of four ticks, as in previews.
Specification: spec/bitstream.md, section 3.4.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cues.timeline import TICKS
from codec.superframe.preview import SILENCE, Preview
from codec.superframe.range_coder import RangeDecoder, RangeEncoder, cumulative
from codec.superframe.tables import ScoreTables

Table = NDArray[np.int64]

CELL = 4
"""Resolution of the times of labels, in ticks; a start counts as in the middle of its cell."""

OWN = 0
"""Distance of the superframe itself."""

CHOICES: tuple[tuple[int, ...], ...] = ((), (2,), (-1,), (2, -1), (2, 4))
"""Distances of the other superframes whose labels follow, by symbol."""

_CELLS = TICKS // CELL

WHICH = cumulative([1, 20, 4, 1, 6])
"""Frequencies of the choices (V6)."""

AFTER_REST = cumulative([5, 5, 5, 4, 4, 4, 3, 3, 31])
"""Frequencies of the gap before a start that follows none, or a silence (V7)."""

AFTER_KEY = cumulative([6, 13, 14, 11, 7, 5, 3, 2, 3])
"""The same behind a key: keys of real cuers begin 0.26 to 0.33 s apart."""


def labels_of(preview: Preview, silence: int = SILENCE) -> Preview:
    """Return starts and symbols as coded by labels; those without a cell are left out.

    A silence gives its cell to a key that would have none.

    Parameters
    ----------
    preview : tuple of (int, int)
        Ticks and symbols, as `codec.superframe.preview.preview_of` gives them.
    silence : int
        Symbol of a silence in the score's language.

    Examples
    --------
    >>> labels_of(((5, 16), (7, 40), (30, 3)))
    ((6, 16), (10, 40), (30, 3))
    >>> labels_of(((28, 40), (30, 22)))
    ((30, 22),)
    """
    found: list[tuple[int, int]] = []
    cell = -1
    for tick, symbol in preview:
        cell = max(tick // CELL, cell + 1)
        if cell == _CELLS and found and found[-1][1] == silence:
            found.pop()
            cell -= 1
        if cell < _CELLS:
            found.append((CELL * cell + CELL // 2, symbol))
    return tuple(found)


def write_labels(encoder: RangeEncoder, lists: dict[int, Preview], tables: ScoreTables) -> None:
    """Append the labels of a filmed superframe and those of others by their distance (V6, V7)."""
    others = next(choice for choice in CHOICES if {OWN, *choice} == set(lists))
    encoder.put(CHOICES.index(others), WHICH)
    for distance in (OWN, *others):
        cell, before = -1, tables.beginning
        for tick, symbol in lists[distance]:
            encoder.put(tick // CELL - cell - 1, _gaps(before, tables), _CELLS - 1 - cell)
            encoder.put(symbol, tables.key[before])
            cell, before = tick // CELL, symbol
        if cell < _CELLS - 1:
            encoder.put(_CELLS - 1 - cell, _gaps(before, tables), _CELLS - 1 - cell)


def read_labels(decoder: RangeDecoder, tables: ScoreTables) -> dict[int, Preview]:
    """Read what `write_labels` wrote; any code gives labels."""
    lists: dict[int, Preview] = {}
    for distance in (OWN, *CHOICES[decoder.get(WHICH)]):
        found: list[tuple[int, int]] = []
        cell, before = -1, tables.beginning
        while cell < _CELLS - 1:
            gap = decoder.get(_gaps(before, tables), _CELLS - 1 - cell)
            if gap == _CELLS - 1 - cell:
                break
            cell += gap + 1
            before = min(decoder.get(tables.key[before]), tables.beginning - 1)
            found.append((CELL * cell + CELL // 2, before))
        lists[distance] = tuple(found)
    return lists


def _gaps(before: int, tables: ScoreTables) -> Table:
    return AFTER_KEY if before < tables.beginning - 1 else AFTER_REST
