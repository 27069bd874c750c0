"""Content of stream files: the head, and the parts behind it, as far as they can be read.

No model of motion. Specification: spec/bitstream.md, sections 8 and 8.1.
"""

from dataclasses import dataclass

from codec.cues.language import Language, french
from codec.cues.timeline import TICKS
from codec.errors import BitstreamError
from codec.streamfile.file_score import FileScore, read_common
from codec.streamfile.records import read_records
from codec.superframe.bits import (
    FILE_BYTES,
    FILE_FIELDS,
    MAGIC,
    VERSION,
    crc16,
    pack_fields,
    unpack_fields,
)
from codec.superframe.superframe import Superframe

_CRC_BYTES = 2
"""Bytes of the check of a file's head."""

_CHANGED = "bytes of the head were changed"
"""Likely cause of a head whose check is wrong."""

HEAD_BYTES = FILE_BYTES + _CRC_BYTES
"""Bytes of a file's head with its check."""

MAX_TICKS = 24 * 3600 * 50
"""Ticks of the longest file: a day."""


@dataclass(frozen=True, slots=True)
class StreamHead:
    """The head of a stream file.

    Attributes
    ----------
    coding : str
        Identity of the coding.
    first_tick, ticks : int
        Ticks of 20 ms that the motion covers.
    l0, l1 : int
        Lengths of the parts of every superframe; 0 for `l0` if each states its own (F7).
    """

    coding: str
    first_tick: int
    ticks: int
    l0: int = 0
    l1: int = 0

    @property
    def indices(self) -> range:
        """Numbers of the superframes that cover the motion."""
        end = -(-(self.first_tick + self.ticks) // TICKS)
        return range(self.first_tick // TICKS, end)


def write_head(head: StreamHead) -> bytes:
    """Return a head with its check."""
    fields = {
        "magic": MAGIC,
        "version": VERSION,
        "coding": int(head.coding, 16),
        "first_tick": head.first_tick,
        "ticks": head.ticks,
        "l0": head.l0,
        "l1": head.l1,
    }
    body = pack_fields(FILE_FIELDS, fields)
    return body + crc16(body).to_bytes(_CRC_BYTES, "big")


def read_head(data: bytes) -> StreamHead:
    """Read the head of a stream file.

    Raises
    ------
    BitstreamError
        If it is short (F1), of another kind (F2), version (F3) or checksum (F4), or covers an
        impossible time (F5).
    """
    if len(data) < HEAD_BYTES:
        rule = f"a head of {HEAD_BYTES} bytes expected, {len(data)} found"
        raise BitstreamError(rule, section="F1", cause="the file is cut off")
    fields = unpack_fields(FILE_FIELDS, data[:FILE_BYTES])
    if fields["magic"] != MAGIC:
        rule = f"magic {MAGIC:08x} expected, {fields['magic']:08x} found"
        raise BitstreamError(rule, section="F2", bit=0, cause=_cause(fields, data))
    if fields["version"] != VERSION:
        rule = f"version {VERSION} expected, {fields['version']} found"
        raise BitstreamError(rule, section="F3", bit=32, cause=_cause(fields, data))
    check = data[FILE_BYTES:HEAD_BYTES]
    # Magic and version first: a checksum of a foreign file would explain nothing.
    own = crc16(data[:FILE_BYTES]).to_bytes(_CRC_BYTES, "big")
    if own != check:
        rule = f"checksum of the head: {own.hex()} expected, {check.hex()} found"
        raise BitstreamError(rule, section="F4", bit=8 * FILE_BYTES, cause=_CHANGED)
    head = StreamHead(
        f"{fields['coding']:016x}",
        fields["first_tick"],
        fields["ticks"],
        fields["l0"],
        fields["l1"],
    )
    if not 0 < head.ticks <= MAX_TICKS or head.first_tick > MAX_TICKS:
        raise BitstreamError(f"{head.ticks} ticks from {head.first_tick}", section="F5", bit=104)
    return head


def _cause(fields: dict[str, int], data: bytes) -> str:
    """Return why the magic or the version is another: the head's check decides.

    A check that holds once the field is put right covers all other fields, so only that one was
    changed. One that holds already was written over this version: nothing was changed.
    """
    as_written = pack_fields(FILE_FIELDS, fields | {"magic": MAGIC, "version": VERSION})
    check = int.from_bytes(data[FILE_BYTES:HEAD_BYTES], "big")
    if crc16(as_written) == check:
        return _CHANGED
    if fields["magic"] == MAGIC and crc16(data[:FILE_BYTES]) == check:
        return "a file of another version of Cuecast"
    return "a file of another kind"


@dataclass(frozen=True, slots=True)
class StreamContent:
    """What a stream file holds, as far as it can be read.

    Attributes
    ----------
    head : StreamHead
    common : bytes
        Common data of a file with one score for all (F8); empty if there is none.
    superframes : tuple of Superframe
        Those that are whole, their own checksums not looked at; with a payload for L0 in a file
        with one score for all (F7).
    fault : BitstreamError or None
        Why the file is not to be trusted: it ends early or goes on behind its end (F6), or its
        check is wrong (F7).
    """

    head: StreamHead
    common: bytes
    superframes: tuple[Superframe, ...]
    fault: BitstreamError | None


def read_content(data: bytes) -> StreamContent:
    """Return what a stream file holds, up to its damage if there is any.

    Raises
    ------
    BitstreamError
        As `read_head`.
    """
    head, place = read_head(data), HEAD_BYTES
    if head.l0 == 0:
        records, fault = read_records(data, place, len(head.indices))
        frames = [Superframe(*pair, b"") for pair in zip(head.indices, records[1:], strict=False)]
        return StreamContent(head, b"".join(records[:1]), tuple(frames), fault)
    frames, fault = list[Superframe](), None
    for index in head.indices:
        middle, end = place + head.l0, place + head.l0 + head.l1
        if end > len(data):
            rule = f"superframe {index} is cut off"
            fault = BitstreamError(rule, section="F6", bit=8 * place)
            break
        frames.append(Superframe(index, data[place:middle], data[middle:end]))
        place = end
    if fault is None and place != len(data):
        fault = BitstreamError(f"{len(data) - place} bytes too many", section="F6", bit=8 * place)
    return StreamContent(head, b"", tuple(frames), fault)


def _whole(data: bytes) -> StreamContent:
    content = read_content(data)
    if content.fault is not None:
        raise content.fault
    return content


def read_superframes(data: bytes) -> tuple[Superframe, ...]:
    """Return the superframes of a stream file, their checksums not looked at.

    Those of a file with one score for all have their payload for L0 (F7).

    Raises
    ------
    BitstreamError
        As `read_head`; if the file ends within a superframe, or goes on after the last one (F6); if
        the check of a file with one score for all is wrong (F7).
    """
    return _whole(data).superframes


def common_data(data: bytes, language: Language | None = None) -> FileScore:
    """Return a file's common data (F8), nothing if its superframes stand alone.

    Parameters
    ----------
    data : bytes
    language : Language, optional
        Of its tables; default: French.

    Raises
    ------
    BitstreamError
        As `read_superframes`; if its score has no end (F10).
    """
    content = _whole(data)
    return read_common(content.common, content.head.indices, language or french())
