"""WebVTT files: header, cues with settings, notes, styles, regions, the map to stream time."""

import re
from collections.abc import Iterator

from codec.errors import CueError
from synth.language.subtitles.findings import Findings
from synth.language.subtitles.markup import colours_of_styles, runs_of
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.spoken import plain
from synth.language.subtitles.srt import clock_s

_CLOCK = r"(?:(\d{2,}):)?(\d{1,2}):(\d{1,2})[.,](\d{1,3})"
_TIMES = re.compile(rf"\s*{_CLOCK}\s*-->\s*{_CLOCK}(?:\s.*)?$")
_LOOSE_TIMES = re.compile(rf"\s*{_CLOCK}\s*[-\u2010-\u2015\s]*[>\u2192]\s*{_CLOCK}(?:\s.*)?$")
"""Arrows of other shapes."""

_SETTINGS = re.compile(r"\b(?:position|line|align|vertical|region|size):\S.*$")
_LANGUAGE = re.compile(r"Language:\s*([\w-]+)\s*$")
_MAP = re.compile(r"X-TIMESTAMP-MAP=(\S+)")
_TICKS_HZ, _TICKS = 90_000, 1 << 33
"""MPEG-2 times count ticks of 1/90000 s and begin anew after 33 bits."""

_BLOCK = re.compile(r"(?:NOTE|STYLE|REGION)(?:\s|$)")


def read_vtt(text: str, findings: Findings, *, stream_s: float | None = None) -> Iterator[Subtitle]:
    r"""Yield the subtitles of the text of a WebVTT file, in the order of the file.

    Parameters
    ----------
    text : str
    findings : Findings
        Receives blocks that cannot be read.
    stream_s : float, optional
        MPEG-2 time of the zero of a player's clock in seconds: the header's X-TIMESTAMP-MAP
        (RFC 8216, section 3.5) then moves the subtitles; what ends before the programme starts is
        left out. Without it times are those of the file itself.

    Raises
    ------
    CueError
        If the header or its map is malformed, or nothing can be read; the message gives the line.

    Examples
    --------
    >>> lines = "WEBVTT\n\n00:01.000 --> 00:02.000 align:start\n<v Anne>Oui.</v>"
    >>> next(read_vtt(lines, Findings()))
    Subtitle(start_s=1.0, end_s=2.0, text='Oui.', line=3)
    """
    lines = text.splitlines()
    if not lines or not re.match(r"WEBVTT(?:\s|$)", lines[0]):
        raise CueError(f"line 1: {lines[0][:40] if lines else ''!r} is not the header WEBVTT")
    found = False
    colours = colours_of_styles(text) if "::cue(" in text else {}
    moved_s = 0.0 if stream_s is None else _moved_s(lines, stream_s)
    for number, block in _blocks(lines):
        if number == 1:
            declared = filter(None, map(_LANGUAGE.match, block))
            findings.language = next((match[1] for match in declared), "")
        # NOTE, STYLE and REGION blocks, and the header.
        if _BLOCK.match(block[0]) or (number == 1 and "-->" not in "".join(block)):
            continue
        try:
            start_s, end_s, line, first = _times(block, number, strict=findings.strict)
        except CueError as error:
            findings.refuse(_line_of(error, number), error)
            continue
        found = True
        if moved_s and end_s + moved_s <= 0:
            continue
        tagged = "\n".join(block[first:])
        runs, _ = runs_of(tagged, colours)
        place = _SETTINGS.search(block[first - 1])
        opens_s = max(start_s + moved_s, 0.0) if moved_s else start_s
        yield from findings.made(
            opens_s, end_s + moved_s, plain(tagged).strip(), line, runs, place[0] if place else ""
        )
    if not found:
        raise findings.none_left(len(lines))


def _times(block: list[str], number: int, *, strict: bool) -> tuple[float, float, int, int]:
    """Return start, end, the line of the times, and where in the block the text begins."""
    arrow = "-->" if strict else ">"
    forms = (_TIMES,) if strict else (_TIMES, _LOOSE_TIMES)
    head = next((i for i, line in enumerate(block[:2]) if arrow in line or "\u2192" in line), None)
    if head is None:
        raise CueError(f"line {number}: {block[0][:40]!r} stands where times should")
    match = next((m for form in forms if (m := form.match(block[head]))), None)
    if match is None:
        raise CueError(f"line {number + head}: malformed times {block[head].strip()[:40]!r}")
    start_s = clock_s(match.groups()[:4], number + head)
    return start_s, clock_s(match.groups()[4:], number + head), number + head, head + 1


def _line_of(error: CueError, number: int) -> int:
    """Return the line that an error gives, else `number`."""
    given = re.match(r"line (\d+): ", str(error))
    return int(given[1]) if given else number


def _moved_s(lines: list[str], stream_s: float) -> float:
    """Return how much later on a player's clock the subtitles are than they say."""
    for number, line in enumerate(lines, 1):
        if not line.strip():
            break
        if mapped := _MAP.match(line.strip()):
            fields = dict(part.partition(":")[::2] for part in mapped[1].split(","))
            local = re.fullmatch(_CLOCK, fields.get("LOCAL", "00:00.000"))
            ticks = fields.get("MPEGTS", "0")
            if local is None or not (ticks.isascii() and ticks.isdigit()):
                raise CueError(f"line {number}: malformed {line.strip()[:40]!r}")
            since = int(ticks) - round(stream_s * _TICKS_HZ)
            # The shorter way round: the programme may lie across the end of the count.
            since = (since + _TICKS // 2) % _TICKS - _TICKS // 2
            return since / _TICKS_HZ - clock_s(local.groups(), number)
    return 0.0


def _blocks(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield (number of its first line, lines) of each run of lines that are not empty."""
    block: list[str] = []
    for number, line in enumerate([*lines, ""], 1):
        if line.strip():
            block.append(line)
        elif block:
            yield number - len(block), block
            block = []
