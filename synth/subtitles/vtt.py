"""WebVTT files: header, cues with settings, notes, styles, regions, the map to stream time."""

import re
from collections.abc import Iterator

from codec.errors import CueError
from synth.subtitles.model import Subtitle
from synth.subtitles.spoken import plain
from synth.subtitles.srt import clock_s

_CLOCK = r"(?:(\d{2,}):)?(\d{1,2}):(\d{1,2})[.,](\d{1,3})"
_TIMES = re.compile(rf"\s*{_CLOCK}\s*-->\s*{_CLOCK}(?:\s.*)?$")
_BLOCK = re.compile(r"(?:NOTE|STYLE|REGION)(?:\s|$)")


def read_vtt(text: str) -> Iterator[Subtitle]:
    r"""Yield the subtitles of the text of a WebVTT file, in the order of the file.

    The header's X-TIMESTAMP-MAP is not applied: times are those of the file itself.

    Raises
    ------
    CueError
        If the header or a line of times is malformed; the message gives its line.

    Examples
    --------
    >>> next(read_vtt("WEBVTT\n\n00:01.000 --> 00:02.000 align:start\n<v Anne>Oui.</v>"))
    Subtitle(start_s=1.0, end_s=2.0, text='Oui.', line=3)
    """
    lines = text.splitlines()
    if not lines or not re.match(r"WEBVTT(?:\s|$)", lines[0]):
        raise CueError(f"line 1: {lines[0][:40] if lines else ''!r} is not the header WEBVTT")
    found = False
    for number, block in _blocks(lines):
        if _BLOCK.match(block[0]) or (number == 1 and "-->" not in "".join(block)):
            continue
        head = next((i for i, line in enumerate(block[:2]) if "-->" in line), None)
        if head is None:
            raise CueError(f"line {number}: {block[0][:40]!r} stands where times should")
        match = _TIMES.match(block[head])
        if not match:
            raise CueError(f"line {number + head}: malformed times {block[head].strip()[:40]!r}")
        found = True
        yield Subtitle(
            clock_s(match.groups()[:4], number + head), clock_s(match.groups()[4:], number + head),
            plain("\n".join(block[head + 1 :])).strip(), number + head,
        )  # fmt: skip
    if not found:
        raise CueError(f"line {len(lines)}: the file has no subtitles")


def _blocks(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield (number of its first line, lines) of each run of lines that are not empty."""
    block: list[str] = []
    for number, line in enumerate([*lines, ""], 1):
        if line.strip():
            block.append(line)
        elif block:
            yield number - len(block), block
            block = []
