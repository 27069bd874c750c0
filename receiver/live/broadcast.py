"""A broadcast as it comes: transport stream over UDP, HLS, pipe or file, at its own pace.

`Broadcast` runs in a thread of its own: it opens the source, puts sound and picture on one steady
clock (`receiver.live.continuity`), receives the cuer from both, makes fragments for the browser,
and opens the source again when it fails. What happens goes to one callback as values.
"""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import IO, Any

import av

from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.live.captions import CaptionDecoder, CaptionsShown, caption_stream
from receiver.live.continuity import SteadyClock
from receiver.live.fragments import Fragments, FragmentWriter, playable
from receiver.live.line import READ_TIMEOUT_S, DatagramLine, InputLine, Pipe
from receiver.live.pictureline import PictureLine
from receiver.live.recode import PlainPictures, recodable
from receiver.live.soundline import SoundBlock, SoundLine
from receiver.media.programme import LENIENT
from receiver.reception.authenticity import Trust
from receiver.reception.engine import Receiver
from receiver.reception.events import Event, MotionPiece, State, StateChanged
from receiver.television.metrics import Metrics

_PICTURES_ALONE = 150
"""After this many pictures without sound it may have another address: open the line again."""

_RETRY_S = (0.2, 0.5, 1.0, 2.0)
"""Seconds before a line is opened again, the first times; then as the last."""

_OPTIONS = {"analyzeduration": "5000000", "probesize": "5000000"}


@dataclass(frozen=True, slots=True)
class MediaStart:
    """A new run of media: the header that the browser needs before its fragments.

    `recoded` names the codec of the broadcast if the picture had to be coded anew, `unseen` one
    that can be neither played nor recoded.
    """

    mime: str
    data: bytes
    recoded: str = ""
    unseen: str = ""


@dataclass(frozen=True, slots=True)
class MediaFragment:
    """A piece of media that starts with a picture that needs no other."""

    data: bytes


Happening = Event | MediaStart | MediaFragment | CaptionsShown


