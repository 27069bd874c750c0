"""Merging of decoded superframes into one score, whole or as they arrive."""

from collections.abc import Iterable

from codec.joining import score_of
from codec.score import Key, Score
from codec.score_coding import ScorePart
from codec.superframe import DecodedSuperframe
from codec.timeline import SUPERFRAME_S, TICK_S
from codec.window import Window


def merge_scores(superframes: Iterable[DecodedSuperframe]) -> Score:
    """Return the score that superframes tell together, every phone and key once.

    Parameters
    ----------
    superframes : iterable of DecodedSuperframe
        In any order; concealed ones say nothing.

    Returns
    -------
    Score
        Exact, on the grid of 20 ms, where no superframe is missing.
    """
    return score_of({s.index: s.part for s in superframes if s.part is not None})


_REACH = 5
"""Superframes before one that can tell keys of it, or how far a loss reaches."""


class ScoreMerger:
    """Keys of superframes that arrive in order of time, each given out once and complete."""

    def __init__(self) -> None:
        self._parts: dict[int, ScorePart | Window] = {}
        self._settled: int | None = None

    def add(self, superframe: DecodedSuperframe) -> list[Key]:
        """Take the next superframe; return the keys that start before it and not yet given."""
        if superframe.part is not None:
            self._parts[superframe.index] = superframe.part
        return self._until(superframe.index)

    def flush(self) -> list[Key]:
        """Return the keys that were still open."""
        return self._until(max(self._parts, default=0) + 2)

    def _until(self, index: int) -> list[Key]:
        # The sound of a superframe's first phone may have begun in the one before.
        first = index - 1 if self._settled is None else self._settled
        begin, end = (k * SUPERFRAME_S - 0.5 * TICK_S for k in (first, index))
        keys = [key for key in score_of(self._parts).keys if begin <= key.start < end]
        self._settled = max(first, index)
        self._parts = {k: part for k, part in self._parts.items() if k >= index - _REACH}
        return keys
