"""SubRip files.

A block is a counter, a line of times and lines of text, ended by an empty line.  What players
accept is accepted: missing counters, a point for the comma, missing hours, positions after the
times, empty lines inside a text.  A block whose times cannot be read is left out; a reader that
is not strict also knows arrows of other shapes, and YouTube's commas between times.
"""

import re
from collections.abc import Iterator

from codec.errors import CueError
from synth.language.subtitles.findings import Findings
from synth.language.subtitles.markup import runs_of
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.spoken import plain

_CLOCK = r"(?:(\d{1,3})\s*:\s*)?(\d{1,2})\s*:\s*(\d{1,2})(?:\s*([.,:]\s*\d{1,3}))?"
_TIMES = re.compile(rf"\s*{_CLOCK}\s*-->\s*{_CLOCK}(?:\s.*)?$")
_LOOSE_TIMES = re.compile(
    rf"\s*{_CLOCK}\s*(?:[-\u2010-\u2015\s]*[>\u2192]|,(?=\d+:\d\d:))\s*{_CLOCK}(?:\s.*)?$"
)
_LIKE_TIMES = re.compile(
    r"(?=.*\d\s*:\s*\d).*-+\s*>|\s*-?\d+:\d+:\d+[.,]\d+\W+\d+:\d+:\d+[.,]\d+\s*$"
    r"|\s*\d+:\d+:\d+\S*\s*[\u2010-\u2015\u2192]+>?\s*\d+:\d+"
)
_FRAMES_HZ = 25
"""Frames per second of times that end in two digits after a colon: European television."""


def read_srt(text: str, findings: Findings) -> Iterator[Subtitle]:
    r"""Yield the subtitles of the text of a SubRip file, in the order of the file.

    Parameters
    ----------
    text : str
    findings : Findings
        Receives blocks that cannot be read.

    Raises
    ------
    CueError
        If there is no line of times; the message gives the line.

    Examples
    --------
    >>> lines = "1\n00:00:01,500 --> 00:00:03,000\n<i>Bonjour.</i>\n"
    >>> next(read_srt(lines, Findings()))
    Subtitle(start_s=1.5, end_s=3.0, text='Bonjour.', line=2)
    """
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if _LIKE_TIMES.match(line)]
    _check_opening(lines, heads[0] if heads else len(lines), findings)
    for head, following in zip(heads, [*heads[1:], len(lines)], strict=True):
        body = lines[head + 1 : following]
        if following < len(lines) and body and body[-1].strip().isdigit():
            body = body[:-1]
        body = _timed(lines[head - 1 : head], body, head + 2, findings)
        try:
            start_s, end_s = _times(lines[head], head + 1, strict=findings.strict)
        except CueError as error:
            findings.refuse(head + 1, error)
            continue
        text = "\n".join(body)
        yield from findings.made(start_s, end_s, plain(text).strip(), head + 1, *runs_of(text))


def _timed(before: list[str], body: list[str], first: int, findings: Findings) -> list[str]:
    """Return a block's text up to where the next block opens with its counter but has no times."""
    counter = before[0].strip() if before else ""
    if counter.isdecimal():
        for i in range(1, len(body) - 1):
            opens = not body[i - 1].strip() and body[i].strip() == str(int(counter) + 1)
            if opens and body[i + 1].strip():
                findings.leave_out(first + i, f"{body[i + 1].strip()[:40]!r} has no times")
                return body[:i]
    return body


def _check_opening(lines: list[str], first: int, findings: Findings) -> None:
    """Leave out text that stands before the first times."""
    loose = [
        i for i, line in enumerate(lines[:first]) if line.strip() and not line.strip().isdigit()
    ]
    for i in loose[:1]:
        findings.leave_out(i + 1, f"{lines[i].strip()[:40]!r} stands where times should")
    if first == len(lines):
        raise findings.none_left(max(1, len(lines)))


def _times(line: str, number: int, *, strict: bool) -> tuple[float, float]:
    forms = (_TIMES,) if strict else (_TIMES, _LOOSE_TIMES)
    match = next((found for form in forms if (found := form.match(line))), None)
    if not match:
        raise CueError(f"line {number}: malformed times {line.strip()[:40]!r}")
    return clock_s(match.groups()[:4], number), clock_s(match.groups()[4:], number)


def clock_s(fields: tuple[str | None, ...], number: int) -> float:
    """Return seconds of (hours, minutes, seconds, fraction) as found on line `number`.

    The fraction may bring its sign: after a colon two digits are frames.

    Raises
    ------
    CueError
        If minutes or seconds exceed 59.

    Examples
    --------
    >>> clock_s(("1", "0", "2", ",5"), 1), clock_s((None, "0", "2", ":12"), 1)
    (3602.5, 2.48)
    """
    hours, minutes, seconds = (int(field or 0) for field in fields[:3])
    if minutes > 59 or seconds > 59:
        raise CueError(f"line {number}: {minutes} min {seconds} s: a field exceeds 59")
    whole = hours * 3600 + minutes * 60 + seconds
    fraction = fields[3] or "0"
    digits = fraction.lstrip(".,: ")
    if fraction[0] == ":" and len(digits) == 2:
        return whole + int(digits) / _FRAMES_HZ
    return (whole * 1000 + int(digits.ljust(3, "0"))) / 1000
