"""Writing a motion into a file of another program, chosen by the file's name."""

import os
from pathlib import Path

from codec.cuer.c3d import write_c3d
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.files.whole import whole_file
from receiver.drawing.avatar import load_avatar
from receiver.export.arkit import live_link_csv
from receiver.export.gltf import glb
from receiver.export.markers import marker_csv, trc

EXPORT_SUFFIXES = (".c3d", ".trc", ".csv", ".glb", ".arkit.csv")
"""Endings of file names that `export_motion` knows."""


def export_motion(motion: Motion, voice: Voice, path: str | os.PathLike[str]) -> None:
    """Write a motion as markers (C3D, TRC, CSV), avatar (GLB) or ARKit weights (.arkit.csv).

    Parameters
    ----------
    motion : Motion
    voice : Voice
        The voice that made it.
    path : path
        Its ending is one of `EXPORT_SUFFIXES`.

    Raises
    ------
    CueError
        If the ending is unknown, the voice has no avatar where one is needed, or a library for
        the format is missing.
    VoiceError
        If the motion belongs to another voice.
    """
    target = Path(path)
    voice.check_motion(motion)
    name = target.name.lower()
    suffix = next((s for s in reversed(EXPORT_SUFFIXES) if name.endswith(s)), None)
    if suffix is None:
        raise CueError(f"{target.name}: exports end in {', '.join(EXPORT_SUFFIXES)}")
    with whole_file(target) as temporary:
        _write(motion, voice, str(temporary), suffix, target.name)


def _write(motion: Motion, voice: Voice, path: str, suffix: str, name: str) -> None:
    match suffix:
        case ".c3d":
            write_c3d(
                path,
                voice.reconstruct(motion.params),
                rate_hz=motion.rate_hz,
                start_s=motion.start_s,
            )
        case ".trc":
            text = trc(voice.reconstruct(motion.params), motion.rate_hz, name)
            Path(path).write_text(text, encoding="utf-8")
        case ".csv":
            text = marker_csv(voice.reconstruct(motion.params), motion.times_s)
            Path(path).write_text(text, encoding="utf-8")
        case ".glb":
            Path(path).write_bytes(glb(motion, load_avatar(voice)))
        case _:
            text = live_link_csv(motion, voice, load_avatar(voice))
            Path(path).write_text(text, encoding="utf-8")
