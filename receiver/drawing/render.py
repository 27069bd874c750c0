"""Films and pictures of a motion: PNG through PyAV's encoder, MP4 with H.264.

A `Motion` and its voice go in, a file comes out; the picture is the page's.
"""

import os
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.files.whole import whole_file
from receiver.drawing.avatar import load_avatar
from receiver.drawing.points import draw_points
from receiver.drawing.portrait import Portrait
from receiver.drawing.voice_document import neutral_camera

STYLES = ("points", "avatar")

DEFAULT_SIZE = (620, 720)
"""Width and height of a picture in pixels, of the camera's shape."""

_MAX_SIDE = 4096
"""Longest side of a picture in pixels."""

_CRF = "18"

Progress = Callable[[int, int], None]
"""Called with the number of frames done and to do."""


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

    Yields
    ------
    ndarray of uint8, shape (height, width, 3)

    Raises
    ------
    CueError
        If style, size or background do not fit.
    VoiceError
        If the motion belongs to another voice.
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
    avatar = load_avatar(voice) if style == "avatar" else None
    portrait = None if avatar is None else Portrait(avatar, camera, mirror=mirror)
    ground = np.zeros((height, width, 3), np.uint8) if background is None else background
    for time_s in times_s:
        picture = ground.copy()
        now = np.array([time_s])
        params = sample_params(motion, now)
        if avatar is None or portrait is None:
            draw_points(picture, voice.reconstruct(params)[0], camera, mirror=mirror)
        else:
            portrait.draw(picture, avatar.place(params, now)[0])
        yield picture


def render_motion(
    motion: Motion, voice: Voice, path: str | os.PathLike[str],
    *, style: str = "points", size: tuple[int, int] | None = None, fps: int = 25,
    background: str | os.PathLike[str] | NDArray[np.uint8] | None = None,
    mirror: bool = False, at_s: float | None = None, progress: Progress | None = None,
) -> None:  # fmt: skip
    """Draw a motion into a film (``.mp4``) or one of its frames into a picture (``.png``).

    Parameters
    ----------
    motion : Motion
    voice : Voice
        The voice that made it.
    path : path
        Its suffix chooses film or picture.
    style : str
        ``points`` or ``avatar``.
    size : (width, height), optional
        Pixels; even for a film. The background's size, or 620 x 720.
    fps : int
        Frames per second of a film.
    background : path or ndarray (height, width, 3), optional
        Picture behind the cuer; black otherwise.
    mirror : bool
        Left-handed cuer.
    at_s : float, optional
        Time of a picture, seconds on the programme's clock; the middle of the motion otherwise.
    progress : callable, optional
        Told (frames done, frames in all).

    Raises
    ------
    CueError
        If the suffix, the size or the background is unusable, or the motion is empty.
    VoiceError
        If the motion belongs to another voice.
    """
    target = Path(path)
    picture = background
    if isinstance(picture, str | os.PathLike):
        picture = read_picture(picture)
    if size is None:
        size = DEFAULT_SIZE if picture is None else (picture.shape[1], picture.shape[0])
    if len(motion.params) == 0:
        raise CueError("motion holds no frames to draw")
    write = {".png": _write_still, ".mp4": _write_film}.get(target.suffix.lower())
    if write is None:
        raise CueError(f"{target.name}: a film ends in .mp4, a picture in .png")
    if write is _write_still:
        middle = motion.start_s + motion.duration_s / 2
        times = np.array([middle if at_s is None else at_s])
    else:
        times = motion.start_s + np.arange(max(1, round(motion.duration_s * fps))) / fps
    frames = draw(motion, voice, times, style=style, size=size, background=picture, mirror=mirror)
    with whole_file(target) as temporary:
        write(str(temporary), _counted(frames, len(times), progress), size, fps)


def _counted(
    frames: Iterator[NDArray[np.uint8]], total: int, progress: Progress | None
) -> Iterator[NDArray[np.uint8]]:
    for done, frame in enumerate(frames, 1):
        yield frame
        if progress is not None:
            progress(done, total)


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


def _write_still(
    name: str, frames: Iterator[NDArray[np.uint8]], size: tuple[int, int], fps: int
) -> None:
    write_picture(name, next(frames))
    next(frames, None)


def _write_film(
    name: str, frames: Iterator[NDArray[np.uint8]], size: tuple[int, int], fps: int
) -> None:
    if size[0] % 2 or size[1] % 2:
        raise CueError(f"film of {size[0]}x{size[1]}: both sides have to be even")
    with av.open(name, "w", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=fps)
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": _CRF, "preset": "veryfast"}
        for picture in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
