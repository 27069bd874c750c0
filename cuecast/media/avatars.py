"""Avatars of one's own as documents: an ``.avatar`` file, or a VRM or glTF that becomes one."""

import os
from pathlib import Path

from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.drawing.avatar_document import MAX_BYTES, avatar_document, read_avatar


def avatar_file(path: str | os.PathLike[str] | None, voice: Voice) -> bytes | None:
    """Return the document of an avatar; None where no file is named.

    Parameters
    ----------
    path : path, optional
        An ``.avatar`` file, or a ``.vrm`` or ``.glb`` file, which is converted.
    voice : Voice

    Raises
    ------
    CueError
        If the file is damaged, or made for another voice.
    """
    if path is None:
        return None
    source = Path(path)
    try:
        with source.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise CueError(f"{path}: cannot be read: {error.strerror}") from error
    if data[:4] == b"glTF":
        from receiver.foreign.build import foreign_avatar

        return avatar_document(foreign_avatar(source, voice)[0])
    try:
        read_avatar(data, voice)
    except CueError as error:
        raise CueError(f"{source.name}: {error}") from error
    return data
