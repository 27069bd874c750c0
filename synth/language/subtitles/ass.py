"""Advanced SubStation Alpha files, and their older form SSA: the lines of dialogue.

Drawings and comments are no subtitles; a line that several layers repeat is read once.
"""

import re
from collections.abc import Iterator

from codec.errors import CueError
from synth.language.subtitles.findings import Findings
from synth.language.subtitles.markup import ass_colour, runs_of
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.spoken import plain
from synth.language.subtitles.srt import clock_s

_CLOCK = re.compile(r"(\d{1,3}):(\d{1,2}):(\d{1,2})([.,:]\d{1,3})?")
_DRAWING = re.compile(r"\{[^}]*\\p[1-9][^}]*\}.*?(?=\{[^}]*\\p0[^}]*\}|$)")
_USUAL = "layer, start, end, style, name, marginl, marginr, marginv, effect, text"


def looks_like_ass(text: str) -> bool:
    r"""Whether a text has the sections of an ASS or SSA file.

    Examples
    --------
    >>> looks_like_ass("[Script Info]\nTitle: x"), looks_like_ass("1\n00:00:01,000 -->")
    (True, False)
    """
    return bool(re.match(r"\s*\[(?:script info|v4\+? styles|events)\]", text, re.I))


def read_ass(text: str, findings: Findings) -> Iterator[Subtitle]:
    r"""Yield the lines of dialogue of an ASS file, in the order of the file.

    Raises
    ------
    CueError
        If there is none; the message gives the line.

    Examples
    --------
    >>> line = "Dialogue: 0,0:00:01.00,0:00:02.50,Main,,0,0,0,,{\\i1}Oui,{\\i0}\\Nviens !"
    >>> list(read_ass("[Events]\n" + line, Findings()))
    [Subtitle(start_s=1.0, end_s=2.5, text='Oui,\nviens !', line=2)]
    """
    lines = text.splitlines()
    names = _names(_USUAL)
    styles = _style_colours(lines)
    seen: set[tuple[float, float, str]] = set()
    for number, line in enumerate(lines, 1):
        kind, colon, rest = line.partition(":")
        # A Format line names the fields; the text comes last and may hold commas.
        if kind.strip().lower() == "format" and "text" in _names(rest):
            names = _names(rest)
        if not colon or kind.strip().lower() != "dialogue":
            continue
        fields = dict(zip(names, rest.strip().split(",", len(names) - 1), strict=False))
        try:
            times = _time(fields, "start", number), _time(fields, "end", number)
        except CueError as error:
            findings.refuse(number, error)
            continue
        said = _said(fields.get("text", ""))
        # Karaoke and shadows repeat a line at the same times.
        if said and (*times, said) not in seen:
            seen.add((*times, said))
            painted = styles.get(fields.get("style", "").strip().lower(), "")
            shown = _undrawn(fields.get("text", ""))
            yield from findings.made(*times, said, number, *runs_of(shown, None, painted))
    if not seen:
        raise findings.none_left(len(lines))


def _names(line: str) -> list[str]:
    return [name.strip().lower() for name in line.split(",")]


def _time(fields: dict[str, str], name: str, number: int) -> float:
    written = fields.get(name, "").strip()
    match = _CLOCK.fullmatch(written)
    if not match:
        raise CueError(f"line {number}: malformed {name} {written[:40]!r}")
    return clock_s(match.groups(), number)


def _said(text: str) -> str:
    """Return the text of a line of dialogue without drawings and tags."""
    return plain(re.sub(r"\{[^}]*\}", "", _undrawn(text))).strip()


def _undrawn(text: str) -> str:
    """Return the text of a line without drawings and comments, its line ends alike."""
    shown = re.sub(r"\{[^}\\]*\}", "", _DRAWING.sub("", text))
    return shown.replace("\\n", "\\N").replace("\\h", " ")


def _style_colours(lines: list[str]) -> dict[str, str]:
    """Return the colour of each style, by its name in lower case."""
    found, names = {}, ["name", "fontname", "fontsize", "primarycolour"]
    for line in lines:
        kind, _, rest = line.partition(":")
        if kind.strip().lower() == "format" and "primarycolour" in _names(rest):
            names = _names(rest)
        if kind.strip().lower() == "style":
            fields = dict(zip(names, rest.strip().split(","), strict=False))
            colour = re.match(r"\s*&H([0-9a-f]{1,8})", fields.get("primarycolour", ""), re.I)
            if colour:
                found[fields.get("name", "").strip().lower()] = ass_colour(colour[1])
    return found
