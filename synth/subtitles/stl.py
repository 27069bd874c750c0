"""EBU STL files (EBU Tech 3264): a header of 1024 bytes and blocks of 128."""

import io
from collections.abc import Iterator
from itertools import count

from codec.errors import CueError
from synth.subtitles.model import Subtitle
from synth.subtitles.model_walk import subtitles_of

HEADER_BYTES, BLOCK_BYTES = 1024, 128
_FORMAT = slice(3, 11)
_USER_DATA_BLOCK = 0xFE
_FORMATS = (b"STL25.01", b"STL30.01", b"STL24.01", b"STL50.01")


def looks_like_stl(data: bytes) -> bool:
    """Whether the disk format code of an EBU STL header stands in `data`."""
    return data[_FORMAT] in _FORMATS


def read_stl(data: bytes) -> Iterator[Subtitle]:
    """Yield the subtitles of an EBU STL file; times count from the header's programme start.

    Raises
    ------
    CueError
        If the file is malformed; the message gives the block.
    """
    from ttconv.stl import reader
    from ttconv.stl.config import STLReaderConfiguration

    blocks, rest = divmod(len(data) - HEADER_BYTES, BLOCK_BYTES)
    if len(data) < HEADER_BYTES:
        raise CueError(f"line 1: an EBU STL header of {len(data)} bytes, not {HEADER_BYTES}")
    if rest:
        raise CueError(f"line {blocks + 1}: the last block has {rest} bytes, not {BLOCK_BYTES}")
    for number in range(blocks):
        _check_times(data[HEADER_BYTES + number * BLOCK_BYTES :], number + 1)
    try:
        document = reader.to_model(io.BytesIO(data), STLReaderConfiguration(program_start_tc="TCP"))
    except Exception as error:  # ttconv documents none and raises many
        raise CueError(f"line 1: malformed EBU STL: {error}".split("\n")[0]) from error
    yield from subtitles_of(document, count(1))


def _check_times(block: bytes, number: int) -> None:
    """Refuse times that ttconv would drop without a word."""
    extension, begin, end = block[3], tuple(block[5:9]), tuple(block[9:13])
    if extension == _USER_DATA_BLOCK:
        return
    for hours, minutes, seconds, frames in (begin, end):
        if hours > 23 or minutes > 59 or seconds > 59 or frames > 59:
            raise CueError(
                f"line {number}: malformed time {hours}:{minutes}:{seconds}:{frames} in its block"
            )
    if end <= begin:
        raise CueError(f"line {number}: subtitle ends at {end}, not after its start at {begin}")
