"""The bit map of a superframe: every field with its name, its bits, its value and its paragraph.

In: the two parts of a superframe; out: a line for each field of the header, each symbol of the
range code, and the checks. A symbol of a range code does not stand in bits of its own: it takes as
much of the code as its table says, so that its bits have a fraction. Specification:
spec/bitstream.md.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from bitstring import Bits
from numpy.typing import NDArray

from codec.cues.language import french
from codec.errors import BitstreamError
from codec.superframe import labels, payload, preview, score_coding, settings, window
from codec.superframe.bits import (
    COMPACT_FIELDS,
    COMPACT_HEADER_BYTES,
    HEADER_BYTES,
    HEADER_FIELDS,
    IDENTITY_BITS,
    MODES,
    PLAIN,
    SCORE,
    Header,
    read_header,
)
from codec.superframe.checks import CRC16_BYTES, is_possible
from codec.superframe.quantise import NO_RESIDUAL, Setting, width_mm
from codec.superframe.range_coder import FLIP, TOTAL, RangeDecoder
from codec.superframe.superframe import Superframe
from codec.superframe.tables import equal, score_tables

_HEADER_PARAGRAPHS = {
    "version": "H2", "mode": "H3", "sequence": "H4", "lead": "section 2", "signed": "H12",
    "slow": "H8", "filmed": "H13", "compact": "H3",
}  # fmt: skip


_BY_WIDTH = {5: ("S8", "count"), 16: ("V4", "piece")}
"""Paragraph and name of equally likely bits that no other bits are as many as."""

FRENCH = french()


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a superframe.

    Attributes
    ----------
    part : str
        ``L0`` or ``L1``.
    name : str
    first : float
        Bits of the part before it.
    bits : float
        Its length; a fraction within a range code.
    value : str
        Its value, readable.
    paragraph : str
        Of the specification.
    """

    part: str
    name: str
    first: float
    bits: float
    value: str
    paragraph: str


def map_superframe(frame: Superframe) -> list[Field]:
    """Return the fields of a superframe in order.

    Parameters
    ----------
    frame : Superframe
        Its coefficients need a voice's tables and are one field.

    Returns
    -------
    list of Field
        Their bits add up to the bits of both parts.

    Raises
    ------
    BitstreamError
        If L0 has an impossible length or is of an unknown version.
    """
    if not is_possible(frame.l0):
        raise BitstreamError(f"superframe {frame.index}: its L0 is damaged", section="H1")
    return [*_l0(frame.l0), *_l1(frame.l1)]


def _l0(l0: bytes) -> Iterator[Field]:
    header = read_header(l0)
    compact = MODES[header.mode] == "compact"
    layout = COMPACT_FIELDS if compact else HEADER_FIELDS
    bits, at = Bits.from_bytes(l0), 0
    for name, width in layout.items():
        value = bits[at : at + width].uint
        said = f"{value} {MODES[value]}" if name == "mode" and value < len(MODES) else str(value)
        yield Field("L0", name, at, width, said, _HEADER_PARAGRAPHS[name])
        at += width
    check = 0 if compact else 8 * CRC16_BYTES
    end = len(bits) - check - header.tail
    # Symbols of a range coder have fractional sizes: their places are sums of information in bits.
    symbols, known = _symbols(l0, header)
    place = float(at)
    for symbol in symbols:
        yield Field("L0", symbol.name, place, symbol.bits, symbol.value, symbol.paragraph)
        place += symbol.bits
    rest = "unused" if compact or known == NO_RESIDUAL else "coefficients"
    yield Field("L0", rest, place, end - place, "", "R6" if rest == "unused" else "C5")
    identity = IDENTITY_BITS if compact else 0
    for name, width, paragraph in (
        ("identity", identity, "M2"),
        ("proof", header.tail - identity, "H12"),
    ):
        if width:
            yield Field("L0", name, end, width, str(bits[end : end + width].uint), paragraph)
            end += width
    if check:
        yield Field("L0", "check", end, check, f"0x{bits[end:].hex}", "H6")


def _l1(l1: bytes) -> Iterator[Field]:
    if l1:
        end = 8 * (len(l1) - payload.CRC8_BYTES)
        yield Field("L1", "coefficients", 0, end, "", "H9")
        yield Field("L1", "check", end, 8, f"0x{Bits.from_bytes(l1)[end:].hex}", "H7")


def _symbols(l0: bytes, header: Header) -> tuple[list["_Symbol"], int]:
    """Return the symbols of L0's code before its coefficients, and the step."""
    mode = header.mode
    if MODES[mode] == "compact":
        watched = _Watched(l0[COMPACT_HEADER_BYTES:], header.tail, "M4", "begin")
        window.read_window(l0, watched)
        return watched.symbols, NO_RESIDUAL
    watched = _Watched(l0[HEADER_BYTES:-CRC16_BYTES], header.tail, "H8", "step")
    list(payload.read_slow(watched, header))
    setting = _setting(watched, mode, filmed=header.filmed)
    if mode != PLAIN and header.filmed:
        labels.read_labels(watched, score_tables())
    elif mode != PLAIN:
        watched.plain = "S9", "option"
        score_coding.read_score(watched, score_tables())
        watched.plain = "V2", "tick"
        preview.read_previews(watched, score_tables())
    return watched.symbols, setting.step


