"""Packets of a programme's picture become luma at a constant rate.

The carriers count frames. So every frame takes the place of its time on a grid of one rate: what
came late or not at all is shown by the frame before it, as on a screen, and of several frames in
one place the first counts. A steady source passes unchanged.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from receiver.media.programme import Programme, open_programme

Luma = NDArray[Any]

LUMA_DEPTH = {
    "yuv420p": 8, "yuvj420p": 8, "yuv422p": 8, "yuvj422p": 8, "yuv444p": 8, "yuvj444p": 8,
    "nv12": 8, "gray": 8, "yuv420p10le": 10, "yuv422p10le": 10, "yuv444p10le": 10,
    "gray10le": 10, "yuv420p12le": 12, "yuv422p12le": 12, "yuv444p12le": 12,
}  # fmt: skip
"""Bits of luma of the pixel formats whose first plane is luma; others are converted."""

_CONVERTED = "yuv420p"

USUAL_RATES = tuple(
    Fraction(rate)
    for n in (24, 25, 30, 48, 50, 60, 100, 120)
    for rate in ((n,) if n % 25 == 0 else (Fraction(1000 * n, 1001), n))
)
"""Frames per second of constant sources."""

_UNKNOWN_RATE = Fraction(50)
"""Where headers state the unit of time rather than a rate."""

LONGEST_HOLD_S = 10.0
"""A greater step of the times is a new start of the container's clock, not a still picture."""


_LIMITED = {"mpeg1video", "mpeg2video"}
"""Pictures whose headers state a limit where the rate varies (ISO 13818-2, 6.3.3)."""


@dataclass(frozen=True, slots=True)
class PictureFormat:
    """Format of a programme's picture.

    Attributes
    ----------
    codec : str
        FFmpeg's name of the codec.
    width, height : int
        Pixels.
    fps : Fraction
        Frames per second of the grid.
    pixel_format : str
        FFmpeg's name, after conversion where the file's own has no luma plane.
    depth : int
        Bits of luma.
    bit_rate : int
        Bits per second, 0 where unknown.
    """

    codec: str
    width: int
    height: int
    fps: Fraction
    pixel_format: str
    depth: int
    bit_rate: int


def format_of(programme: Programme) -> PictureFormat:
    """Format of a programme's picture.

    Raises
    ------
    CueError
        If there is no picture, or its headers do not state its format.
    """
    if programme.picture is None:
        raise CueError(f"{programme.name}: no picture in it")
    return stream_format(programme.picture, programme.name)


def stream_format(stream: Any, name: str) -> PictureFormat:
    """Format of a picture's stream in a container called `name`.

    Raises
    ------
    CueError
        If its headers do not state its format.
    """
    context = stream.codec_context
    fps = steady_rate(stream.average_rate, stream.guessed_rate)
    if context is None or fps is None or not context.width or not context.height:
        raise CueError(f"{name}: a picture in an unknown codec, size or rate")
    pixel_format = context.pix_fmt if context.pix_fmt in LUMA_DEPTH else _CONVERTED
    return PictureFormat(
        context.name,
        context.width,
        context.height,
        fps,
        pixel_format,
        LUMA_DEPTH[pixel_format],
        0 if context.name in _LIMITED else int(context.bit_rate or 0),
    )


def steady_rate(average: Fraction | None, guessed: Fraction | None) -> Fraction | None:
    """Rate of the grid for a source with these mean and least common rates.

    A mean near a usual rate is that of a constant source. Otherwise the times vary: the grid is
    that of the fastest stretches. A short file's mean is not exact.

    Examples
    --------
    >>> steady_rate(Fraction(24990, 1000), None)
    Fraction(25, 1)
    >>> steady_rate(Fraction(8), Fraction(30))
    Fraction(30, 1)
    """
    rate = average or guessed
    if not rate:
        return None
    fastest = Fraction(guessed or rate)
    for known in (fastest, Fraction(rate)):
        near = min(USUAL_RATES, key=lambda usual: abs(usual - known))
        if abs(near - known) <= known / 1200 and abs(near - rate) <= rate / 50:
            return near
    if rate <= fastest <= USUAL_RATES[-1]:
        return fastest
    return min((usual for usual in USUAL_RATES if usual >= rate), default=_UNKNOWN_RATE)


