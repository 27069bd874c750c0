"""Subtitles that are aligned together: runs cut at the widest gaps.

Subtitles that follow each other closely make one run, so that speech may begin before its
subtitle appears and run on after it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from codec.errors import CueError
from synth.language.subtitles import Subtitle, spoken

LONGEST_PASSAGE_S = 25.0
"""Subtitles are aligned together up to this length."""

LONGEST_TEXT_S = 120.0
"""Limit of the sound that one subtitle, or a text without times, may span."""

_CLOSE_S = 0.8
"""Seconds between subtitles that are aligned together."""

_MARGIN_S = 0.4
"""Margin in seconds: a run's words may lie so far before or after it."""


@dataclass(frozen=True, slots=True)
class CaptionRun:
    """Subtitles that are aligned together, and the stretch of sound to search."""

    subtitles: tuple[Subtitle, ...]
    start_s: float
    end_s: float


def said_in(subtitles: Iterable[Subtitle]) -> list[Subtitle]:
    """Return the subtitles with speech, in their spoken form."""
    said = [replace(s, text=text) for s in subtitles if (text := spoken(s.text))]
    for subtitle in said:
        if subtitle.end_s - subtitle.start_s > LONGEST_TEXT_S:
            raise CueError(
                f"line {subtitle.line}: text spans {subtitle.end_s - subtitle.start_s:.0f} s, "
                f"more than the {LONGEST_TEXT_S:.0f} s that can be aligned"
            )
    return said


def runs_of(said: Sequence[Subtitle]) -> Iterator[CaptionRun]:
    """Yield runs of subtitles, cut at their widest gaps until none is longer than the limit."""
    if not said:
        return
    cuts = [0, *_cuts(said), len(said)]
    for first, end in pairwise(cuts):
        before = said[first].start_s - said[first - 1].end_s if first else 2 * _MARGIN_S
        after = said[end].start_s - said[end - 1].end_s if end < len(said) else 2 * _MARGIN_S
        yield CaptionRun(
            tuple(said[first:end]),
            max(0.0, said[first].start_s - _margin(before)),
            said[end - 1].end_s + _margin(after),
        )


def _margin(gap_s: float) -> float:
    """Return how far a run may look into the gap beside it: neighbours must not overlap."""
    return min(_MARGIN_S, max(0.0, gap_s / 2))


def _cuts(said: Sequence[Subtitle]) -> list[int]:
    """Return the indices of the subtitles that open a run, the first excepted."""
    cuts = []
    waiting = [(0, len(said))]
    while waiting:
        first, end = waiting.pop()
        if end - first < 2:
            continue
        gaps = [(said[i].start_s - said[i - 1].end_s, i) for i in range(first + 1, end)]
        middle = (first + end) / 2
        gap, cut = max(gaps, key=lambda g: (g[0], -abs(g[1] - middle)))
        if gap > _CLOSE_S or said[end - 1].end_s - said[first].start_s > LONGEST_PASSAGE_S:
            cuts.append(cut)
            waiting += [(first, cut), (cut, end)]
    return sorted(cuts)
