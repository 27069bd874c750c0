"""The picture of a programme written again with another luma.

Chroma, sounds, subtitles and all times stay as they are; only luma passes through stages and is
encoded again, by default with the programme's own codec and bit rate. Pictures of a varying rate
get a constant one: a frame that is shown for long is written several times.
"""

import os
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any, Protocol

import av
import numpy as np
from av.sidedata.sidedata import Type as SideDataType
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.media.copying import Copies, check_held, copy_labels, damaged_frames, is_of_kind
from cuecast.media.output import open_output
from cuecast.media.svt_av1 import SVT_AV1, priorities_kept
from cuecast.media.x264 import repeatable_options
from receiver.media.picture import LONGEST_HOLD_S, Luma, PictureDecoder, PictureFormat, luma_of
from receiver.media.programme import Programme, open_programme, reason

_ENCODERS = {
    "h264": "libx264",
    "hevc": "libx265",
    "av1": SVT_AV1,
    "libdav1d": SVT_AV1,
    "vp9": "libvpx-vp9",
    "vp8": "libvpx",
}
"""Encoder of a codec where the names differ."""

_FALLBACK_BITS_PER_PIXEL = 0.12
"""Bits per pixel where the programme does not state its rate: that of good broadcasts in H.264."""

_CLOCK = Fraction(1, 90_000)  # fine enough for the picture's place among the sounds
_INTERLACED = 1 << 18 | 1 << 29  # AV_CODEC_FLAG_INTERLACED_DCT and _ME


