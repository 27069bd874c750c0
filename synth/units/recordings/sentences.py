"""The sentences of corpus 3: the choice from a list."""

from collections.abc import Sequence

from synth.units.recordings.choice import SentenceCoverage, choose, coverage
from synth.units.recordings.rendered import line_of

N_SENTENCES = 238
"""Sentences, as many as in the paper."""


def choose_sentences(
    sentences: Sequence[str], count: int = N_SENTENCES
) -> tuple[list[str], list[SentenceCoverage]]:
    """Return sentences that cover French as the whole list does, and how well they do.

    Parameters
    ----------
    sentences : sequence of str
    count : int
        Number of sentences at most; they keep the order of the list.
    """
    lines = [line_of(text) for text in sentences]
    chosen = sorted(choose(lines, count))
    return [sentences[i] for i in chosen], coverage(lines, chosen)
