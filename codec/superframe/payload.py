"""The bytes of a superframe: its two parts written and read, without any model of motion.

Indices, score and setting go in, two byte strings come out, and back. Whatever is cut off at the
end of a part are coefficients of least expected magnitude: the reader stops at the first one
that its bytes do not determine. Specification: spec/bitstream.md, section 2.

A fine superframe nests inside a coarse one, for channels of different capacity:
the picture's L1 holds the whole of the fine one, so that sound and picture bear the same L0.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from codec.compiled import lightly
from codec.cues.language import Language, french
from codec.errors import BitstreamError
from codec.superframe import _kernels
from codec.superframe.bits import COMPACT, HEADER_BYTES, PLAIN, Header, crc8, read_header
from codec.superframe.checks import (
    CRC16_BYTES,
    MIN_L0_BYTES,
    check_of,
    heard_mask,
    is_possible,
    least_bytes,
    with_check,
)
from codec.superframe.labels import OWN, read_labels, write_labels
from codec.superframe.preview import Preview, part_of_preview, read_previews, write_previews
from codec.superframe.quantise import NO_RESIDUAL, NOTHING_SENT, Setting, basis_of, raised
from codec.superframe.range_coder import FLIP, RangeDecoder, RangeEncoder, encode_intervals
from codec.superframe.score_coding import ScorePart, read_score, write_score
from codec.superframe.settings import put_setting, read_setting
from codec.superframe.tables import coefficient_tables, score_tables
from codec.superframe.transform import Bases, Basis
from codec.superframe.window import MAX_BYTES, MIN_BYTES, PIECE_BITS, Window, read_window

Ints = NDArray[np.int64]
FRENCH = french()

CRC8_BYTES = 1
"""Bytes of L1's check."""


@dataclass(frozen=True, slots=True)
class Content:
    """The integers of a superframe.

    Attributes
    ----------
    header : Header
    setting : Setting
    part : ScorePart or Window or None
        None in mode ``plain``, a window in mode ``compact``.
    q : ndarray of int64, shape (32 P,)
        Quantised coefficients in scan order.
    previews : dict of int to Preview
        By distance, in mode ``score``; of a filmed superframe its labels, its own at distance 0.
    slow : tuple of int
        Pieces of the slow channel, 16 bits each.
    """

    header: Header
    setting: Setting
    part: ScorePart | Window | None
    q: Ints
    previews: dict[int, Preview] = field(default_factory=dict)
    slow: tuple[int, ...] = ()


def score_code(content: Content, *, even: bool) -> RangeEncoder:
    """Return the beginning of L0's payload: setting, score and previews (H8)."""
    encoder, setting = RangeEncoder(), content.setting
    for piece in content.slow:
        encoder.put_bits(piece, PIECE_BITS)
    put_setting(encoder, setting, content.header.mode, filmed=content.header.filmed)
    if isinstance(content.part, ScorePart) and content.header.filmed:
        write_labels(encoder, content.previews, score_tables(content.part.language))
    elif isinstance(content.part, ScorePart):
        tables = score_tables(content.part.language)
        write_score(encoder, content.part, tables, even=even)
        write_previews(encoder, content.previews, tables)
    return encoder


def coefficient_code(
    q: Ints, first: int, setting: Setting, basis: Basis
) -> tuple[Ints, Ints, Ints]:
    """Return starts and widths of the intervals of ``q[first:]``, and where each one ends."""
    size = 64 * q.size if setting.step != NO_RESIDUAL else 0
    starts, freqs = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
    ends = np.zeros(q.size, dtype=np.int64)
    if setting.step == NO_RESIDUAL:
        return starts, freqs, ends
    n = _kernels.encode_coefficients(
        q, first, raised(basis, setting), basis.before, setting.step,
        coefficient_tables().magnitude, starts, freqs, ends,
    )  # fmt: skip
    return starts[:n], freqs[:n], ends


def room_bits(header: Header, size: int) -> int:
    """Return the bits of payload in an L0 part of `size` bytes."""
    return 8 * (size - HEADER_BYTES - CRC16_BYTES) - header.tail


