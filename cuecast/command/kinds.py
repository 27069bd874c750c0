"""Kinds of files, known from their content, and the verbs that take them.

A file of another kind than a verb takes is refused before any work, with the verbs that take it.
"""

import argparse
import zipfile
from pathlib import Path
from typing import Literal

from codec.errors import CueError

Kind = Literal["motion", "stream", "media", "picture", "c3d", "archive"]

_NAMES: dict[Kind, str] = {
    "motion": "a motion (M.npz)",
    "stream": "a bit stream (S.cue)",
    "media": "a sound or video file",
    "picture": "a still picture",
    "c3d": "a C3D recording",
    "archive": "an archive (npz or zip) without a motion",
}

_TAKERS: dict[Kind, str] = {
    "motion": "encode, render, compare, dub --motion",
    "stream": "decode, inspect",
    "media": "dub, receive, watch, capture",
    "picture": "render --background",
    "c3d": "capture",
    "archive": "",
}

_TAKES: dict[str, dict[str, Kind]] = {
    "encode": {"motion": "motion"},
    "decode": {"stream": "stream"},
    "inspect": {"stream": "stream"},
    "render": {"motion": "motion"},
    "compare": {"first": "motion", "second": "motion"},
    "dub": {"programme": "media", "motion": "motion"},
    "receive": {"programme": "media"},
    "watch": {"programme": "media", "motion": "motion"},
}
"""What each verb takes, by argument."""

_NO_TEXT: dict[str, tuple[str, ...]] = {
    "dub": ("subtitles",),
    "playout": ("subtitles",),
    "keys": ("file",),
    "synth": ("file",),
}
"""Arguments that take subtitles: text of some kind, and none of the kinds above."""

_HEAD_BYTES = 512
"""Read of a file to know its kind: a C3D header; a transport stream shows three packets by 377."""

_STREAM_MAGIC = b"CUES"
"""Specification: spec/bitstream.md, F2."""


def kind_of(path: str) -> Kind | None:
    """Return the kind of a file, None for any other kind, and if it is no plain file."""
    try:
        if not Path(path).is_file():
            return None
        with open(path, "rb") as file:
            head = file.read(_HEAD_BYTES)
    except (OSError, ValueError):
        return None
    if head[:4] == b"PK\x03\x04":
        return _archive_kind(path)
    if head[:4] == _STREAM_MAGIC:
        return "stream"
    if head[:8] == b"\x89PNG\r\n\x1a\n" or head[:3] == b"\xff\xd8\xff":
        return "picture"
    if head[1:2] == b"\x50" and 2 <= head[:1][0] <= 20 and len(head) == _HEAD_BYTES:
        return "c3d"
    return "media" if _is_media(head) else None


def _archive_kind(path: str) -> Kind:
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
    except (OSError, zipfile.BadZipFile, ValueError):
        return "archive"
    return "motion" if {"params.npy", "layout.npy"} <= names else "archive"


def _is_media(head: bytes) -> bool:
    """Whether a file begins as Matroska, MP4, MPEG-TS, RIFF, FLAC, Ogg or MP3 do."""
    transport = len(head) > 376 and head[0] == head[188] == head[376] == 0x47
    begins = (b"\x1aE\xdf\xa3", b"RIFF", b"RF64", b"fLaC", b"OggS", b"ID3", b"FORM")
    return transport or head.startswith(begins) or head[4:8] in (b"ftyp", b"moov", b"mdat")


def check_kinds(args: argparse.Namespace) -> None:
    """Refuse files of another kind than the verb takes.

    Raises
    ------
    CueError
        With the file, its kind, the kind the verb takes, and the verbs that take such a file.
    """
    wanted: dict[str, Kind | None] = dict(_TAKES.get(args.verb, {}))
    wanted |= dict.fromkeys(_NO_TEXT.get(args.verb, ()))
    for argument, kind in wanted.items():
        path = getattr(args, argument, None)
        found = kind_of(path) if isinstance(path, str) else None
        if found is None or found == kind:
            continue
        takes = "subtitles" if kind is None else _NAMES[kind]
        takers = _TAKERS[found]
        raise CueError(
            f"{path} is {_NAMES[found]}; {args.verb} takes {takes} here"
            + (f". For such a file: {takers}" if takers else "")
        )
