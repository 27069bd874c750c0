"""A programme opened for reading: its sound, its picture, its clock.

The programme's clock counts seconds from the first picture, or from the first sample where there
is no picture. All other times of a container are differences to it.
"""

import math
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import av
import av.logging
from av.container import InputContainer
from av.stream import Disposition

from codec.errors import CueError
from receiver.media.joints import FORMATS, Joints

_EXACT_DURATION = {"mov", "mp4", "matroska", "flac", "wav", "aiff"}
"""Containers whose headers state the length exactly; others estimate it."""

_TOLERATED_SHORTFALL_S = 1.0
"""Last packets without a duration make the end uncertain by a picture or two."""

_SILENT_S = 1.0
"""A stream that sends nothing while another of its kind sends for so long has ended: no packet
waits longer than a second in a decoder (ISO/IEC 13818-1, 2.4.2.6)."""

_MOST_HELD = 4096
"""Packets of a possible successor that are kept: a second of any sound or picture has fewer."""

_USUAL_LAYOUTS = {
    f"{n} channels": name
    for n, name in enumerate(("mono", "stereo", "2.1", "4.0", "5.0", "5.1"), start=1)
}
"""FFmpeg's own arrangement of as many channels, by its name where a container states none (MXF)."""

LENIENT: dict[str, Any] = (
    {"metadata_errors": "ignore"} if int(av.__version__.partition(".")[0]) < 19 else {}
)
"""Titles in no known alphabet are no reason to refuse a programme: PyAV 18 needs the option."""

# Our errors are one line; FFmpeg would print its own. At any level a thread of a decoder that has
# something to say waits for Python, which may be waiting for that thread: a deadlock.
av.logging.set_level(None)


@dataclass(frozen=True, slots=True)
class SoundFormat:
    """Format of a programme's sound, which has to stay.

    Attributes
    ----------
    codec : str
        FFmpeg's name of the codec, such as ``aac``, ``mp2``, ``flac``, ``pcm_s16le``.
    fs : int
        Samples per second of one channel.
    channels : int
        Number of channels.
    layout : str
        FFmpeg's name of the arrangement of channels, such as ``stereo``.
    sample_format : str
        FFmpeg's name of the type of one sample.
    bit_rate : int
        Bits per second of all channels, 0 where unknown.
    """

    codec: str
    fs: int
    channels: int
    layout: str
    sample_format: str
    bit_rate: int


