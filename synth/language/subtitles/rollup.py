"""Live captions with lines that stay on the screen: repeated lines are not spoken again.

In: subtitles sorted by start.  Out: the same without lines that the one before has shown, without
words that grow letter by letter into a sentence, and without a second copy of the same subtitle.
Only subtitles that follow each other at once are looked at: who repeats himself takes a breath.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from synth.language.subtitles.model import Subtitle

_AT_ONCE_S = 0.15
"""Seconds between captions that count as one following the other at once."""


def unrolled(subtitles: Iterable[Subtitle]) -> Iterator[Subtitle]:
    r"""Yield the subtitles without lines that were on the screen already.

    Examples
    --------
    >>> lines = [Subtitle(0, 2, "Bonjour,"), Subtitle(2, 4, "Bonjour,\ncher ami.")]
    >>> [subtitle.text for subtitle in unrolled(lines)]
    ['Bonjour,', 'cher ami.']
    """
    shown: Subtitle | None = None
    waiting: Subtitle | None = None
    for subtitle in subtitles:
        fresh = subtitle.text
        if shown is not None and subtitle.start_s > shown.start_s:
            at_once = abs(subtitle.start_s - shown.end_s) < _AT_ONCE_S
            fresh = _fresh(shown.text, subtitle.text) if at_once else fresh
        if waiting is not None and not fresh:
            waiting = replace(waiting, end_s=max(waiting.end_s, subtitle.end_s))
        else:
            if waiting is not None:
                yield waiting
            waiting = replace(subtitle, text=fresh)
        shown = subtitle
    if waiting is not None:
        yield waiting


def _fresh(before: str, now: str) -> str:
    """Return what `now` shows that `before` did not."""
    old, new = before.split("\n"), now.split("\n")
    for count in range(min(len(old), len(new)), 0, -1):
        if old[-count:] == new[:count]:
            return "\n".join(new[count:])
    if now.startswith(before + " "):
        return now[len(before) + 1 :]
    return now
