"""A programme as a browser plays it.

Browsers take few containers and codecs. What they do not take is written anew into a folder: the
picture is copied where they know its codec, the sound becomes AAC.
"""

import os
from pathlib import Path

from codec.errors import CueError
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.programme import open_programme

_CONTAINERS = {"mov", "mp4", "webm", "flac", "wav", "mp3", "ogg"}
_PICTURES = {"h264", "vp8", "vp9", "av1"}
_SOUNDS = {"aac", "mp3", "mp3float", "opus", "vorbis", "flac", "pcm_s16le"}

_BIT_RATE = 192_000
"""Bits per second of the sound: no loss that anyone hears, or that the mark minds."""


def playable(path: str | os.PathLike[str], folder: str | os.PathLike[str]) -> Path:
    """Return a file that a browser plays: the programme itself, or a copy in `folder`.

    Raises
    ------
    CueError
        If the programme is malformed, or its picture of a kind that no browser shows.
    """
    with open_programme(path) as programme:
        names = set(programme.container.format.name.split(","))
        picture = None if programme.picture is None else programme.picture.codec_context.name
        sound = programme.format.codec
    if picture is not None and picture not in _PICTURES:
        raise CueError(f"{path}: browsers do not show pictures in {picture}")
    if "webm" in names and "matroska" in names:  # FFmpeg reads both alike; browsers want WebM only
        names = {"webm"} if Path(path).suffix.lower() == ".webm" else set()
    if names & _CONTAINERS and sound in _SOUNDS:
        return Path(path)
    copy = Path(folder) / ("programme.mp4" if picture is not None else "programme.m4a")
    rewrite_sound(path, copy, lambda *_: Unchanged(), codec="aac", bit_rate=_BIT_RATE)
    return copy