class PictureStage(Protocol):
    """What changes luma: as many frames come out as went in, later."""

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame (height, width); give those that are finished."""

    def flush(self) -> list[Luma]:
        """Give the frames that were held back."""


def put_luma(frame: Any, luma: Luma) -> None:
    """Give a frame this luma; all else of it stays: chroma, fields and their order, captions."""
    frame.make_writable()  # the decoder may still predict from what it holds of the frame
    luma_of(frame)[:] = luma
    frame.pict_type = 0  # the encoder decides anew which frames stand alone


def keeps_picture(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> bool:
    """Whether `target` names a container of the source's kind that holds its picture as it is.

    Raises
    ------
    CueError
        If it names no container.
    """
    with open_programme(source) as programme, tempfile.TemporaryDirectory() as folder:
        try:
            output = av.open(f"file:{folder}/a{Path(target).suffix}", "w")
        except (av.FFmpegError, ValueError) as error:
            raise CueError(f"{target}: cannot write: {reason(error)}") from error
        with output:
            if not is_of_kind(output, programme.container.format.name):
                return False
            try:
                output.add_stream_from_template(programme.picture)
            except (av.FFmpegError, ValueError):
                return False
    return True


def rewrite_picture(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    make_stages: Callable[[PictureFormat], Sequence[PictureStage]],
    *,
    codec: str | None = None,
    bit_rate: int | None = None,
    gop: int | None = None,
    preset: str = "",
    size: tuple[int, int] | None = None,
    fps: Fraction | None = None,
    duration_s: float | None = None,
    progress: Callable[[float], None] = lambda seconds: None,
    tell: Callable[[str], None] = lambda line: None,
) -> PictureFormat:
    """Copy `source` to `target` with its luma passed through stages, one after the other.

    Parameters
    ----------
    source, target : path
        The suffix of `target` names the container.
    make_stages : callable
        Called once with the picture's format, whose bit rate is that of the output.
    codec, bit_rate : optional
        Picture codec and bits per second of the output; by default those of the programme.
    gop : int, optional
        Most frames between two that stand alone; by default one second's.
    preset : str
        Of the encoder, such as ``veryfast``; by default its own.
    size : tuple of int, optional
        Width and height of the output.
    fps : Fraction, optional
        Frames per second of the output: frames are repeated or left out.
    duration_s : float, optional
        Seconds of picture after which to stop.
    progress : callable
        Called with the seconds of picture of each frame.
    tell : callable
        Called with omitted parts of the programme.

    Returns
    -------
    PictureFormat
        Of the source, but with the bit rate that the encoder was given.

    Raises
    ------
    CueError
        If there is no picture, the programme is damaged as a whole, or the output cannot be
        written. No output is left behind then.
    """
    with open_programme(source) as programme:
        decoder = PictureDecoder(programme, fps=fps)
        form = decoder.format
        with open_output(target) as output:
            writer = _PictureWriter(programme, decoder, output, _encoder(form, codec))
            writer.be_like(_first_frame(source))
            rate = bit_rate or _measured_bit_rate(source, form)
            writer.configure(rate, gop, size or (form.width, form.height), preset)
            frames = None if duration_s is None else round(duration_s * form.fps)
            for line in writer.left_out:
                tell(line)
            form = replace(form, bit_rate=rate)
            writer.run(list(make_stages(form)), frames, progress)
            for line in damaged_frames("picture", decoder.damaged):
                tell(line)
    return form


class _PictureWriter:
    """The loop of `rewrite_picture`."""

    def __init__(
        self, programme: Programme, decoder: PictureDecoder, output: Any, encoder: str
    ) -> None:
        self._programme, self._decoder, self._output = programme, decoder, output
        self._form, self._picture = decoder.format, programme.picture
        self._copies = Copies(programme.container, output)
        for stream in programme.container.streams:
            if stream is self._picture:
                self._encoder = _added(output, encoder, self._form.fps, programme)
                copy_labels(stream, self._encoder)
            else:
                self._copies.add(stream)
        self._light = ""
        self._waiting: deque[Any] = deque()
        self._count = self._sent = 0
        self._times: dict[int, Fraction] = {}
        self._original: tuple[Any, Luma] | None = None

    @property
    def left_out(self) -> list[str]:
        """What of the programme the output does not get."""
        return self._copies.left_out

    def be_like(self, frame: Any) -> None:
        """Code fields as fields, and have the picture turned and lit, if this frame is.

        Encoders are opened by the first packet of anything, so this has to be known before. None
        states nothing.
        """
        if frame is None:
            return
        if frame.interlaced_frame:
            self._encoder.codec_context.flags |= _INTERLACED
        turn = frame.side_data.get(SideDataType.DISPLAYMATRIX)
        if turn is not None:
            self._encoder.set_display_matrix(np.frombuffer(bytes(turn), dtype=np.int32).tolist())
        self._light = light_of(frame)
        if self._light and self._encoder.codec.name != "libx265":
            self.left_out.append(f"light of the mastering display: {self._encoder.codec.name}")

    def configure(self, bit_rate: int, gop: int | None, size: tuple[int, int], preset: str) -> None:
        """Set the encoder's parameters; its rate is limited over one second, as on air."""
        form, context = self._form, self._encoder.codec_context
        self._encoder.width, self._encoder.height = size
        self._encoder.pix_fmt = form.pixel_format
        context.time_base = 1 / form.fps
        context.sample_aspect_ratio = self._picture.sample_aspect_ratio or Fraction(1)
        context.color_range = self._picture.codec_context.color_range
        context.colorspace = self._picture.codec_context.colorspace
        context.color_primaries = self._picture.codec_context.color_primaries
        context.color_trc = self._picture.codec_context.color_trc
        context.gop_size = gop or round(form.fps)
        context.bit_rate = bit_rate
        limits = {"maxrate": str(bit_rate), "bufsize": str(bit_rate)}
        # One frame at a time: coders that limit the rate of several at once write other bits with
        # every run.
        if self._encoder.codec.name == "libx264":
            context.thread_count = 1
            limits |= repeatable_options()
        if self._encoder.codec.name == SVT_AV1:
            limits = {"svtav1-params": "lp=1"}
        if self._encoder.codec.name == "libx265":
            if self._output.format.name in ("mp4", "mov", "ipod"):
                context.codec_tag = "hvc1"  # Apple's players refuse the other name, FFmpeg's own
            kilobits = bit_rate // 1000
            limits = {
                "x265-params": f"vbv-maxrate={kilobits}:vbv-bufsize={kilobits}:log-level=none:"
                f"pools=none:frame-threads=1{self._light}"
            }
        self._encoder.options = limits | ({"preset": preset} if preset else {})

    def run(
        self, stages: list[PictureStage], frames: int | None, progress: Callable[[float], None]
    ) -> None:
        """Copy, change, encode to the end or `frames`."""
        try:
            with priorities_kept():
                self._output.start_encoding()
        except (av.FFmpegError, ValueError) as error:
            chosen = self._encoder
            raise CueError(
                f"{chosen.codec.name} in {self._output.format.name} cannot be written with "
                f"{chosen.width}x{chosen.height} in {chosen.pix_fmt}, {float(self._form.fps):g} "
                f"frames/s: choose another with --video-codec ({reason(error)})"
            ) from error
        for packet in chain(self._programme.packets(), [None]):
            if packet is not None and packet.stream is not self._picture:
                self._copies.write(packet)
                continue
            for place, frame in self._decoder.process(packet):
                if frames is None or place < frames:
                    self._change(stages, place, frame)
                    progress(1 / float(self._form.fps))
            if frames is not None and self._count >= frames:
                break
        if self._count == 0:
            raise CueError(f"{self._programme.name}: its picture is empty")
        if self._programme.fault and frames is None:
            raise CueError(self._programme.fault)
        self._write(_rest(stages))
        self._mux(self._encoder.encode(None))

    def _change(self, stages: list[PictureStage], place: int, frame: Any) -> None:
        """Pass a frame through the stages and write their output."""
        self._times[place] = self._decoder.grid.source_time(place) - self._copies.shift_s
        self._count += 1
        self._waiting.append(frame)
        # A frame that is shown again may have been given its new luma by now.
        if self._original is None or self._original[0] is not frame:
            self._original = frame, luma_of(frame).copy()
        self._write(_through(stages, self._original[1].copy()))

    def _write(self, lumas: list[Luma]) -> None:
        for luma in lumas:
            frame = self._waiting.popleft()
            put_luma(frame, luma)
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


