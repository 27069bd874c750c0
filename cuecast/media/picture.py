"""The picture of a programme: reading its luma, and writing it again with another luma.

Chroma, sounds, subtitles and all times stay as they are; only luma passes through stages and is
encoded again, by default with the programme's own codec and bit rate.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.files import whole_file
from cuecast.media.programme import reason
from cuecast.media.rewrite import copy_labels, copy_tags

Luma = NDArray[Any]

_ENCODERS = {
    "h264": "libx264",
    "hevc": "libx265",
    "av1": "libsvtav1",
    "libdav1d": "libsvtav1",
    "vp9": "libvpx-vp9",
    "vp8": "libvpx",
}
"""Encoder of a codec where the names differ."""

_LUMA_DEPTH = {
    "yuv420p": 8, "yuvj420p": 8, "yuv422p": 8, "yuvj422p": 8, "yuv444p": 8, "yuvj444p": 8,
    "nv12": 8, "gray": 8, "yuv420p10le": 10, "yuv422p10le": 10, "yuv444p10le": 10,
    "gray10le": 10, "yuv420p12le": 12, "yuv422p12le": 12, "yuv444p12le": 12,
}  # fmt: skip
"""Bits of luma of the pixel formats whose first plane is luma; others are converted."""

_CONVERTED = "yuv420p"
_FALLBACK_BITS_PER_PIXEL = 0.12
_CLOCK = Fraction(1, 90_000)  # fine enough for the picture's place among the sounds
_INTERLACED = 1 << 18 | 1 << 29  # AV_CODEC_FLAG_INTERLACED_DCT and _ME


@dataclass(frozen=True, slots=True)
class PictureFormat:
    """What the picture of a programme is.

    Attributes
    ----------
    codec : str
        FFmpeg's name of the codec.
    width, height : int
        Pixels.
    fps : Fraction
        Frames per second.
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


