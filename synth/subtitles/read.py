"""Reading a subtitle file whatever its format: SubRip, WebVTT, EBU-TT-D / IMSC, EBU STL."""

from collections.abc import Iterator
from pathlib import Path

from codec.errors import CueError
from synth.subtitles.encoding import decode
from synth.subtitles.model import Subtitle
from synth.subtitles.rollup import unrolled
from synth.subtitles.srt import read_srt
from synth.subtitles.stl import looks_like_stl, read_stl
from synth.subtitles.ttml import read_ttml
from synth.subtitles.vtt import read_vtt

LARGEST_BYTES = 64 * 1024 * 1024
"""Limit of a subtitle file; a week of programme stays far below."""


def read_subtitles(path: str | Path, *, stream_s: float | None = None) -> list[Subtitle]:
    """Return the subtitles of a file, sorted by their start.

    Parameters
    ----------
    path : path
        The format is told by the content, not by the name.
    stream_s : float, optional
        As in `synth.subtitles.vtt.read_vtt`.

    Raises
    ------
    CueError
        If the file cannot be read or is malformed; the message gives the file and the line.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        data = path.read_bytes() if size <= LARGEST_BYTES else b""
    except OSError as error:
        raise CueError(f"{path}: cannot read subtitles: {error.strerror}") from error
    if size > LARGEST_BYTES:
        raise CueError(f"{path}: {size} bytes of subtitles, more than {LARGEST_BYTES}")
    try:
        return parse_subtitles(data, stream_s=stream_s)
    except CueError as error:
        raise CueError(f"{path}: {error}") from error


def parse_subtitles(data: bytes, *, stream_s: float | None = None) -> list[Subtitle]:
    r"""Return the subtitles of the bytes of a file, sorted by their start.

    Raises
    ------
    CueError
        If they are malformed; the message begins with the line.

    Examples
    --------
    >>> parse_subtitles(b"00:01 --> 00:02.5\nOui.")
    [Subtitle(start_s=1.0, end_s=2.5, text='Oui.', line=1)]
    """
    if not data.strip():
        raise CueError("line 1: the file is empty")
    return list(unrolled(sorted(_parse(data, stream_s), key=lambda s: (s.start_s, s.line))))


def _parse(data: bytes, stream_s: float | None) -> Iterator[Subtitle]:
    if looks_like_stl(data):
        return read_stl(data)
    text = decode(data)
    opening = text.lstrip()
    if opening.startswith("<"):
        return read_ttml(data)
    if opening.startswith("WEBVTT"):
        return read_vtt(text, stream_s=stream_s)
    return read_srt(text)
