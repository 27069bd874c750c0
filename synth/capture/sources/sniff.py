"""What kind of recording a file is, by its first bytes rather than its name."""

import os
from pathlib import Path

from codec.errors import CueError
from synth.capture.sources.landmark_table import is_landmark_table

KINDS = ("c3d", "trc", "tsv", "points", "livelink", "landmarks", "video")
"""What `kind_of` returns."""

_HEAD_BYTES = 1 << 16
"""Bytes that identify the kind."""

_PICTURES = {
    ".mp4", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".ts", ".m2ts", ".mts", ".m4v",
    ".mxf", ".wmv", ".flv", ".ogv", ".3gp",
}  # fmt: skip


def kind_of(path: str | os.PathLike[str]) -> str:
    """Return the kind of recording in a file, one of `KINDS`.

    Raises
    ------
    CueError
        If the file is missing, empty, or nothing known.
    """
    try:
        with open(path, "rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error
    if not head:
        raise CueError(f"{path}: an empty file")
    if len(head) > 1 and head[1] == 0x50 and b"\0" in head[:64]:
        return "c3d"
    if b"\0" in head or Path(path).suffix.lower() in _PICTURES:
        return "video"
    kind = _text_kind(head.decode("utf-8-sig", errors="replace"))
    if kind is None:
        raise CueError(
            f"{path}: not C3D, TRC, Qualisys TSV, Live Link Face or landmark CSV, nor a video"
        )
    return kind


def _text_kind(text: str) -> str | None:
    first = text.lstrip().split("\n", 1)[0].lower()
    fields = {field.strip(' "\r') for field in first.split(",")}
    if first.startswith("pathfiletype"):
        return "trc"
    if "MARKER_NAMES" in text or first.startswith("no_of_frames"):
        return "tsv"
    if "blendshapecount" in fields or "eyeblinkleft" in fields:
        return "livelink"
    if is_landmark_table(fields):
        return "landmarks"
    if any(field.endswith((".x", "_x", " x")) for field in fields):
        return "points"
    return None