class PictureStage(Protocol):
    """What changes luma: as many frames come out as went in, later."""

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame (height, width); give those that are finished."""

    def flush(self) -> list[Luma]:
        """Give the frames that were held back."""


def picture_format(path: str | os.PathLike[str]) -> PictureFormat:
    """Format of the picture in a file.

    Raises
    ------
    CueError
        If there is no picture.
    """
    with _open(path) as container:
        return _format(container, path)


def read_lumas(path: str | os.PathLike[str]) -> Iterator[tuple[float, Luma]]:
    """Yield the time in seconds after the first frame and the luma of every frame of a file.

    Damaged frames are left out, as a television would.

    Raises
    ------
    CueError
        If there is no picture.
    """
    with _open(path) as container:
        pixel_format = _format(container, path).pixel_format
        first: float | None = None
        for frame in _frames(container):
            time_s = float(frame.pts * frame.time_base)
            first = time_s if first is None else first
            yield time_s - first, luma_of(_converted(frame, pixel_format)).copy()


def luma_of(frame: Any) -> Luma:
    """Luma of a frame as a view, shape (height, width), uint8 or uint16."""
    plane = frame.planes[0]
    kind = np.dtype(np.uint8 if _LUMA_DEPTH[frame.format.name] == 8 else np.uint16)
    rows = np.frombuffer(memoryview(plane), kind).reshape(-1, plane.line_size // kind.itemsize)
    return rows[: frame.height, : frame.width]


def with_luma(frame: Any, luma: Luma) -> Any:
    """Return a new frame with this luma and everything else of `frame`."""
    # A decoder may still predict from its frame, so that one is never written to.
    copy = av.VideoFrame(frame.width, frame.height, frame.format.name)
    for source, target in zip(frame.planes, copy.planes, strict=True):
        lines = min(source.height, target.height)
        pitch = min(source.line_size, target.line_size)
        given = np.frombuffer(memoryview(source), np.uint8).reshape(-1, source.line_size)
        taken = np.frombuffer(memoryview(target), np.uint8).reshape(-1, target.line_size)
        taken[:lines, :pitch] = given[:lines, :pitch]
    luma_of(copy)[:] = luma
    copy.colorspace, copy.color_range = frame.colorspace, frame.color_range
    return copy


def rewrite_picture(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    make_stages: Callable[[PictureFormat], Sequence[PictureStage]],
    *,
    codec: str | None = None,
    bit_rate: int | None = None,
    gop: int | None = None,
    size: tuple[int, int] | None = None,
    duration_s: float | None = None,
    progress: Callable[[float], None] = lambda seconds: None,
) -> PictureFormat:
    """Copy `source` to `target` with its luma passed through stages, one after the other.

    Parameters
    ----------
    source, target : path
        The suffix of `target` names the container.
    make_stages : callable
        Called once with the picture's format.
    codec, bit_rate : optional
        Picture codec and bits per second of the output; by default those of the programme.
    gop : int, optional
        Most frames between two that stand alone; by default one second's.
    size : tuple of int, optional
        Width and height of the output.
    duration_s : float, optional
        Seconds of picture after which to stop.
    progress : callable
        Told how many seconds of picture each frame brought.

    Returns
    -------
    PictureFormat
        Of the source.

    Raises
    ------
    CueError
        If there is no picture, its frames do not come at a constant rate, or the output cannot be
        written. No output is left behind then.
    """
    with _open(source) as container, whole_file(target) as temporary:
        form = _format(container, source)
        try:
            with av.open(f"file:{temporary}", "w") as output:
                writer = _Writer(container, output, form, _encoder(form, codec))
                rate = bit_rate or _measured_bit_rate(source, form)
                writer.configure(rate, gop, size or (form.width, form.height))
                frames = None if duration_s is None else round(duration_s * form.fps)
                writer.run(list(make_stages(form)), source, frames, progress)
        except (av.FFmpegError, ValueError) as error:
            raise CueError(f"{target}: cannot write: {reason(error)}") from error
    return form


class _Writer:
    """The loop of `rewrite_picture`."""

    def __init__(self, container: Any, output: Any, form: PictureFormat, encoder: str) -> None:
        self._container, self._output, self._form = container, output, form
        self._picture = container.streams.video[0]
        self._copies: dict[int, Any] = {}
        for stream in container.streams:
            if stream is self._picture:
                self._encoder = output.add_stream(encoder, rate=form.fps)
                self._copies[stream.index] = self._encoder
            elif stream.type in ("audio", "subtitle"):
                self._copies[stream.index] = output.add_stream_from_template(stream)
            else:
                continue
            copy_labels(stream, self._copies[stream.index])
        copy_tags(container.metadata, output.metadata)
        self._start_s = Fraction(container.start_time or 0, av.time_base)
        self._waiting: deque[Any] = deque()
        self._count = self._sent = 0
        self._first_pts = 0
        self._times: dict[int, Fraction] = {}

    def configure(self, bit_rate: int, gop: int | None, size: tuple[int, int]) -> None:
        """Set the encoder's parameters; its rate is limited over one second, as on air."""
        form, context = self._form, self._encoder.codec_context
        self._encoder.width, self._encoder.height = size
        self._encoder.pix_fmt = form.pixel_format
        context.time_base = 1 / form.fps
        context.sample_aspect_ratio = self._picture.sample_aspect_ratio or Fraction(1)
        context.color_range = self._picture.codec_context.color_range
        context.colorspace = self._picture.codec_context.colorspace
        context.gop_size = gop or round(form.fps)
        context.bit_rate = bit_rate
        limits = {"maxrate": str(bit_rate), "bufsize": str(bit_rate)}
        if self._encoder.codec.name == "libsvtav1":
            limits = {}
        if self._encoder.codec.name == "libx265":
            kilobits = bit_rate // 1000
            limits = {
                "x265-params": f"vbv-maxrate={kilobits}:vbv-bufsize={kilobits}:log-level=none"
            }
        self._encoder.options = limits

    def run(
        self,
        stages: list[PictureStage],
        name: str | os.PathLike[str],
        frames: int | None,
        progress: Callable[[float], None],
    ) -> None:
        """Copy, change, encode to the end or `frames`."""
        for packet in self._container.demux(list(self._container.streams)):
            if packet.stream is not self._picture:
                self._copy(packet)
                continue
            if frames is not None and self._count >= frames:
                break
            for frame in _decoded(packet):
                self._check_rate(frame, name)
                self._waiting.append(_converted(frame, self._form.pixel_format))
                self._write(_through(stages, luma_of(self._waiting[-1]).copy()))
                progress(1 / float(self._form.fps))
        if self._count == 0:
            raise CueError(f"{name}: its picture is empty")
        self._write(_rest(stages))
        self._mux(self._encoder.encode(None))

    def _check_rate(self, frame: Any, name: str | os.PathLike[str]) -> None:
        """Refuse pictures whose times the carriers would misread."""
        if self._count == 0:
            self._first_pts = frame.pts
            if frame.interlaced_frame:
                self._encoder.codec_context.flags |= _INTERLACED
        place = (frame.pts - self._first_pts) * frame.time_base * self._form.fps
        if abs(place - self._count) > 1:
            raise CueError(
                f"{name}: frame {self._count} comes at {float(place / self._form.fps):.3f} s: the "
                f"picture's rate is not a constant {float(self._form.fps):g} per second"
            )
        self._times[self._count] = frame.pts * frame.time_base - self._start_s
        self._count += 1

    def _write(self, lumas: list[Luma]) -> None:
        for luma in lumas:
            frame = with_luma(self._waiting.popleft(), luma)
            if (frame.width, frame.height) != (self._encoder.width, self._encoder.height):
                frame = frame.reformat(
                    self._encoder.width, self._encoder.height, interpolation="BICUBIC"
                )
            frame.pts, frame.time_base = self._sent, 1 / self._form.fps
            self._sent += 1
            self._mux(self._encoder.encode(frame))

    def _mux(self, packets: list[Any]) -> None:
        """Give packets, which count frames, the times that the frames had in the source."""
        for packet in packets:
            place, order = (
                round(t * packet.time_base * self._form.fps) for t in (packet.pts, packet.dts)
            )
            pts, dts = (round(self._time_s(n) / _CLOCK) for n in (place, order))
            packet.time_base = _CLOCK
            packet.pts, packet.dts = pts, dts
            self._output.mux(packet)
            for known in [n for n in self._times if 0 < n < order]:
                del self._times[known]

    def _time_s(self, n: int) -> Fraction:
        """Time of frame n; before the first one, where decoding starts, by the frame rate."""
        return self._times[n] if n >= 0 else self._times[0] + n / self._form.fps

    def _copy(self, packet: Any) -> None:
        if packet.stream.index not in self._copies or packet.dts is None:
            return
        shift = round(self._start_s / packet.time_base)
        packet.stream = self._copies[packet.stream.index]
        packet.dts -= shift
        packet.pts -= shift
        self._output.mux(packet)


