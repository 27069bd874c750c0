"""Subtitles of a document in the timed-text model of ttconv, which XML and EBU STL share."""

import logging
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from synth.language.subtitles.findings import Findings
from synth.language.subtitles.model import LONGEST_S, Subtitle

_NEVER = Fraction(int(LONGEST_S) + 1)
"""A time in seconds after every caption."""

logging.getLogger("ttconv").addHandler(logging.NullHandler())


def subtitles_of(document: Any, lines: Iterator[int], findings: Findings) -> Iterator[Subtitle]:
    """Yield the paragraphs of a ttconv document with their absolute times.

    Parameters
    ----------
    document : ttconv.model.ContentDocument
    lines : iterator of int
        The line or block of each paragraph in turn, for messages.
    findings : Findings
        Told of paragraphs that have no end or end before they start.

    Raises
    ------
    CueError
        If there is no paragraph that can be read; the message gives the line.
    """
    body = document.get_body()
    found = False
    if body is not None:
        for subtitle in _walk(body, (Fraction(0), _NEVER), lines, findings):
            found = True
            yield subtitle
    if not found:
        raise findings.none_left(1)


def _walk(
    element: Any, parent: tuple[Fraction, Fraction], lines: Iterator[int], findings: Findings
) -> Iterator[Subtitle]:
    from ttconv import model

    begin, end = _interval(element, *parent)
    if isinstance(element, model.P):
        line = next(lines, 1)
        for start, stop, text in _pieces(element, begin, end):
            if text.strip():
                if stop == _NEVER:
                    findings.leave_out(line, "a subtitle without an end")
                else:
                    yield from findings.made(float(start), float(stop), text.strip(), line)
        return
    for child in element:
        yield from _walk(child, (begin, end), lines, findings)


def _interval(element: Any, begin: Fraction, end: Fraction) -> tuple[Fraction, Fraction]:
    """Return the absolute interval of an element, from that of its parent."""
    own_begin, own_end = element.get_begin(), element.get_end()
    start = begin + (own_begin or 0)
    return start, end if own_end is None else min(end, begin + own_end)


def _pieces(paragraph: Any, begin: Fraction, end: Fraction) -> list[tuple[Fraction, Fraction, str]]:
    """Return the text of a paragraph, one piece for each timing that its spans have."""
    pieces: list[tuple[Fraction, Fraction, str]] = []
    for start, stop, text in _texts(paragraph, begin, end):
        if pieces and pieces[-1][:2] == (start, stop):
            pieces[-1] = (start, stop, pieces[-1][2] + text)
        else:
            pieces.append((start, stop, text))
    return pieces


def _texts(
    element: Any, begin: Fraction, end: Fraction
) -> Iterator[tuple[Fraction, Fraction, str]]:
    from ttconv import model

    for child in element:
        if isinstance(child, model.Text):
            yield begin, end, child.get_text()
        elif isinstance(child, model.Br):
            yield begin, end, "\n"
        elif isinstance(child, (model.Span, model.Ruby, model.Rb)):
            yield from _texts(child, *_interval(child, begin, end))
