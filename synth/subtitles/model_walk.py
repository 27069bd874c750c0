"""Subtitles of a document in the timed-text model of ttconv, which XML and EBU STL share."""

import logging
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from codec.errors import CueError
from synth.subtitles.model import LONGEST_S, Subtitle

_NEVER = Fraction(int(LONGEST_S) + 1)

logging.getLogger("ttconv").addHandler(logging.NullHandler())


def subtitles_of(document: Any, lines: Iterator[int]) -> Iterator[Subtitle]:
    """Yield the paragraphs of a ttconv document with their absolute times.

    Parameters
    ----------
    document : ttconv.model.ContentDocument
    lines : iterator of int
        The line or block of each paragraph in turn, for messages.

    Raises
    ------
    CueError
        If a paragraph has no end or ends before it starts, or there is none; the message gives
        its line.
    """
    body = document.get_body()
    found = False
    for subtitle in _walk(body, Fraction(0), _NEVER, lines) if body is not None else ():
        found = True
        yield subtitle
    if not found:
        raise CueError("line 1: the file has no subtitles")


def _walk(
    element: Any, parent_begin: Fraction, parent_end: Fraction, lines: Iterator[int]
) -> Iterator[Subtitle]:
    from ttconv import model

    begin, end = _interval(element, parent_begin, parent_end)
    if isinstance(element, model.P):
        line = next(lines, 1)
        for start, stop, text in _pieces(element, begin, end):
            if text.strip():
                if stop == _NEVER:
                    raise CueError(f"line {line}: a subtitle without an end")
                yield Subtitle(float(start), float(stop), text.strip(), line)
        return
    for child in element:
        yield from _walk(child, begin, end, lines)


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