class Broadcast:
    """One programme on the air.

    Parameters
    ----------
    source : str or binary file
        ``udp://127.0.0.1:5004`` (see `receiver.live.line.DatagramLine`), address or path of an HLS
        playlist, path, or a pipe.
    voice : Voice
    tell : callable
        Gets every `Happening`, in the thread of `run`.
    key : int
        Key of the watermark.
    format : str, optional
        Of a pipe: ``mpegts``, ``wav``, ...
    once : bool
        Do not open the source again at its end.
    trust : Trust, optional
        Whose cues these should be.

    Raises
    ------
    CueError
        If nothing can be listened to at an address of datagrams.
    """

    def __init__(
        self, source: str | IO[bytes], voice: Voice, tell: Callable[[Happening], None],
        *, key: int = 0, format: str | None = None, once: bool = False, trust: Trust | None = None,
    ) -> None:  # fmt: skip
        self._source, self._voice, self._tell = source, voice, tell
        self._key, self._format, self._once = key, format, once
        self._trust = trust
        self.metrics = Metrics()
        self._line: InputLine | None = None
        if not isinstance(source, str):
            self._line = Pipe(source)
        elif source.startswith("udp:"):
            self._line = DatagramLine(source, on_failure=lambda error: self.metrics.fail(error))
            self._format = format or "mpegts"
        self._stop = threading.Event()
        self._clock = SteadyClock()
        self._receiver: Receiver | None = None
        self._writer: FragmentWriter | None = None
        self._picture: Any = None
        self._unseen = ""
        self._counted = {"received": 0, "lost": 0}
        self._state: State = "searching"
        self._sound = SoundLine(self._clock, self.metrics)
        self._looks = PictureLine(self.metrics)
        self._captions: CaptionDecoder | None = None

    def stop(self) -> None:
        """Ask `run` to end."""
        self._stop.set()
        if self._line is not None:
            self._line.stop()

    def run(self) -> None:
        """Receive until the source ends for good or `stop` is called.

        Raises
        ------
        CueError
            If `once` is set and the source cannot be opened. Without `once` nothing ends it but
            `stop`: failures are counted, and the source is opened again.
        """
        attempt = 0
        while not self._stop.is_set():
            try:
                self._run_once()
                attempt = 0
            except Exception as error:  # whatever comes in, reception goes on
                if self._once:
                    self._give_up(error, attempt)
                self._recover(error)
            if self._once and (self._line is None or self._line.over):
                break
            self._change("lost" if self._state in ("locked", "degraded") else self._state)
            self._stop.wait(_RETRY_S[min(attempt, len(_RETRY_S) - 1)])
            attempt += 1
        self._finish()

    def _give_up(self, error: Exception, attempt: int) -> None:
        """Raise what makes a source that is opened once useless."""
        if isinstance(error, (av.error.FFmpegError, OSError)):
            if attempt == 0 and not self._sound.now_s:
                raise CueError(f"{self._source}: cannot be received: {error}") from error
        else:
            raise error

    def _recover(self, error: Exception) -> None:
        """Count a failure; after one of no known kind begin with nothing that may have failed."""
        self.metrics.fail(error)
        if not isinstance(error, (av.error.FFmpegError, OSError, CueError)):
            self._receiver = self._writer = None
            self._sound = SoundLine(self._clock, self.metrics, now_s=self._sound.now_s)
            self._looks = PictureLine(self.metrics)

    def _run_once(self) -> None:
        """Receive from one connection, until it ends or the programme has changed its form."""
        if self._line is not None:
            self._line.connect()
        with av.open(
            self._line or self._source,
            "r",
            format=self._format,
            options=_OPTIONS,
            timeout=(READ_TIMEOUT_S, READ_TIMEOUT_S),
            **LENIENT,
        ) as container:
            self.metrics.add("connections_total")
            sound = next(iter(container.streams.audio), None)
            picture = next(iter(container.streams.video), None)
            self._choose_picture(picture)
            self._looks.connect(picture)
            if sound is not None:
                self._sound.connect(sound)
            used = self._picture is not None or self._looks.format is not None
            seen = picture if used else None
            streams = [stream for stream in (sound, seen) if stream is not None]
            if not streams:
                raise CueError(f"{self._source}: neither sound nor picture")
            text = caption_stream(container)
            if text is not None:
                streams.append(text)
                self._captions = CaptionDecoder()
            if sound is None:
                self._open_writer(0, 0)
                if self._receiver is None:
                    self._receiver = Receiver(
                        voice=self._voice,
                        key=self._key,
                        keep_keys=False,
                        trust=self._trust,
                        calm=True,
                    )
            without_sound = 0
            for packet in self._packets(container, streams):
                if self._stop.is_set():
                    return
                if packet.stream is sound:
                    without_sound = 0
                    for block in self._sound.take(packet):
                        self._hear(block)
                elif packet.stream is text:
                    self._read_captions(packet)
                elif packet.pts is not None:
                    without_sound += 1
                    self._take_picture(packet)
                if sound is not None and without_sound > _PICTURES_ALONE and self._line:
                    return

    def _packets(self, container: Any, streams: list[Any]) -> Iterator[Any]:
        """Yield the packets of some streams, until there are none.

        A damaged table of programmes, or a new one, brings forth streams that the library cannot
        name, which it cannot end.
        """
        try:
            for packet in container.demux(streams):
                if self._line is not None and packet.size:
                    self._line.useful()
                yield packet
        except IndexError:
            self.metrics.add("damaged_packets_total")

    def _choose_picture(self, stream: Any) -> None:
        """Pass on what browsers play, recode what they do not; note what neither can."""
        self._close_writer()
        self._picture, self._unseen = None, ""
        if stream is None:
            return
        if playable(stream):
            self._picture = stream
        elif recodable(stream):
            self._picture = PlainPictures(stream)
        else:
            self._unseen = str(stream.codec_context.name)

    def _open_writer(self, fs: int, channels: int) -> None:
        self._close_writer()
        self._writer = FragmentWriter(self._picture, fs, channels)

    def _hear(self, block: SoundBlock) -> None:
        """Give sound to the receiver and to the viewers."""
        samples = block.samples
        if block.fresh or self._receiver is None:
            self._end_receiver()
            self._receiver = Receiver(
                block.fs, samples.shape[1], voice=self._voice, key=self._key,
                start_s=block.time_s, keep_keys=False, trust=self._trust, calm=True,
            )  # fmt: skip
            self._looks.restart()
        if block.fresh or self._writer is None:
            self._open_writer(block.fs, samples.shape[1])
        self._tell_all(self._receiver.process(samples))
        self._write(lambda writer: writer.sound(samples, block.time_s))
        self._measure(len(samples) / block.fs)

    def _take_picture(self, packet: Any) -> None:
        stamp_s = float(packet.pts * packet.time_base)
        place = self._clock.place("picture", stamp_s)
        self._look(packet, place.time_s)
        if isinstance(self._picture, PlainPictures):
            self._recode(self._picture, packet, place.time_s)
        elif self._picture is not None:
            self._write(lambda writer: writer.picture(packet, place.time_s))

    def _read_captions(self, packet: Any) -> None:
        """Pass on the text that a packet shows."""
        if self._captions is None or packet.pts is None or not packet.size:
            return
        time_s = self._clock.find(float(packet.pts * packet.time_base))
        try:
            shown = None if time_s is None else self._captions.take(packet, time_s)
        except (av.error.FFmpegError, ValueError):
            self.metrics.add("damaged_packets_total")
            return
        if shown is not None:
            self._tell(shown)

    def _look(self, packet: Any, time_s: float) -> None:
        """Give the picture to the receiver, as long as something may be found in it."""
        receiver, form = self._receiver, self._looks.format
        if receiver is None or form is None:
            return
        for seen in self._looks.take(packet, time_s):
            if seen.fresh:
                receiver.open_picture(
                    form.width, form.height, form.fps, depth=form.depth, start_s=seen.time_s
                )
            self._tell_all(receiver.see(seen.luma))
            if not receiver.looking:
                self._looks.rest(time_s)
                break

    def _recode(self, decoder: PlainPictures, packet: Any, time_s: float) -> None:
        try:
            frames = list(decoder.take(packet, time_s))
        except (av.error.FFmpegError, ValueError):
            self.metrics.add("damaged_packets_total")
            return
        for frame, shown_s in frames:
            self._write(partial(FragmentWriter.frame, frame=frame, time_s=shown_s))

    def _write(self, make: Callable[[FragmentWriter], Fragments]) -> None:
        """Make fragments; damage costs the viewer a piece of picture, never the cuer."""
        if self._writer is None:
            return
        try:
            self._publish(make(self._writer))
        except (av.error.FFmpegError, ValueError):
            self.metrics.add("damaged_packets_total")

    def _publish(self, made: Fragments) -> None:
        assert self._writer is not None
        if made.start:
            recoded = self._picture.name if isinstance(self._picture, PlainPictures) else ""
            self._tell(MediaStart(self._writer.mime, made.start, recoded, self._unseen))
        for fragment in made.fragments:
            self._tell(MediaFragment(fragment))

    def _tell_all(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, StateChanged):
                self._state = event.state
            elif isinstance(event, MotionPiece) and event.layers:
                if self._state == "lost" and self._receiver is not None:
                    self._change(self._receiver.state)  # the line was lost, and the receiver waited
                self.metrics.set("motion_margin_seconds", event.start_s - self._sound.now_s)
            self._tell(event)

    def _measure(self, seconds: float) -> None:
        assert self._receiver is not None
        summary = self._receiver.summary()
        self.metrics.add("sound_seconds_total", seconds)
        for name, earlier in self._counted.items():
            count = summary["superframes"][name]
            self.metrics.set(f"superframes_{name}_total", earlier + count)
        self.metrics.set("bit_error_rate", self._receiver.ber_estimate or 0.0)
        self.metrics.set("locked", self._receiver.state in ("locked", "degraded"))

    def _end_receiver(self) -> None:
        """Let the receiver finish; keep its counts."""
        if self._receiver is None:
            return
        self._tell_all(self._receiver.flush())
        for name, count in self._receiver.summary()["superframes"].items():
            self._counted[name] += count
        self._receiver = None

    def _change(self, state: State) -> None:
        if state != self._state:
            self._state = state
            self._tell(StateChanged(self._sound.now_s, state))

    def _close_writer(self) -> None:
        self._write(FragmentWriter.close)
        self._writer = None

    def _finish(self) -> None:
        self._close_writer()
        self._end_receiver()
        self._change("ended")
