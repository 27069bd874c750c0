"""Subtitles of a document in the timed-text model of ttconv, which XML and EBU STL share."""

import logging
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from synth.language.subtitles.colours import of_levels
from synth.language.subtitles.findings import Findings
from synth.language.subtitles.model import LONGEST_S, Subtitle, TextRun

_NEVER = Fraction(int(LONGEST_S) + 1)
"""A time in seconds after every caption."""

logging.getLogger("ttconv").addHandler(logging.NullHandler())


def subtitles_of(
    document: Any, lines: Iterator[tuple[int, int]], findings: Findings
) -> Iterator[Subtitle]:
    """Yield the paragraphs of a ttconv document with their absolute times.

    Parameters
    ----------
    document : ttconv.model.ContentDocument
    lines : iterator of (int, int)
        The line or block and the column of each paragraph in turn, for messages.
    findings : Findings
        Receives paragraphs that have no end or end before they start.

    Raises
    ------
    CueError
        If there is no paragraph that can be read; the message gives the line.
    """
    body = document.get_body()
    found = False
    if body is not None:
        for subtitle in _walk(body, (Fraction(0), _NEVER), TextRun(""), lines, findings):
            found = True
            yield subtitle
    if not found:
        raise findings.none_left(1)


def _walk(
    element: Any,
    parent: tuple[Fraction, Fraction],
    look: TextRun,
    lines: Iterator[tuple[int, int]],
    findings: Findings,
) -> Iterator[Subtitle]:
    from ttconv import model

    begin, end = _interval(element, *parent)
    look = _look(element, look)
    if isinstance(element, model.P):
        line, column = next(lines, (1, 0))
        region = element.get_region()
        place = region.get_id() if region is not None else ""
        for start, stop, runs in _pieces(element, begin, end, look):
            text = "".join(run.text for run in runs).strip()
            if text and stop == _NEVER:
                findings.leave_out(line, "a subtitle without an end")
            elif text:
                yield from findings.made(
                    float(start), float(stop), text, line, tuple(runs), place, column
                )
        return
    for child in element:
        yield from _walk(child, (begin, end), look, lines, findings)


def _look(element: Any, parent: TextRun) -> TextRun:
    """Return the colour and language of an element, from those of its parent."""
    from ttconv.style_properties import StyleProperties

    colour = element.get_style(StyleProperties.Color)
    named = of_levels(*colour.components[:3]) if colour is not None else parent.colour
    return TextRun("", named, "", element.get_lang() or parent.language)


def _interval(element: Any, begin: Fraction, end: Fraction) -> tuple[Fraction, Fraction]:
    """Return the absolute interval of an element, from that of its parent."""
    own_begin, own_end = element.get_begin(), element.get_end()
    start = begin + (own_begin or 0)
    return start, end if own_end is None else min(end, begin + own_end)


def _pieces(
    paragraph: Any, begin: Fraction, end: Fraction, look: TextRun
) -> list[tuple[Fraction, Fraction, list[TextRun]]]:
    """Return the text of a paragraph, one piece for each timing that its spans have."""
    pieces: list[tuple[Fraction, Fraction, list[TextRun]]] = []
    for start, stop, run in _texts(paragraph, begin, end, look):
        if pieces and pieces[-1][:2] == (start, stop):
            pieces[-1][2].append(run)
        else:
            pieces.append((start, stop, [run]))
    return pieces


def _texts(
    element: Any, begin: Fraction, end: Fraction, look: TextRun
) -> Iterator[tuple[Fraction, Fraction, TextRun]]:
    from ttconv import model

    for child in element:
        if isinstance(child, model.Text):
            yield begin, end, look.like(text=child.get_text())
        elif isinstance(child, model.Br):
            yield begin, end, look.like(text="\n")
        elif isinstance(child, (model.Span, model.Ruby, model.Rb)):
            yield from _texts(child, *_interval(child, begin, end), _look(child, look))