def _through(stages: list[PictureStage], luma: Luma) -> list[Luma]:
    lumas = [luma]
    for stage in stages:
        lumas = [out for each in lumas for out in stage.process(each)]
    return lumas


def _rest(stages: list[PictureStage]) -> list[Luma]:
    """Flush stage after stage, each into those behind it."""
    lumas: list[Luma] = []
    for stage in stages:
        lumas = [out for each in lumas for out in stage.process(each)] + stage.flush()
    return lumas


def _open(path: str | os.PathLike[str]) -> Any:
    try:
        return av.open(f"file:{os.fspath(path)}", "r", metadata_errors="ignore")
    except (av.FFmpegError, ValueError, OSError) as error:
        raise CueError(f"{path}: not a video file: {reason(error)}") from error


def _format(container: Any, path: str | os.PathLike[str]) -> PictureFormat:
    if not container.streams.video:
        raise CueError(f"{path}: no picture in it")
    stream = container.streams.video[0]
    context = stream.codec_context
    rate = stream.average_rate or stream.guessed_rate
    if context is None or not rate or not context.width or not context.height:
        raise CueError(f"{path}: a picture in an unknown codec, size or rate")
    pixel_format = context.pix_fmt if context.pix_fmt in _LUMA_DEPTH else _CONVERTED
    return PictureFormat(
        context.name,
        context.width,
        context.height,
        Fraction(rate),
        pixel_format,
        _LUMA_DEPTH[pixel_format],
        int(context.bit_rate or 0),
    )


def _frames(container: Any) -> Iterator[Any]:
    for packet in container.demux(container.streams.video[0]):
        yield from _decoded(packet)


def _decoded(packet: Any) -> list[Any]:
    try:
        return [frame for frame in packet.decode() if frame.pts is not None]
    except av.FFmpegError:
        return []


def _converted(frame: Any, pixel_format: str) -> Any:
    if frame.format.name == pixel_format:
        return frame
    converted = frame.reformat(format=pixel_format)
    converted.pts, converted.time_base = frame.pts, frame.time_base
    return converted


def _encoder(form: PictureFormat, codec: str | None) -> str:
    name = codec or form.codec
    name = _ENCODERS.get(name, name)
    try:
        av.Codec(name, "w")
    except (av.FFmpegError, ValueError) as error:
        raise CueError(f"picture codec {name!r}: cannot be written") from error
    return name


def _measured_bit_rate(path: str | os.PathLike[str], form: PictureFormat) -> int:
    """Bit rate of the file's picture, by its packets if the header does not tell."""
    if form.bit_rate:
        return form.bit_rate
    with _open(path) as container:
        sizes = [packet.size for packet in container.demux(container.streams.video[0])]
    if sizes:
        return int(8 * sum(sizes) * form.fps / len(sizes))
    return int(_FALLBACK_BITS_PER_PIXEL * form.width * form.height * form.fps)
