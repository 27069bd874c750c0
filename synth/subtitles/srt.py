"""SubRip files.

A block is a counter, a line of times and lines of text, ended by an empty line.  What players
accept is accepted: missing counters, a point for the comma, missing hours, positions after the
times, empty lines inside a text.  A line of times that cannot be read is an error.
"""

import re
from collections.abc import Iterator

from codec.errors import CueError
from synth.subtitles.model import Subtitle
from synth.subtitles.spoken import plain

_CLOCK = r"(?:(\d{1,3})\s*:\s*)?(\d{1,2})\s*:\s*(\d{1,2})(?:\s*[.,:]\s*(\d{1,3}))?"
_TIMES = re.compile(rf"\s*{_CLOCK}\s*-->\s*{_CLOCK}(?:\s.*)?$")
_LIKE_TIMES = re.compile(
    r"(?=.*\d\s*:\s*\d).*-+\s*>|\s*-?\d+:\d+:\d+[.,]\d+\W+\d+:\d+:\d+[.,]\d+\s*$"
)


def read_srt(text: str) -> Iterator[Subtitle]:
    r"""Yield the subtitles of the text of a SubRip file, in the order of the file.

    Raises
    ------
    CueError
        If a line of times is malformed or a text has no times; the message gives its line.

    Examples
    --------
    >>> next(read_srt("1\n00:00:01,500 --> 00:00:03,000\n<i>Bonjour.</i>\n"))
    Subtitle(start_s=1.5, end_s=3.0, text='Bonjour.', line=2)
    """
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if _LIKE_TIMES.match(line)]
    _check_opening(lines, heads[0] if heads else len(lines))
    for head, following in zip(heads, [*heads[1:], len(lines)], strict=True):
        start_s, end_s = _times(lines[head], head + 1)
        body = lines[head + 1 : following]
        if following < len(lines) and body and body[-1].strip().isdigit():
            body = body[:-1]
        yield Subtitle(start_s, end_s, plain("\n".join(body)).strip(), head + 1)


def _check_opening(lines: list[str], first: int) -> None:
    """Refuse a file in which text stands before the first times."""
    for number, line in enumerate(lines[:first], 1):
        if line.strip() and not line.strip().isdigit():
            raise CueError(f"line {number}: {line.strip()[:40]!r} stands where times should")
    if first == len(lines):
        raise CueError(f"line {max(1, len(lines))}: the file has no subtitles")


def _times(line: str, number: int) -> tuple[float, float]:
    match = _TIMES.match(line)
    if not match:
        raise CueError(f"line {number}: malformed times {line.strip()[:40]!r}")
    return clock_s(match.groups()[:4], number), clock_s(match.groups()[4:], number)


def clock_s(fields: tuple[str | None, ...], number: int) -> float:
    """Return seconds of (hours, minutes, seconds, fraction) as found on line `number`.

    Raises
    ------
    CueError
        If minutes or seconds exceed 59.
    """
    hours, minutes, seconds = (int(field or 0) for field in fields[:3])
    if minutes > 59 or seconds > 59:
        raise CueError(f"line {number}: {minutes} min {seconds} s: a field exceeds 59")
    whole = hours * 3600 + minutes * 60 + seconds
    return (whole * 1000 + int((fields[3] or "0").ljust(3, "0"))) / 1000
