"""An output of FFmpeg that appears whole or not at all, the same bits for the same packets."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import av
from av.container import OutputContainer

from codec.errors import CueError
from codec.files.whole import whole_file
from receiver.media.programme import reason

_USUAL = {
    ".ts": {"max_delay": "700000"},  # decoders need the clock reference ahead of the pictures
    ".wav": {"rf64": "auto"},  # beyond 4 GiB
}
"""Options that the writer of a container needs, by suffix."""

_REPEATABLE = {"fflags": "+bitexact"}
"""Options of the writer of every container: Matroska and Ogg otherwise give each file, and each of
its streams, a random number."""


@contextmanager
def open_output(
    target: str | os.PathLike[str], options: dict[str, str] | None = None
) -> Iterator[OutputContainer]:
    """Open a new programme for writing, under a temporary name until the block succeeds.

    Parameters
    ----------
    target : path
        Its suffix names the container.
    options : dict of str, optional
        Of the container's writer, beside those that it needs.

    Raises
    ------
    CueError
        If the container, an encoder or the disk refuses. No output is left behind then.
    """
    asked = {**_USUAL.get(Path(target).suffix.lower(), {}), **(options or {})}
    with whole_file(target) as temporary:
        name = f"file:{temporary}"
        try:
            with av.open(name, "w", options=_REPEATABLE, container_options=asked) as container:
                yield container
        except (av.FFmpegError, ValueError) as error:
            raise CueError(f"{target}: cannot write: {reason(error)}") from error
