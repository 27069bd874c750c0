"""Parts copied unchanged into a written programme: streams, tags, chapters."""

from fractions import Fraction
from typing import Any

import av
from av.stream import Disposition

from codec.errors import CueError
from receiver.media.programme import reason

_FILE_TAGS = {
    "major_brand", "minor_version", "compatible_brands", "encoder", "duration", "handler_name",
    "vendor_id", "creation_time",
}  # fmt: skip
"""Tags that describe the old file, not the programme; the new file has its own."""


_OF_DISCS = {
    "video": "mpeg1video mpeg2video",
    "audio": "mp2 mp3 ac3 dts pcm_dvd",
    "subtitle": "dvd_subtitle",
}
_HELD = {
    "mpegts": {
        "video": "mpeg1video mpeg2video mpeg4 h264 hevc",
        "audio": "mp2 mp3 aac aac_latm ac3 eac3 dts truehd opus s302m",
        "subtitle": "dvb_subtitle dvb_teletext hdmv_pgs_subtitle ttml arib_caption",
    },
    **dict.fromkeys(("mpeg", "vob", "dvd", "svcd", "vcd"), _OF_DISCS),
}
"""Codecs that MPEG's containers hold, by FFmpeg's names. FFmpeg writes any other there as bytes
without a name, or under a wrong one."""


_KINDS = {
    **dict.fromkeys(("vob", "dvd", "svcd", "vcd"), "mpeg"),
    **dict.fromkeys(("ogv", "oga", "opus"), "ogg"),
    **dict.fromkeys(("ipod", "psp", "f4v", "3gp", "3g2"), "mp4"),
}
"""Containers that FFmpeg writes by a name of their own, and the name that it reads them by."""


_WRITTEN_ANEW = {"mov", "mp4", "ipod", "matroska"}
"""Containers that get chapters, and a time code by the picture's tag, from FFmpeg anew."""


_KEPT_NAMES = {"hvc1", "apco", "apcs", "apcn", "apch", "ap4h", "ap4x"}
"""Names of codecs in QuickTime and MP4 that FFmpeg replaces by others unless it is told: the one of
HEVC that Apple's players know, and the kinds of ProRes."""

_BROADCAST_WAVE = {
    "description": "comment",
    "originator": "encoded_by",
    "origination_date": "date",
    "origination_time": "creation_time",
}
"""Fields of a broadcast wave (EBU Tech 3285), and the names under which FFmpeg reads them."""


def wave_options(source: Any) -> dict[str, str]:
    """Options with which FFmpeg writes the chunk of a broadcast wave, if the source is one."""
    return {"write_bext": "1"} if "time_reference" in source.metadata else {}


def is_of_kind(output: Any, source: str) -> bool:
    """Whether an output is a container of the kind whose names, apart by commas, are `source`."""
    return _KINDS.get(output.format.name, output.format.name) in source.split(",")


def check_held(output: Any, stream_type: str, codec: str, source: str) -> None:
    """Raise CueError where FFmpeg writes a codec into a container that does not hold it.

    Nothing is refused that comes from a container of the same kind, whose names are `source`.
    """
    name = output.format.name
    if is_of_kind(output, source):
        return
    if codec not in _HELD.get(name, {}).get(stream_type, codec).split():
        raise CueError(f"{name} cannot hold {codec}")


def damaged_frames(kind: str, count: int) -> list[str]:
    """Return the line that tells of damaged frames of a sound or a picture, if there are any.

    Examples
    --------
    >>> damaged_frames("sound", 2), damaged_frames("sound", 0)
    (['2 damaged frames of the sound'], [])
    """
    return [f"{count} damaged frame{'s' * (count > 1)} of the {kind}"] if count else []


