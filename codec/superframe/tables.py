"""The static tables of the bitstream: frequencies of phones, lengths and coefficients.

Read once from ``spec/data/tables.json``, where `lab.format_tables` wrote them as
integers; they are part of the format's version and are the same for every voice (spec/bitstream.md,
section 7). Those of
other languages are in files of the same form (S11, S12).
"""

import functools
import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cues.language import Language, french
from codec.cues.timeline import TICKS
from codec.errors import CueError
from codec.files.data import DATA
from codec.superframe.range_coder import TOTAL, cumulative

CLASSES = 25
"""Classes of coefficients by expected magnitude against the step."""

CONTEXTS = 4
"""Contexts of a coefficient by the magnitudes around it."""

TEMPOS = 4
"""Contexts of a length: after a pause, after a short, a middling and a long phone."""


PAUSE_LENGTHS = TICKS // 2 + 1
"""Lengths of pauses, in units of two ticks, that a table distinguishes."""


@dataclass(frozen=True, slots=True)
class ScoreTables:
    """Coding tables of phones and lengths; ``n + 1`` ascending ends for ``n`` symbols each.

    Attributes
    ----------
    first : ndarray of int64, shape (39,)
        The phone that sounds as a superframe begins.
    next : ndarray of int64, shape (39, 38, 39)
        A phone after two others, by their numbers; 38 if the earlier one is not known.
    left : ndarray of int64, shape (38, 34)
        Ticks that the first phone still lasts, by its number.
    length : ndarray of int64, shape (38, 4, 34)
        Length of a phone less one, by its number and tempo context.
    opening : ndarray of int64, shape (39,)
        The phone that begins a compact superframe.
    pause : ndarray of int64, shape (18,)
        Length of a pause in units of two ticks less one, in compact superframes.
    usual : ndarray of int64, shape (38,)
        Mean length of a phone, in sixteenths of a tick.
    key : ndarray of int64, shape (42, 43)
        A key or a silence in a preview, by the symbol before.
    gap : ndarray of int64, shape (42, 17)
        Cells between two starts in a preview less one, by the symbol of the former.
    held : ndarray of int64, shape (34,)
        Length of a key less one, in files with keys.
    alone : ndarray of int64, shape (42,)
        A key or a silence in these, whatever stands before.
    """

    first: NDArray[np.int64]
    next: NDArray[np.int64]
    left: NDArray[np.int64]
    length: NDArray[np.int64]
    opening: NDArray[np.int64]
    pause: NDArray[np.int64]
    usual: NDArray[np.int64]
    key: NDArray[np.int64]
    gap: NDArray[np.int64]
    held: NDArray[np.int64]
    alone: NDArray[np.int64]

    @property
    def beginning(self) -> int:
        """Symbol of the beginning of a superframe in `key` and `gap`; the one before is silence."""
        return len(self.key) - 1

    @staticmethod
    def tempo(length: int) -> int:
        """Return the context of a length from the one before, 0 after a pause (S6)."""
        return 0 if length == 0 else 1 if length <= 3 else 2 if length <= 5 else 3


@dataclass(frozen=True, slots=True)
class CoefficientTables:
    """Coding tables of quantised coefficients.

    Attributes
    ----------
    magnitude : ndarray of int64, shape (25, 4, 17)
        Magnitudes 0..14 and escape, by class and context.
    inset : ndarray of int64, shape (25, 3)
        Distance of the reconstruction from the cell's middle towards zero, in 1/256 of a step,
        for magnitudes 1, 2 and from 3 on.
    cost : ndarray of float64, shape (25, 4, 16)
        Bits of each magnitude, for encoders.
    """

    magnitude: NDArray[np.int64]
    inset: NDArray[np.int64]
    cost: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        cost = np.log2(TOTAL) - np.log2(np.diff(self.magnitude, axis=-1))
        object.__setattr__(self, "cost", cost)


def _cdf(freqs: Any) -> NDArray[np.int64]:
    freq = np.asarray(freqs, dtype=np.int64)
    assert (freq > 0).all()
    assert (freq.sum(axis=-1) == TOTAL).all()
    zero = np.zeros((*freq.shape[:-1], 1), dtype=np.int64)
    return np.ascontiguousarray(np.concatenate([zero, np.cumsum(freq, axis=-1)], axis=-1))


def present_tables() -> dict[str, Any]:
    """Return the document of the tables that come with the package."""
    document: dict[str, Any] = json.loads((DATA / "tables.json").read_bytes())
    return document


_USUAL = 80
"""Mean length of a phone without any counts, in sixteenths of a tick (S12)."""


@functools.lru_cache(maxsize=8)
def score_tables(language: Language | None = None) -> ScoreTables:
    """Return the tables of phones and lengths of a language, of French by default.

    Parameters
    ----------
    language : Language, optional

    Raises
    ------
    CueError
        If tables that its file has do not fit it.
    """
    if language is None:
        return score_tables(french())
    n, keys = language.n_phones, language.silence + 2
    shapes = {
        "first": (n,), "next": (n + 1, n, n), "left": (n, TICKS + 1),
        "length": (n, TEMPOS, TICKS + 1), "opening": (n,), "pause": (PAUSE_LENGTHS,),
        "key": (keys, keys), "gap": (keys, PAUSE_LENGTHS), "held": (TICKS + 1,),
        "alone": (keys - 1,),
    }  # fmt: skip
    found = {name: _rows_of(language, name, shape) for name, shape in shapes.items()}
    usual = np.array(language.score.get("usual", [_USUAL] * n), dtype=np.int64)
    if usual.shape != (n,):
        raise CueError(f"tables of {language.name}: usual has shape {usual.shape}, not ({n},)")
    return ScoreTables(**found, usual=usual)


def _rows_of(language: Language, name: str, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Return the ends of a table's symbols, equally likely ones if it has none (S12)."""
    if name not in language.score:
        return np.ascontiguousarray(np.broadcast_to(equal(shape[-1]), (*shape[:-1], shape[-1] + 1)))
    freqs = np.asarray(language.score[name], dtype=np.int64)
    if freqs.shape != shape or (freqs < 1).any() or (freqs.sum(axis=-1) != TOTAL).any():
        raise CueError(
            f"tables of {language.name}: {name} has shape {freqs.shape}, not {shape}, or rows that "
            f"do not sum to {TOTAL}"
        )
    return _cdf(freqs)


@functools.cache
def equal(n: int) -> NDArray[np.int64]:
    """Return the table of equally likely symbols (table 2).

    Examples
    --------
    >>> equal(6).tolist()
    [0, 5463, 10924, 16385, 21846, 27307, 32768]
    """
    return cumulative([1] * n)


@functools.cache
def coefficient_tables() -> CoefficientTables:
    """Return the tables of coefficients."""
    return coefficient_tables_of(present_tables()["coefficient"])


def coefficient_tables_of(document: dict[str, Any]) -> CoefficientTables:
    """Return the tables that a document with ``magnitude`` and ``inset`` describes."""
    inset = np.array(document["inset"], dtype=np.int64)
    assert inset.shape == (CLASSES, 3)
    return CoefficientTables(_cdf(document["magnitude"]), inset)
