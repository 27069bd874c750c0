"""Tags inside a subtitle of SubRip, WebVTT or ASS: colour, voice, language and position.

In: the text of a subtitle with its tags.  Out: runs of text of one appearance.
"""

import html
import re
from collections.abc import Mapping

from synth.language.subtitles.colours import colour_name
from synth.language.subtitles.model import TextRun

_MARK = re.compile(r"(\{\\[^}]*\}|</?[a-zA-Z][^<>]*>|<\d[\d:.]*>|</?>)")
_FONT = re.compile(r"<font\b.*?\bcolor\s*=\s*[\"']?([^\"'\s>]+(?:\([^)]*\))?)", re.I)
_CLASSES = re.compile(r"<c((?:\.[\w-]+)+)", re.I)
_VOICE = re.compile(r"<v(?:\.[\w.-]+)?\s+([^>]+)>", re.I)
_LANGUAGE = re.compile(r"<lang\s+([\w-]+)>", re.I)
_ASS_COLOUR = re.compile(r"\\1?c(?:&H([0-9A-Fa-f]{1,8})&?)?(?![a-zA-Z])")
_ASS_PLACE = re.compile(r"\\(an?\d{1,2}|pos\([^)]*\))")
_STYLE = re.compile(r"::cue\(\s*([^)]*?)\s*\)\s*\{([^}]*)\}", re.S)


def runs_of(
    text: str, colours: Mapping[str, str] | None = None, colour: str = ""
) -> tuple[tuple[TextRun, ...], str]:
    r"""Return the runs of a text with tags, and its position as the tags write it.

    Parameters
    ----------
    text : str
    colours : mapping, optional
        Classes of WebVTT to names of colours (`colours_of_styles`), beside the usual ones.
    colour : str
        Of text without a tag.

    Examples
    --------
    >>> runs, position = runs_of("{\\an8}<font color='red'>Bruit</font> Oui")
    >>> [(run.text, run.colour) for run in runs], position
    ([('Bruit', 'red'), (' Oui', '')], 'an8')
    """
    position = ""
    tags: list[tuple[str, TextRun]] = []
    now = TextRun("", colour)
    runs: list[TextRun] = []
    for piece in _MARK.split(text):
        if piece.startswith("{\\"):
            if place := _ASS_PLACE.search(piece):
                position = place[1]
            if (painted := _ASS_COLOUR.search(piece)) is not None:
                now = now.like(colour=ass_colour(painted[1]) if painted[1] else colour)
        elif _MARK.fullmatch(piece):
            name = re.sub(r"[^a-z].*", "", piece.lower().strip("</>"), flags=re.S)
            if not piece.startswith("</"):
                tags.append((name, now))
                now = _opened(piece, now, colours or {})
            # A closing tag also closes those that were opened inside it and never closed.
            elif any(name == opened for opened, _ in tags):
                while tags:
                    opened, before = tags.pop()
                    now = before
                    if opened == name:
                        break
        elif piece:
            words = html.unescape(piece.replace("\\N", "\n"))
            runs.append(now.like(text=words))
    return tuple(runs), position


def _opened(tag: str, now: TextRun, colours: Mapping[str, str]) -> TextRun:
    if font := _FONT.match(tag):
        return now.like(colour=colour_name(font[1]) or now.colour)
    if classes := _CLASSES.match(tag):
        for name in classes[1].lower().split("."):
            if found := colours.get(name) or colour_name(name if name.isalpha() else ""):
                return now.like(colour=found)
    if voice := _VOICE.match(tag):
        return now.like(voice=voice[1].strip())
    if language := _LANGUAGE.match(tag):
        return now.like(language=language[1])
    return now


def ass_colour(digits: str) -> str:
    """Return the name of a colour of ASS, whose digits are blue, green and red."""
    number = int(digits, 16)
    return colour_name(f"#{number & 255:02x}{number >> 8 & 255:02x}{number >> 16 & 255:02x}")


def colours_of_styles(text: str) -> dict[str, str]:
    """Return the classes of the style sheets of a WebVTT file with the names of their colours.

    Examples
    --------
    >>> colours_of_styles("::cue(.bruit) { color: #f00; }")
    {'bruit': 'red'}
    """
    found = {}
    for selector, rules in _STYLE.findall(text):
        painted = re.search(r"(?<![\w-])color\s*:\s*([^;}]+)", rules)
        for name in re.findall(r"\.([\w-]+)", selector):
            if painted and (colour := colour_name(painted[1])):
                found[name.lower()] = colour
    return found