class Programme:
    """A container opened for reading, by `open_programme`.

    Parameters
    ----------
    container : av.container.InputContainer
        The open container.
    name : str
        What error messages call it.
    track : int
        Which of its sounds is meant, from 0.
    cut_short : bool
        Whether the file is known to hold less than its headers state.
    path : Path, optional
        Of the file, if it is one.

    Attributes
    ----------
    sound, picture : av.stream.Stream or None
        The sound that is meant, and the picture.

    Raises
    ------
    CueError
        If there is no such sound, or neither sound nor picture.
    """

    def __init__(
        self,
        container: InputContainer,
        name: str,
        track: int = 0,
        *,
        cut_short: bool = False,
        path: Path | None = None,
    ) -> None:
        self.container = container
        self.name = name
        self._path, self._track = path, track
        self._base = self._at = (
            0  # bytes of the file before what is read, and before its last packet
        )
        self._later = ExitStack()
        self._end_s = 0.0
        self._cut_short = cut_short
        self._joints = Joints()
        sounds = container.streams.audio
        self.picture: Any = next(
            (s for s in container.streams.video if not _is_attached_picture(s)), None
        )
        if not sounds and self.picture is None:
            raise CueError(f"{name}: no sound in it and no picture")
        if sounds and not 0 <= track < len(sounds):
            raise CueError(f"{name}: no sound track {track}, it has {len(sounds)}")
        self.sound: Any = sounds[track] if sounds else None
        self._first: Any = self.picture if self.picture is not None else self.sound

    @property
    def format(self) -> SoundFormat:
        """Parameters of the sound.

        Raises
        ------
        CueError
            If there is no sound, or the container does not state them.
        """
        if self.sound is None:
            raise CueError(f"{self.name}: no sound in it")
        context = self.sound.codec_context
        if context is None:
            raise CueError(f"{self.name}: sound in an unknown codec")
        fs, channels = context.sample_rate, context.layout.nb_channels
        if fs <= 0 or channels <= 0 or context.format is None:
            raise CueError(f"{self.name}: sound of {fs} Hz and {channels} channels")
        return SoundFormat(
            context.name,
            fs,
            channels,
            _USUAL_LAYOUTS.get(context.layout.name, context.layout.name),
            context.format.name,
            int(context.bit_rate or 0),
        )

    @property
    def duration_s(self) -> float | None:
        """Length of the programme by its headers, in seconds."""
        sound = self.sound
        if sound is not None and sound.duration is not None and sound.time_base is not None:
            return float(sound.duration * sound.time_base)
        if self.container.duration is not None:
            return self.container.duration / 1e6
        return None

    @property
    def origin_s(self) -> float:
        """Time of the programme's clock's zero in the container's own times, seconds."""
        stream = self._first
        if stream.start_time is None or stream.time_base is None:
            return 0.0
        return float(stream.start_time * stream.time_base)

    @property
    def player_s(self) -> float:
        """Time of the programme's clock's zero on the clock of a player, seconds.

        A player counts from the container's start, which may be that of a sound that begins
        before the picture.
        """
        start = self.container.start_time
        return 0.0 if start is None else self.origin_s - start / av.time_base

    def seek(self, start_s: float) -> None:
        """Go on reading at or before `start_s` on the programme's clock."""
        if start_s > 0:
            self.container.seek(int((self.origin_s + start_s) * av.time_base), backward=True)

    @property
    def sounds(self) -> int:
        """Number of the programme's sounds."""
        return len(self.container.streams.audio)

    def packets(self, *, follow: bool = False) -> Iterator[Any]:
        """Yield the packets of all streams as they stand in the container.

        Where the clock of a recording jumps, their time stamps go on.

        Parameters
        ----------
        follow : bool
            Go on where a recording has its streams at other addresses from a place on: `sound`
            and `picture` are others then. Otherwise the programme ends there.

        Raises
        ------
        CueError
            If the container is damaged.
        """
        reading = self.container
        while True:
            begin = self._at
            read = self._read(reading)
            try:
                yield from self._followed(read) if follow and self._is_broadcast else read
            except av.FFmpegError as error:
                raise CueError(f"{self.name}: damaged: {reason(error)}") from error
            except IndexError:  # streams that came later, which the library cannot end
                if follow and self._path is not None and self._at > begin:
                    later = self._reopened(self._path, reading)
                    if later is not None:
                        reading = later
                        continue
            return

    @property
    def _is_broadcast(self) -> bool:
        return self.container.format.name == "mpegts"

    def _read(self, reading: InputContainer) -> Iterator[Any]:
        jumps = reading.format.name in FORMATS
        for packet in reading.demux(_readable(reading)):
            if packet.size:
                if jumps:
                    self._joints.move(packet, (id(reading), packet.stream.index))
                self._note_end(packet)
                yield packet

    def _followed(self, packets: Iterator[Any]) -> Iterator[Any]:
        """Choose another sound or picture where one begins when the chosen one has ended."""
        successions = [_Succession("audio", self._track), _Succession("video", 0)]
        for packet in packets:
            for succession, chosen in zip(successions, (self.sound, self.picture), strict=True):
                if chosen is not None and packet.stream.type == succession.kind:
                    ready, stream = succession.take(packet, chosen)
                    if not hasattr(stream, "decode"):
                        # The library met it while reading and has no decoder for it.
                        raise IndexError(f"stream {stream.index} came later")
                    if succession.kind == "audio":
                        self.sound = stream
                    else:
                        self.picture = stream
                    yield from ready
                    break
            else:
                yield packet
        for succession in successions:
            yield from succession.held

    def close(self) -> None:
        """Close the containers opened beside the first one."""
        self._later.close()

    def _reopened(self, path: Path, before: InputContainer) -> InputContainer | None:
        """Open the file again from its last useful packet on, and choose its streams anew."""
        file = self._later.enter_context(path.open("rb"))
        file.seek(self._at)
        self._base = self._at
        form = before.format.name.split(",")[0]
        try:
            container: InputContainer = self._later.enter_context(
                av.open(file, "r", format=form, **LENIENT)
            )
        except (av.FFmpegError, ValueError):
            return None
        sounds = container.streams.audio
        if self.sound is not None and len(sounds) > self._track:
            self.sound = sounds[self._track]
        if self.picture is not None and container.streams.video:
            self.picture = container.streams.video[0]
        return container

    @property
    def missing_s(self) -> float:
        """How much earlier the packets ended than the headers state, 0 where these may guess."""
        if self._cut_short:
            return math.inf
        promised = self.container.duration
        if promised is None or not _EXACT_DURATION & set(self.container.format.name.split(",")):
            return 0.0
        start_s = (self.container.start_time or 0) / av.time_base
        return max(0.0, start_s + promised / av.time_base - self._end_s)

    @property
    def fault(self) -> str:
        """Damage of the file as a whole, once its packets were read; often none."""
        if self.missing_s > _TOLERATED_SHORTFALL_S:
            return f"{self.name}: truncated: it ends before the length in its headers"
        return ""

    def _note_end(self, packet: Any) -> None:
        if packet.pos is not None:
            self._at = max(self._at, self._base + packet.pos)
        time = packet.pts if packet.pts is not None else packet.dts
        if time is not None:
            end = (time + (packet.duration or 0)) * packet.time_base
            self._end_s = max(self._end_s, float(end))


