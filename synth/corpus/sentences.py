"""The sentences of corpus 3: a list to choose from, and the choice."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from codec.errors import CueError
from synth.corpus.choice import Coverage, choose, coverage
from synth.rendered import line_of

N_SENTENCES = 238
"""As many as in the paper."""


def read_sentences(path: Path | None = None) -> list[str]:
    """Return the sentences of a text file, one a line, or of the built-in list.

    Empty lines and lines that start with ``#`` do not count.

    Raises
    ------
    CueError
        If the file cannot be read or holds no sentence.
    """
    source = files("synth") / "assets" / "sentences.txt" if path is None else path
    try:
        lines = [line.strip() for line in source.read_text(encoding="utf-8").splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        raise CueError(f"{source}: not a list of sentences: {error}") from error
    sentences = [line for line in lines if line and not line.startswith("#")]
    if not sentences:
        raise CueError(f"{source}: no sentence in the list")
    return sentences


def choose_sentences(
    sentences: Sequence[str], count: int = N_SENTENCES
) -> tuple[list[str], list[Coverage]]:
    """Return sentences that cover French as the whole list does, and how well they do.

    Parameters
    ----------
    sentences : sequence of str
    count : int
        At most so many are chosen; they keep the order of the list.
    """
    lines = [line_of(text) for text in sentences]
    chosen = sorted(choose(lines, count))
    return [sentences[i] for i in chosen], coverage(lines, chosen)
