"""A film or a picture of the cuer's motion, with the programme's sound and captions.

A `Motion` and its voice go in, a file comes out; the picture is the page's.
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.files.whole import whole_file
from cuecast.media.film import captions_of, programme_sound, write_film
from receiver.drawing.render import DEFAULT_SIZE, draw, read_picture, write_picture

_CRF = 18
"""Quality of the pictures: the hand's edges stay sharp."""

_SOUND_BIT_RATE = 192_000
"""Of AAC, bit/s."""

Progress = Callable[[int, int], None]
"""Called with the number of frames done and to do."""


def render_motion(
    motion: Motion, voice: Voice, path: str | os.PathLike[str],
    *, style: str = "points", size: tuple[int, int] | None = None, fps: int = 25,
    background: str | os.PathLike[str] | NDArray[np.uint8] | None = None,
    mirror: bool = False, look: str | None = None, avatar: bytes | None = None,
    at_s: float | None = None,
    programme: str | os.PathLike[str] | None = None,
    subtitles: str | os.PathLike[str] | None = None, track: str | None = None,
    progress: Progress | None = None,
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
    look : str, optional
        Appearance of the avatar, one of `Avatar.looks`.
    avatar : bytes, optional
        Document of another avatar for this voice, which has one look.
    at_s : float, optional
        Time of a picture, seconds on the programme's clock; the middle of the motion otherwise.
    programme : path, optional
        The film gets its sound, and a text track of its subtitles.
    subtitles : path, optional
        File of subtitles for the text track, in place of the programme's.
    track : str, optional
        Which of the programme's subtitles: number or language.
    progress : callable, optional
        Called with frames done and frames in all.

    Raises
    ------
    CueError
        If the suffix, the size, the background, the programme or the subtitles are unusable, or
        the motion is empty.
    VoiceError
        If the motion belongs to another voice.
    """
    target = Path(path)
    picture = read_picture(background) if isinstance(background, str | os.PathLike) else background
    if size is None:
        size = DEFAULT_SIZE if picture is None else (picture.shape[1], picture.shape[0])
    if len(motion.params) == 0:
        raise CueError("motion holds no frames to draw")
    suffix = target.suffix.lower()
    if suffix not in (".png", ".mp4"):
        raise CueError(f"{target.name}: a film ends in .mp4, a picture in .png")
    start_s, duration_s = motion.start_s, motion.duration_s
    times = start_s + np.arange(max(1, round(duration_s * fps))) / fps
    if suffix == ".png":
        if programme is not None or subtitles is not None:
            raise CueError(f"{target.name}: a picture has neither sound nor captions")
        times = np.array([start_s + duration_s / 2 if at_s is None else at_s])
    elif size[0] % 2 or size[1] % 2:
        raise CueError(f"film of {size[0]}x{size[1]}: both sides have to be even")
    shown_at = draw(
        motion,
        voice,
        times,
        style=style,
        size=size,
        background=picture,
        mirror=mirror,
        look=look,
        avatar=avatar,
    )
    frames = _counted(shown_at, len(times), progress)
    if suffix == ".png":
        with whole_file(target) as temporary:
            for shown in frames:
                write_picture(temporary, shown)
        return
    sound, fs = (None, 0) if programme is None else programme_sound(programme, start_s, duration_s)
    captions = captions_of(programme, subtitles, track, start_s, duration_s)
    write_film(
        target, sound if fs else None, fs, bit_rate=_SOUND_BIT_RATE, pictures=frames,
        picture_rate=fps, crf=_CRF, captions=captions,
    )  # fmt: skip


def _counted(
    frames: Iterator[NDArray[np.uint8]], total: int, progress: Progress | None
) -> Iterator[NDArray[np.uint8]]:
    for done, frame in enumerate(frames, 1):
        yield frame
        if progress is not None:
            progress(done, total)