def luma_of(frame: Any) -> Luma:
    """Luma of a frame as a view, shape (height, width), uint8 or uint16."""
    plane = frame.planes[0]
    kind = np.dtype(np.uint8 if LUMA_DEPTH[frame.format.name] == 8 else np.uint16)
    rows = np.frombuffer(memoryview(plane), kind).reshape(-1, plane.line_size // kind.itemsize)
    return rows[: frame.height, : frame.width]


class SteadyGrid:
    """Frames with times in, frames on the places of a grid out.

    Parameters
    ----------
    fps : Fraction
        Places per second.

    Attributes
    ----------
    repeated, dropped : int
        Places that a frame before had to fill, and frames without a place of their own.
    """

    def __init__(self, fps: Fraction) -> None:
        self._fps = fps
        self.repeated = self.dropped = 0
        self.restart()

    def restart(self) -> None:
        """Forget the frames before a jump: the next frame has place 0."""
        self._held: Any = None
        self._next = self._offset = 0
        self._first = Fraction(0)

    def put(self, frame: Any, time: Fraction) -> Iterator[tuple[int, Any]]:
        """Take a frame due at `time` seconds; yield the places up to its own, and what they show.

        After a hole the frame before it stands for several places. After a jump of the times by
        more than `LONGEST_HOLD_S` the grid goes on as if there had been none.
        """
        if self._held is None:
            self._first = time
        due = round((time - self._first) * self._fps) + self._offset
        if abs(due - self._next) > LONGEST_HOLD_S * self._fps:
            self._offset += self._next - due
            due = self._next
        if due < self._next:
            self.dropped += 1
            return
        while self._next < due:
            self.repeated += 1
            self._next += 1
            yield self._next - 1, self._held
        self._held = frame
        self._next += 1
        yield due, frame

    def source_time(self, place: int) -> Fraction:
        """Time in seconds, as the source counts, of the place that was given last."""
        return self._first + (place - self._offset) / self._fps

    def steady_time(self, place: int) -> Fraction:
        """Time in seconds of a place, as if the source's clock had never jumped."""
        return self._first + place / self._fps


class PictureDecoder:
    """Decoder of a programme's picture, on its grid.

    Parameters
    ----------
    programme : Programme
        Its `picture` is decoded.
    fps : Fraction, optional
        Rate of the grid, if not the programme's own.

    Attributes
    ----------
    format : PictureFormat
        Of the frames that come out; those of another size are scaled to it.
    grid : SteadyGrid
    damaged : int
        Packets that could not be decoded.

    Raises
    ------
    CueError
        If there is no picture, or its headers do not state its format.
    """

    def __init__(self, programme: Programme, *, fps: Fraction | None = None) -> None:
        self._programme = programme
        self.format = format_of(programme)
        if fps is not None:
            self.format = replace(self.format, fps=fps)
        self.grid = SteadyGrid(self.format.fps)
        self.damaged = 0

    def process(self, packet: Any) -> Iterator[tuple[int, Any]]:
        """Decode one packet (None: the rest in the decoder).

        Yields
        ------
        int
            Place on the grid, counted from the first frame.
        av.VideoFrame
            Of the announced size and pixel format.
        """
        try:
            frames = self._programme.picture.decode(packet)
        except (av.FFmpegError, ValueError):
            self.damaged += 1
            frames = []
        for frame in frames:
            if frame.pts is not None:
                unit = frame.time_base or self._programme.picture.time_base
                try:
                    shown = converted(frame, self.format)
                except (av.FFmpegError, ValueError):  # damage made it one that nothing can scale
                    self.damaged += 1
                    continue
                yield from self.grid.put(shown, frame.pts * unit)

    def time_s(self, place: int) -> float:
        """Time of a place of the grid on the programme's clock."""
        return float(self.grid.steady_time(place)) - self._programme.origin_s

    def restart(self) -> None:
        """Forget the frames before a jump: decoding goes on at a packet that needs no other."""
        self._programme.picture.codec_context.flush_buffers()
        self.grid.restart()


def converted(frame: Any, form: PictureFormat) -> Any:
    """Return a frame in this size and pixel format."""
    if (frame.format.name, frame.width, frame.height) == (
        form.pixel_format,
        form.width,
        form.height,
    ):
        return frame
    return frame.reformat(form.width, form.height, format=form.pixel_format)


def picture_format(path: str | os.PathLike[str]) -> PictureFormat:
    """Format of the picture in a file.

    Raises
    ------
    CueError
        If there is no picture.
    """
    with open_programme(path) as programme:
        return format_of(programme)


def read_lumas(path: str | os.PathLike[str]) -> Iterator[tuple[float, Luma]]:
    """Yield the time in seconds after the first frame and the luma of every place of the grid.

    Raises
    ------
    CueError
        If there is no picture.
    """
    with open_programme(path) as programme:
        decoder = PictureDecoder(programme)
        packets = (p for p in programme.packets() if p.stream is programme.picture)
        for packet in chain(packets, [None]):
            for place, frame in decoder.process(packet):
                yield place / float(decoder.format.fps), luma_of(frame).copy()
