"""Pictures of a motion, one for each time; picture files through PyAV.

A `Motion` and its voice go in, pictures come out: the page's.
"""

import os
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.drawing.avatar import load_avatar
from receiver.drawing.avatar_document import read_avatar
from receiver.drawing.movement import express
from receiver.drawing.points import draw_points
from receiver.drawing.portrait import Portrait
from receiver.drawing.voice_document import neutral_camera

STYLES = ("points", "avatar")

DEFAULT_SIZE = (620, 720)
"""Width and height of a picture in pixels, of the camera's shape."""

_AT_ONCE = 8
"""Frames whose vertices are computed together: fewer calls, for some megabytes."""

_MAX_SIDE = 4096
"""Longest side of a picture in pixels."""


def read_picture(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Read a picture file, or the first frame of a film, as (height, width, 3) RGB.

    Raises
    ------
    CueError
        If it is not a picture.
    """
    try:
        with av.open(os.fspath(path)) as container:
            for frame in container.decode(video=0):
                return np.asarray(frame.to_ndarray(format="rgb24"), dtype=np.uint8)
    except (av.error.FFmpegError, OSError, IndexError) as error:
        raise CueError(f"{path}: cannot be read as a picture: {error}") from error
    raise CueError(f"{path}: holds no picture")


def draw(
    motion: Motion, voice: Voice, times_s: NDArray[np.float64],
    *, style: str = "points", size: tuple[int, int] = DEFAULT_SIZE,
    background: NDArray[np.uint8] | None = None, mirror: bool = False,
    look: str | None = None, avatar: bytes | None = None,
) -> Iterator[NDArray[np.uint8]]:  # fmt: skip
    """Yield a picture of the cuer for each time.

    Parameters
    ----------
    motion : Motion
    voice : Voice
        That of the motion.
    times_s : ndarray of float64, shape (n,)
        Seconds on the programme's clock.
    style : str
        One of `STYLES`.
    size : tuple of int
        Width and height in pixels.
    background : ndarray of uint8, shape (height, width, 3), optional
        Red, green, blue of what she stands before; black by default.
    mirror : bool
        Whether to swap left and right.
    look : str, optional
        Appearance of the avatar, one of `Avatar.looks`.
    avatar : bytes, optional
        Document of another avatar for this voice, which has one look.

    Yields
    ------
    ndarray of uint8, shape (height, width, 3)

    Raises
    ------
    CueError
        If style, size, background or look do not fit.
    VoiceError
        If the motion belongs to another voice.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> motion = motion_of(score_of_text("Oui"), voice)
    >>> (picture,) = draw(motion, voice, np.array([0.3]), size=(160, 120))
    >>> picture.shape, bool(picture.any())
    ((120, 160, 3), True)
    """
    width, height = size
    if not (16 <= width <= _MAX_SIDE and 16 <= height <= _MAX_SIDE):
        raise CueError(f"picture of {width}x{height} is not within 16..{_MAX_SIDE} a side")
    if style not in STYLES:
        raise CueError(f"unknown style {style!r}: {' and '.join(STYLES)} are known")
    voice.check_motion(motion)
    if background is not None and background.shape != (height, width, 3):
        raise CueError(f"background has shape {background.shape}, not {(height, width, 3)}")
    camera = neutral_camera(voice)
    figure = None
    if style == "avatar":
        figure = load_avatar(voice, look) if avatar is None else read_avatar(avatar, voice)
    portrait = None if figure is None else Portrait(figure, camera, mirror=mirror)
    ground = np.zeros((height, width, 3), np.uint8) if background is None else background
    for start in range(0, len(times_s), _AT_ONCE):
        now = np.asarray(times_s[start : start + _AT_ONCE], dtype=np.float64)
        params = sample_params(motion, now)
        if figure is None or portrait is None:
            for markers in voice.reconstruct(params):
                picture = ground.copy()
                draw_points(picture, markers, camera, mirror=mirror)
                yield picture
        else:
            for vertices in figure.place(
                params, express(voice, partial(sample_params, motion), now)
            ):
                picture = ground.copy()
                portrait.draw(picture, vertices)
                yield picture


def write_picture(path: str | os.PathLike[str], picture: NDArray[np.uint8]) -> None:
    """Write a picture (height, width, 3) as PNG; missing folders are made."""
    codec = av.CodecContext.create("png", "w")
    codec.height, codec.width = picture.shape[:2]
    codec.pix_fmt = "rgb24"
    codec.time_base = Fraction(1, 1)
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(b"".join(map(bytes, [*codec.encode(frame), *codec.encode(None)])))