def write_l0(
    content: Content, bases: Bases, size: int, identity: str, *, even: bool = False
) -> bytes | None:
    """Return an L0 part of `size` bytes, None if the score does not fit.

    As many coefficients as fit follow the score.

    Parameters
    ----------
    content : Content
    bases : Bases
    size : int
    identity : str
        Of the coding.
    even : bool
        Whether the score's phones lie at even distances (S8).
    """
    tail = content.header.tail
    room = -(-room_bits(content.header, size) // 8)
    payload = _l0_code(content, bases, even=even)
    if content.setting.step != NO_RESIDUAL:
        payload = payload[:room]
    if len(payload) > room:
        return None
    payload = _cleared(payload.ljust(size - HEADER_BYTES - CRC16_BYTES, b"\0"), tail)
    if not _agrees(RangeDecoder(payload, tail=tail), content):
        return None
    return with_check(content.header.to_bytes() + payload, identity)


def _cleared(payload: bytes, tail: int) -> bytes:
    """Return a payload with its last bits zero."""
    return (int.from_bytes(payload, "big") >> tail << tail).to_bytes(len(payload), "big")


def write_l0_whole(content: Content, bases: Bases, identity: str) -> bytes:
    """Return the shortest L0 part that holds the score and all coefficients, unsigned.

    The code ends with the last coefficient that is not zero, if its last bits do not by chance
    code another one; else it is cut off behind that coefficient.
    """
    return with_check(content.header.to_bytes() + payload_of(content, bases), identity)


def payload_of(content: Content, bases: Bases) -> bytes:
    """Return the shortest payload that holds the content, as `write_l0_whole` says."""
    last = int(np.flatnonzero(content.q).max(initial=-1))
    ending = _l0_code(content, bases, even=False, last=last).ljust(1, b"\0")
    if _tells(ending, content, bases):
        return ending
    whole = _l0_code(content, bases, even=False)
    cut = (whole[:length] for length in range(len(ending), len(whole)))
    return next(code for code in (*cut, whole) if _tells(code, content, bases))


def read_record(payload: bytes, mode: int, bases: Bases) -> tuple[Setting, Ints]:
    """Return setting and coefficients of a superframe whose score is elsewhere (F7)."""
    decoder = RangeDecoder(payload)
    setting = read_setting(decoder, mode)
    basis = basis_of(bases, setting)
    q = np.zeros(basis.scan_scales.size, dtype=np.int64)
    if setting.step != NO_RESIDUAL:
        _read_coefficients(decoder, q, 0, setting, basis)
    return setting, q


def _tells(payload: bytes, content: Content, bases: Bases) -> bool:
    """Return whether a payload decodes to the intended values, neither less nor more."""
    decoder, q = RangeDecoder(payload), np.zeros_like(content.q)
    if not _agrees(decoder, content):
        return False
    if content.setting.step != NO_RESIDUAL:
        basis = basis_of(bases, content.setting)
        _read_coefficients(decoder, q, 0, content.setting, basis)
    return bool(np.array_equal(q, content.q))


def _l0_code(content: Content, bases: Bases, *, even: bool, last: int | None = None) -> bytes:
    """Return the code of L0's payload, whole or up to coefficient number `last`."""
    starts, freqs = score_code(content, even=even).intervals()
    if content.setting.step == NO_RESIDUAL or last == -1:
        return encode_intervals(starts, freqs)
    basis = basis_of(bases, content.setting)
    more_starts, more_freqs, ends = coefficient_code(content.q, 0, content.setting, basis)
    end = None if last is None else int(ends[last])
    return encode_intervals(
        np.concatenate([starts, more_starts[:end]]),
        np.concatenate([freqs, more_freqs[:end]]),
        certain=True,
    )


def _agrees(decoder: RangeDecoder, content: Content) -> bool:
    """Return whether a payload cut to its room still says this setting, score and previews."""
    if tuple(read_slow(decoder, content.header)) != content.slow:
        return False
    header = content.header
    if read_setting(decoder, header.mode, filmed=header.filmed) != content.setting:
        return False
    if content.part is None:
        return True
    language = content.part.options.language
    return _read_score(decoder, content.header, language) == (content.part, content.previews)


def _read_score(
    decoder: RangeDecoder, header: Header, language: Language
) -> tuple[ScorePart, dict[int, Preview]]:
    """Return the score of a superframe of mode ``score``, or its labels, and its previews."""
    tables = score_tables(language)
    if header.filmed:
        lists = read_labels(decoder, tables)
        return part_of_preview(lists[OWN], language), lists
    part = read_score(decoder, tables, language)
    return part, read_previews(decoder, tables)


def read_l0(l0: bytes, bases: Bases, language: Language = FRENCH) -> tuple[Content, int]:
    """Read an L0 part; its check is not looked at (`is_own`).

    Returns
    -------
    content : Content
        With the coefficients that the part determines, zeros for the others.
    known : int
        Number of the first coefficient that it does not determine.

    Raises
    ------
    BitstreamError
        If the part has a wrong length (H1), or its version is unknown (H2).
    """
    content, decoder = _read_beginning(l0, language)
    basis = basis_of(bases, content.setting)
    q = np.zeros(basis.scan_scales.size, dtype=np.int64)
    known = q.size
    if decoder is not None and content.setting.step != NO_RESIDUAL:
        known = _read_coefficients(decoder, q, 0, content.setting, basis)
    return replace(content, q=q), known


def read_beginning(l0: bytes, language: Language = FRENCH) -> Content:
    """Return header, setting, score and previews of an L0 part: all that needs no voice.

    Raises
    ------
    BitstreamError
        As `read_l0`.
    """
    return _read_beginning(l0, language)[0]


def _read_beginning(l0: bytes, language: Language) -> tuple[Content, RangeDecoder | None]:
    nothing = np.zeros(0, dtype=np.int64)
    header = read_header(l0)
    if header.mode == COMPACT:
        if not is_possible(l0):
            raise BitstreamError(
                f"compact L0 of {len(l0)} bytes, {MIN_BYTES}..{MAX_BYTES}", section="H1"
            )
        window = read_window(l0, language=language)
        return Content(header, NOTHING_SENT, window, nothing, slow=window.slow), None
    if not is_possible(l0):
        raise BitstreamError(f"L0 of {len(l0)} bytes, at least {least_bytes(l0)}", section="H1")
    decoder = RangeDecoder(l0[HEADER_BYTES:-CRC16_BYTES], tail=header.tail)
    slow = tuple(read_slow(decoder, header))
    setting = read_setting(decoder, header.mode, filmed=header.filmed)
    if header.mode == PLAIN:
        return Content(header, setting, None, nothing, slow=slow), decoder
    part, previews = _read_score(decoder, header, language)
    return Content(header, setting, part, nothing, previews, slow), decoder


def read_slow(decoder: RangeDecoder, header: Header) -> Iterator[int]:
    """Yield the pieces of the slow channel that a payload begins with (H8)."""
    for _ in range(header.slow):
        yield decoder.get_bits(PIECE_BITS)


def _read_coefficients(
    decoder: RangeDecoder, q: Ints, first: int, setting: Setting, basis: Basis
) -> int:
    known: int = lightly(_kernels.decode_coefficients)(
        decoder.data, decoder.state, q, first, raised(basis, setting), basis.before,
        setting.step, coefficient_tables().magnitude, FLIP,
    )  # fmt: skip
    return known


def write_l1(l0: bytes, setting: Setting, q: Ints, known: int, bases: Bases, size: int) -> bytes:
    """Return an L1 part of `size` bytes with the coefficients from number `known` on."""
    starts, freqs, _ = coefficient_code(q, known, setting, basis_of(bases, setting))
    room = size - CRC8_BYTES
    body = encode_intervals(starts, freqs, certain=True)[:room].ljust(room, b"\0")
    return body + bytes([_l1_check(l0, body)])


def read_l1(l0: bytes, l1: bytes, content: Content, known: int, bases: Bases) -> Content:
    """Return `content` with the coefficients of L1 added.

    Raises
    ------
    BitstreamError
        If the part is empty (H1) or its checksum does not fit it and its L0 (H7).
    """
    if len(l1) < CRC8_BYTES:
        raise BitstreamError("L1 of 0 bytes, at least 1", section="H1")
    body, check = l1[:-CRC8_BYTES], l1[-1]
    if _l1_check(l0, body) != check:
        raise BitstreamError(
            f"L1 checksum {_l1_check(l0, body):#04x}, stated {check:#04x}",
            section="H7",
            bit=8 * len(body),
        )
    q = content.q.copy()
    if content.setting.step != NO_RESIDUAL:
        basis = basis_of(bases, content.setting)
        _read_coefficients(RangeDecoder(body), q, known, content.setting, basis)
    return replace(content, q=q)


def _l1_check(l0: bytes, body: bytes) -> int:
    """Return the CRC-8 of L1, which covers the check of its L0 too."""
    return crc8(check_of(l0) + body)


def nest(coarse_l0: bytes, fine_l0: bytes, fine_l1: bytes) -> tuple[bytes, bytes]:
    """Return the parts of a superframe that holds `fine` beside a coarse L0.

    Examples
    --------
    >>> nest(b"ab", b"cd", b"efg")
    (b'ab', b'cdefg')
    """
    assert len(coarse_l0) == len(fine_l0), "both L0 have one length"
    return coarse_l0, fine_l0 + fine_l1


def unnest(l0: bytes | None, l1: bytes | None) -> tuple[bytes | None, bytes | None]:
    """Return the finest superframe that these parts hold: the nested one, or themselves.

    Examples
    --------
    >>> unnest(b"ab", b"cde")
    (b'ab', b'cde')
    """
    if l0 is None or not l1 or len(l1) < len(l0) or len(l0) < MIN_L0_BYTES:
        return l0, l1
    if heard_mask(l1[: len(l0)]) != heard_mask(l0):
        return l0, l1
    try:
        nested = read_header(l1[: len(l0)]) == read_header(l0)
    except BitstreamError:
        return l0, l1
    return (l1[: len(l0)], l1[len(l0) :]) if nested else (l0, l1)
