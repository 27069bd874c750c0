"""A list of sentences: the built-in one or a user's."""

from importlib.resources import files
from pathlib import Path

from codec.errors import CueError


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
