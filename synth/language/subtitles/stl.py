"""EBU STL files (EBU Tech 3264): a header of 1024 bytes and blocks of 128."""

import io
from collections.abc import Iterator
from itertools import count

from codec.errors import CueError
from synth.language.subtitles.findings import Findings
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.model_walk import subtitles_of

HEADER_BYTES, BLOCK_BYTES = 1024, 128
"""Bytes of the header and of a block (EBU Tech 3264)."""

_FORMAT = slice(3, 11)

_USER_DATA_BLOCK = 0xFE
"""Number of blocks that hold no text."""

_LANGUAGE = slice(14, 16)
_LANGUAGES = {
    b"01": "sq", b"02": "br", b"03": "ca", b"04": "hr", b"06": "cs", b"07": "da", b"08": "de",
    b"09": "en", b"0A": "es", b"0F": "fr", b"15": "it", b"1D": "nl", b"20": "pl", b"21": "pt",
    b"22": "ro",
}  # fmt: skip
"""Language codes of EBU Tech 3264, appendix 3; a code that is not listed has no meaning."""

_FORMATS = (b"STL25.01", b"STL30.01", b"STL24.01", b"STL50.01")


def looks_like_stl(data: bytes) -> bool:
    """Whether the disk format code of an EBU STL header stands in `data`."""
    return data[_FORMAT] in _FORMATS


def read_stl(data: bytes, findings: Findings) -> Iterator[Subtitle]:
    """Yield the subtitles of an EBU STL file; times count from the header's programme start.

    Parameters
    ----------
    data : bytes
    findings : Findings
        Receives blocks that cannot be read.

    Raises
    ------
    CueError
        If the header is malformed or nothing can be read; the message gives the block.
    """
    from ttconv.stl import reader
    from ttconv.stl.config import STLReaderConfiguration

    blocks, rest = divmod(len(data) - HEADER_BYTES, BLOCK_BYTES)
    if len(data) < HEADER_BYTES:
        raise CueError(f"line 1: an EBU STL header of {len(data)} bytes, not {HEADER_BYTES}")
    if rest:
        findings.leave_out(blocks + 1, f"the last block has {rest} bytes, not {BLOCK_BYTES}")
    findings.language = _LANGUAGES.get(bytes(data[_LANGUAGE]), "")
    kept = [
        number
        for number in range(1, blocks + 1)
        if _good_times(_block(data, number), number, findings)
    ]
    whole = data[:HEADER_BYTES] + b"".join(_block(data, number) for number in kept)
    try:
        document = reader.to_model(
            io.BytesIO(whole), STLReaderConfiguration(program_start_tc="TCP")
        )
    except Exception as error:  # ttconv documents none and raises many
        raise CueError(f"line 1: malformed EBU STL: {error}".split("\n")[0]) from error
    yield from subtitles_of(document, ((block, 0) for block in count(1)), findings)


def _block(data: bytes, number: int) -> bytes:
    first = HEADER_BYTES + (number - 1) * BLOCK_BYTES
    return data[first : first + BLOCK_BYTES]


def _good_times(block: bytes, number: int, findings: Findings) -> bool:
    """Whether a block's times are such as ttconv does not drop without a word."""
    extension, begin, end = block[3], tuple(block[5:9]), tuple(block[9:13])
    if extension == _USER_DATA_BLOCK:
        return True
    for hours, minutes, seconds, frames in (begin, end):
        if hours > 23 or minutes > 59 or seconds > 59 or frames > 59:
            findings.leave_out(
                number, f"malformed time {hours}:{minutes}:{seconds}:{frames} in its block"
            )
            return False
    if end <= begin:
        findings.leave_out(number, f"subtitle ends at {end}, not after its start at {begin}")
    return end > begin