class Copies:
    """The streams of an output that are copied packet by packet.

    Parameters
    ----------
    source, target : av container
        Input and output. Tags and chapters are taken over at once.

    Attributes
    ----------
    left_out : list of str
        Streams that the output cannot hold, and why.
    """

    def __init__(self, source: Any, target: Any) -> None:
        self._target, self._source = target, source.format.name
        self._copies: dict[int, Any] = {}
        self._written: dict[int, int] = {}
        self.left_out: list[str] = []
        copy_tags(source.metadata, target.metadata)
        if target.format.name == "wav" and wave_options(source):
            for field, name in _BROADCAST_WAVE.items():
                target.metadata[field] = source.metadata.get(name, "")
        if source.chapters():
            target.set_chapters(source.chapters())
        # Like other remuxers: the new container starts at zero; differences stay exact.
        self.shift_s = Fraction(source.start_time or 0, av.time_base)

    def add(self, stream: Any) -> None:
        """Give the output a stream like this one, if it can hold it."""
        try:
            if stream.type == "attachment":
                self._target.add_attachment(stream.name, stream.mimetype, stream.data)
                return
            same = is_of_kind(self._target, self._source)
            if stream.type == "data" and not (same and self._target.format.name == "mpegts"):
                self._leave_data(stream)
                return
            if stream.disposition & Disposition.attached_pic and self._target.format.name == "mov":
                raise CueError("mov cannot hold a cover")  # FFmpeg passes over it without a word
            context = stream.codec_context
            if context is not None:
                codec = context.codec.canonical_name
                check_held(self._target, stream.type, codec, self._source)
            # By itself PyAV copies pictures only in codecs that FFmpeg can also write.
            opaque = None if _has_encoder(stream) else True
            copy = self._target.add_stream_from_template(stream, opaque=opaque)
            if same and context is not None and context.codec_tag in _KEPT_NAMES:
                copy.codec_context.codec_tag = context.codec_tag
            if stream.type == "video" and stream.average_rate:  # a time code counts by it
                copy.codec_context.framerate = stream.average_rate
        except (CueError, av.FFmpegError, ValueError, TypeError) as error:
            self.left_out.append(f"stream {stream.index} ({stream.type}): {reason(error)}")
            return
        self._copies[stream.index] = copy
        copy_labels(stream, copy)

    def _leave_data(self, stream: Any) -> None:
        """Pass over data that FFmpeg cannot copy, and tell of it unless FFmpeg writes it anew."""
        timed = "timecode" in stream.metadata
        anew = timed or (stream.name == "bin_data" and self._target.chapters())
        if not (anew and self._target.format.name in _WRITTEN_ANEW):
            name = "time code" if timed else stream.name or "unknown"
            self.left_out.append(f"stream {stream.index} (data): {name}")

    def write(self, packet: Any) -> None:
        """Write a packet of a stream that is copied; others are passed over."""
        copy = self._copies.get(packet.stream.index)
        if copy is None:
            return
        if packet.pts is None and packet.dts is None:  # of a stream's end, or a cover
            if packet.size and Disposition.attached_pic in packet.stream.disposition:
                packet.stream, packet.pts, packet.dts = copy, 0, 0
                self._target.mux(packet)
            return
        shift = round(self.shift_s / packet.time_base)
        packet.stream = copy
        if packet.pts is not None:
            packet.pts -= shift
        if packet.dts is not None:
            packet.dts -= shift
            if not self._in_order(packet):
                return
        self._target.mux(packet)

    def _in_order(self, packet: Any) -> bool:
        """Move a packet behind that before it, where streams overlap at a joint; not sound."""
        before = self._written.get(packet.stream.index)
        steady = packet.stream.type in ("audio", "video")  # texts may begin together
        if before is not None and packet.dts < before + steady:
            if packet.stream.type == "audio":
                return False
            packet.dts = before + 1
            packet.pts = None if packet.pts is None else max(packet.pts, packet.dts)
        self._written[packet.stream.index] = packet.dts
        return True


def _has_encoder(stream: Any) -> bool:
    """Whether FFmpeg can write the codec of a stream, and not only copy it."""
    try:
        return bool(av.Codec(stream.codec_context.name, "w"))
    except (AttributeError, av.FFmpegError, ValueError):
        return False


def copy_labels(source: Any, target: Any) -> None:
    """Carry over language, title and role of a stream."""
    copy_tags(source.metadata, target.metadata)
    target.disposition = source.disposition


def copy_tags(source: dict[str, str], target: dict[str, str]) -> None:
    """Carry over the tags that describe the programme, not the old file."""
    for key, value in source.items():
        if key.lower() not in _FILE_TAGS:
            target[key] = value