def _setting(watched: "_Watched", mode: int, *, filmed: bool = False) -> Setting:
    """Read the setting; its step is said in mm."""
    first = len(watched.symbols)
    setting = settings.read_setting(watched, mode, filmed=filmed)
    step = watched.symbols[first + filmed]
    told = "no residual" if setting.step == NO_RESIDUAL else f"{width_mm(setting.step):.2f} mm"
    watched.symbols[first + filmed] = _Symbol(step.name, step.bits, f"{setting.step}: {told}", "H8")
    return setting


def map_record(frame: Superframe, *, scored: bool) -> list[Field]:
    """Return the fields of a superframe whose file has one score for all (F7).

    Parameters
    ----------
    frame : Superframe
        With its payload for L0.
    scored : bool
        Whether the file has a score.
    """
    watched = _Watched(frame.l0, 0, "H8", "step")
    _setting(watched, SCORE if scored else PLAIN)
    fields, place = [], 0.0
    for symbol in watched.symbols:
        fields.append(Field("L0", symbol.name, place, symbol.bits, symbol.value, symbol.paragraph))
        place += symbol.bits
    left = 8 * len(frame.l0) - place
    return [*fields, Field("L0", "coefficients", place, left, "", "C4")]


@dataclass(frozen=True, slots=True)
class _Symbol:
    name: str
    bits: float
    value: str
    paragraph: str


class _Watched(RangeDecoder):
    """A decoder that notes each symbol; `plain` says what equally likely bits mean."""

    def __init__(self, data: bytes, tail: int, paragraph: str, name: str) -> None:
        super().__init__(data, tail=tail)
        self.symbols: list[_Symbol] = []
        self.plain = paragraph, name
        self._known = _named_tables()

    def get(self, cdf: NDArray[np.int64], limit: int | None = None) -> int:
        """Return the next symbol, and note it."""
        return self._noted(super().get(cdf, limit), cdf, limit)

    def get_certain(self, cdf: NDArray[np.int64], limit: int | None = None) -> int:
        """Return the next symbol if it is determined, and note it."""
        symbol = super().get_certain(cdf, limit)
        return symbol if symbol < 0 else self._noted(symbol, cdf, limit)

    def get_bits(self, width: int) -> int:
        """Return a number of equally likely bits, and note it whole."""
        before = len(self.symbols)
        value = super().get_bits(width)
        del self.symbols[before:]
        paragraph, name = _BY_WIDTH.get(width, self.plain)
        self.symbols.append(_Symbol(name, float(width), str(value), paragraph))
        return value

    def _noted(self, symbol: int, cdf: NDArray[np.int64], limit: int | None) -> int:
        last = limit is not None and symbol >= limit
        share = int(cdf[-1] if last else cdf[symbol + 1]) - int(cdf[symbol])
        name, paragraph = self._name_of(cdf)
        value = str(symbol)
        if name == "letter":
            value = "ahead: none" if last else FRENCH.phones[FRENCH.phone_of(symbol)]
        bits = math.log2(TOTAL) - math.log2(share)
        self.symbols.append(_Symbol(name, bits, value, paragraph))
        return symbol

    def _name_of(self, cdf: NDArray[np.int64]) -> tuple[str, str]:
        for table, name, paragraph in self._known:
            if np.may_share_memory(cdf, table):
                return name, paragraph
        raise AssertionError("a table without a name")


def _named_tables() -> list[tuple[NDArray[np.int64], str, str]]:
    """Return all tables of symbols before the coefficients, with the names of what they code."""
    t = score_tables()
    return [
        (FLIP, "bit", "G2"),
        (settings.EIGHTHS, "eighth", "H13"),
        *((table, "basis", "H8") for table in settings.BASES),
        (settings.LEVELS, "level", "H8"),
        (settings.COURSES, "course", "H8"),
        (settings.SHIFTS, "shift", "H8"),
        *((table, "use", "H8") for table in settings.USES),
        (settings.SHARE, "share", "P10"),
        (score_coding.TIMING, "timing", "S2"),
        (score_coding.PLAIN_OR_SPECIAL, "special", "S2"),
        (score_coding.AS_RULED, "replaced", "S9"),
        (equal(FRENCH.n_shapes), "shape", "S9"),
        (equal(FRENCH.n_placements), "placement", "S9"),
        (t.first, "letter", "S3"),
        (t.next, "letter", "S3"),
        (t.left, "left", "S4"),
        (t.length, "length", "S5"),
        (t.opening, "letter", "M5"),
        (t.pause, "pause", "M6"),
        (t.key, "key", "V2"),
        (t.gap, "gap", "V2"),
        (preview.WHICH, "previews", "V1"),
        (labels.WHICH, "labels", "V6"),
        (labels.AFTER_REST, "gap", "V7"),
        (labels.AFTER_KEY, "gap", "V7"),
        (window.SLOW, "slow", "M1"),
        (window.TIMING, "timing", "M3"),
        (window.BEGIN, "begin", "M4"),
        (window.PACE, "pace", "M6"),
        (window.CORRECTION, "correction", "M6"),
        (window.PLAIN_OR_SPECIAL, "special", "M1"),
    ]