class _Succession:
    """Which stream of a kind goes on where the chosen one has ended.

    A recording whose broadcaster changed the streams' addresses holds both from the start,
    for FFmpeg also looks at a file's end. Streams that are sent beside the chosen one are other
    languages and never follow it.

    Parameters
    ----------
    kind : str
        ``audio`` or ``video``.
    track : int
        Which of several that begin together is meant, from 0.
    """

    def __init__(self, kind: str, track: int) -> None:
        self.kind = kind
        self.held: list[Any] = []
        self._track = track
        self._beside: set[int] = set()

    def take(self, packet: Any, chosen: Any) -> tuple[list[Any], Any]:
        """Take a packet of the kind; give those that may be passed on, and the stream chosen."""
        number = packet.stream.index
        if number == chosen.index or len(self.held) >= _MOST_HELD:
            self._beside |= {other.stream.index for other in self.held}
            return [*self._released(), packet], chosen
        if number in self._beside:
            return [packet], chosen
        self.held.append(packet)
        if self._span_s(number) < _SILENT_S:
            return [], chosen
        streams = {other.stream.index: other.stream for other in self.held}
        following = [streams[at] for at in sorted(streams)]
        stream = following[self._track if self._track < len(following) else 0]
        return self._released(), stream

    def _released(self) -> list[Any]:
        held, self.held = self.held, []
        return held

    def _span_s(self, number: int) -> float:
        times = [
            float(other.dts * other.time_base)
            for other in self.held
            if other.stream.index == number and other.dts is not None
        ]
        return abs(times[-1] - times[0]) if times else 0.0


@contextmanager
def open_programme(
    source: str | os.PathLike[str] | BinaryIO, *, track: int = 0
) -> Iterator[Programme]:
    """Open a sound file or a video container.

    Parameters
    ----------
    source : path or binary file
        A file without ``seek``, such as a pipe, is read once from its beginning.
    track : int
        Which of its sounds is meant, from 0.

    Yields
    ------
    Programme

    Raises
    ------
    CueError
        If `source` is missing, empty, a folder, not media, or has no such sound.
    """
    name = str(source) if isinstance(source, (str, os.PathLike)) else "standard input"
    with _opened(source, name) as container:
        path = Path(source) if isinstance(source, (str, os.PathLike)) else None
        cut_short = path is not None and _riff_is_cut_short(path)
        programme = Programme(container, name, track, cut_short=cut_short, path=path)
        try:
            yield programme
        finally:
            programme.close()


def has_stream(path: str | os.PathLike[str], kind: str) -> bool:
    """Tell whether a programme holds a stream of a kind: ``audio``, ``video``, ``subtitle``.

    A picture that only decorates a sound file does not count.

    Raises
    ------
    CueError
        If `path` is not a programme.
    """
    with _opened(path, str(path)) as container:
        return any(s.type == kind and not _is_attached_picture(s) for s in container.streams)


def _opened(source: str | os.PathLike[str] | BinaryIO, name: str) -> InputContainer:
    if isinstance(source, (str, os.PathLike)):
        _check_file(Path(source), name)
    try:
        # The file: protocol keeps names with a colon from being read as addresses.
        address = f"file:{source}" if isinstance(source, (str, os.PathLike)) else source
        container: InputContainer = av.open(address, "r", **LENIENT)
    except (av.FFmpegError, ValueError, UnicodeError) as error:
        raise CueError(f"{name}: not a sound or video file: {reason(error)}") from error
    return container


def reason(error: BaseException) -> str:
    """Return what FFmpeg says about `error`, without its file name."""
    return str(getattr(error, "strerror", None) or error)


def _check_file(path: Path, name: str) -> None:
    if path.is_dir():
        raise CueError(f"{name}: is a folder, not a programme")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise CueError(f"{name}: {error.strerror}") from error
    if path.is_file() and size == 0:
        raise CueError(f"{name}: the file is empty")


def _riff_is_cut_short(path: Path) -> bool:
    """Tell whether a WAV file is shorter than it says; FFmpeg trusts the file's size instead."""
    with path.open("rb") as file:
        head = file.read(8)
    told = int.from_bytes(head[4:8], "little")
    if head[:4] != b"RIFF" or told in (0, 0xFFFFFFFF):  # a stream's header states no size
        return False
    return path.stat().st_size < told + 8


def _is_attached_picture(stream: Any) -> bool:
    return Disposition.attached_pic in stream.disposition


def _readable(container: InputContainer) -> list[Any]:
    """Streams with packets: everything but attachments, which travel in the header."""
    return [stream for stream in container.streams if stream.type != "attachment"]