def _encoder(form: PictureFormat, codec: str | None) -> str:
    name = codec or form.codec
    name = _ENCODERS.get(name, name)
    try:
        av.Codec(name, "w")
    except (av.FFmpegError, ValueError) as error:
        raise CueError(f"picture codec {name!r}: cannot be written") from error
    return name


def _added(output: Any, encoder: str, fps: Fraction, programme: Programme) -> Any:
    try:
        codec = av.Codec(encoder, "w").canonical_name
        check_held(output, "video", codec, programme.container.format.name)
        return output.add_stream(encoder, rate=fps)
    except (CueError, av.FFmpegError, ValueError) as error:
        raise CueError(
            f"{output.format.name} cannot hold a picture in {encoder!r}: choose another codec with "
            f"--video-codec ({reason(error)})"
        ) from error


def light_of(frame: Any) -> str:
    """Return the light of the mastering display and of the content as options of x265, or nothing.

    Sources: CTA-861.3 and SMPTE ST 2086; FFmpeg hands them on as structures of ratios, primaries
    in the order red, green, blue.
    """
    options = ""
    words = _words(frame, SideDataType.MASTERING_DISPLAY_METADATA, 22)
    if len(words) and words[20] and words[21] and words[1:20:2].all():
        ratios = words[0:20:2] / words[1:20:2]
        (rx, ry, gx, gy, bx, by, wx, wy), (low, high) = ratios[:8], ratios[8:]
        places = [round(float(v) * 50_000) for v in (gx, gy, bx, by, rx, ry, wx, wy)]
        light = round(float(high) * 10_000), round(float(low) * 10_000)
        options = ":hdr10=1:master-display=G({},{})B({},{})R({},{})WP({},{})L({},{})".format(
            *places, *light
        )
    words = _words(frame, SideDataType.CONTENT_LIGHT_LEVEL, 2)
    return f"{options}:max-cll={words[0]},{words[1]}" if len(words) else options


def _words(frame: Any, kind: Any, least: int) -> NDArray[np.int32]:
    """Return FFmpeg's metadata of a frame as words, none where they do not suffice."""
    data = frame.side_data.get(kind)
    if data is None or len(bytes(data)) < 4 * least:
        return np.zeros(0, np.int32)
    return np.frombuffer(bytes(data)[: 4 * least], dtype=np.int32)


def _first_frame(path: str | os.PathLike[str]) -> Any:
    """Return the first frame of a file's picture, None if it cannot be decoded."""
    with open_programme(path) as programme:
        try:
            return next(iter(programme.container.decode(programme.picture)), None)
        except (av.FFmpegError, ValueError):
            return None


def _measured_bit_rate(path: str | os.PathLike[str], form: PictureFormat) -> int:
    """Bit rate of the file's picture, by its packets if the header does not state it.

    The time that they take counts, not their number: a packet may be a field, or be shown for long.
    """
    if form.bit_rate:
        return form.bit_rate
    total, length_s, before_s, last_s = 0, Fraction(0), None, 1 / form.fps
    with open_programme(path) as programme:
        for packet in programme.container.demux(programme.picture):
            total += packet.size
            if packet.dts is None or packet.time_base is None:
                continue
            time_s = packet.dts * packet.time_base
            if before_s is not None and 0 < time_s - before_s <= LONGEST_HOLD_S:
                last_s = time_s - before_s
                length_s += last_s
            before_s = time_s
    if total and length_s:
        return int(8 * total / (length_s + last_s))
    return int(_FALLBACK_BITS_PER_PIXEL * form.width * form.height * form.fps)
