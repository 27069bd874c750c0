"""Reception of a programme from a container: packets in, the receiver's events out.

Sound and picture are read once, as they lie in the container, and decoded side by side. A picture
without a mark is looked at again from time to time only: a carrier may begin late, but
looking costs more than listening.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.media.picture import PictureDecoder, luma_of
from receiver.media.programme import Programme
from receiver.media.sound import CarrierSound, SoundDecoder
from receiver.reception.authenticity import Trust
from receiver.reception.engine import Receiver
from receiver.reception.events import Event

REST_S = 60.0
"""Pause in seconds before a picture without a mark is searched again."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Events of a stretch of programme that ends at `until_s`."""

    until_s: float
    events: tuple[Event, ...]


class ProgrammeReceiver:
    """A receiver tuned to a programme.

    Parameters
    ----------
    programme : Programme
        Read from where it stands.
    voice : Voice
    key : int
        Key of the watermark.
    start_s : float
        Second at which the receiver is switched on; the part before is passed over. From 0 on it
        hears a sound that begins before the picture, too.
    listen, look : bool
        Whether to use the sound, and the picture, if there is one.
    keep_keys : bool
        Keep the keys for the receiver's summary.
    clock_s : float
        Time of the programme's zero on the clock of events.
    trust : Trust, optional
        Whose cues these should be; its clock counts from the programme's zero.
    guess : bool
        Whether injuries of a sound without a mark, and crops of a picture, are searched for.
    calm : bool
        Whether the hand is held up where it is too fast to be read: for display.
    draw : bool
        Whether to give the motion, and not keys and states alone.

    Attributes
    ----------
    receiver : Receiver
    damaged : int
        Packets that could not be decoded.

    Raises
    ------
    CueError
        If the programme has neither a sound that can carry a cuer nor a picture to look at.
    """

    def __init__(
        self, programme: Programme, voice: Voice, *, key: int = 0, start_s: float = 0.0,
        listen: bool = True, look: bool = True, keep_keys: bool = True, clock_s: float = 0.0,
        trust: Trust | None = None, guess: bool = True, calm: bool = False, draw: bool = True,
    ) -> None:  # fmt: skip
        self._programme = programme
        if start_s <= 0:
            start_s = -programme.player_s
        self._begin_s = clock_s + start_s
        self.receiver = Receiver(
            voice=voice,
            key=key,
            start_s=self._begin_s,
            keep_keys=keep_keys,
            trust=trust,
            guess=guess,
            calm=calm,
            draw=draw,
        )
        self._sound: _Listening | None = None
        self._picture: _Looking | None = None
        place = programme, self.receiver, start_s, clock_s
        refused: list[CueError] = []
        if listen and (programme.sound is not None or not look):
            try:
                self._sound = _Listening(*place)
            except CueError as error:
                refused.append(error)
        if look and programme.picture is not None:
            try:
                self._picture = _Looking(*place)
            except CueError as error:
                refused.append(error)
        if self._sound is None and self._picture is None:
            raise refused[0] if refused else CueError(f"{programme.name}: nothing to receive")

    @property
    def damaged(self) -> int:
        """Packets that could not be decoded."""
        parts = (self._sound, self._picture)
        return sum(part.decoder.damaged for part in parts if part is not None)

    def progress(self) -> Iterator[Progress]:
        """Yield the events, to the end of the programme.

        Raises
        ------
        CueError
            If the container is damaged, or there is nothing to receive after the start.
        """
        programme, receiver = self._programme, self.receiver
        for packet in chain(programme.packets(follow=True), [None]):
            events: list[Event] = []
            if self._sound is not None and (packet is None or packet.stream is programme.sound):
                events += self._sound.process(packet)
            if self._picture is not None and (packet is None or packet.stream is programme.picture):
                events += self._picture.process(packet)
            if receiver.now_s > self._begin_s:
                yield Progress(receiver.now_s, tuple(events))
        if receiver.now_s <= self._begin_s:
            raise CueError(f"{programme.name}: nothing to receive from its sound or picture")
        yield Progress(receiver.now_s, tuple(receiver.flush()))


class _Listening:
    """The sound on its way into the receiver."""

    def __init__(
        self, programme: Programme, receiver: Receiver, start_s: float, clock_s: float
    ) -> None:
        self.decoder = SoundDecoder(programme, strict=False)
        self._hearing = CarrierSound(programme)
        self._receiver, self._start_s, self._clock_s = receiver, start_s, clock_s
        self._open = False

    def process(self, packet: Any) -> list[Event]:
        """Take a packet, None for the end."""
        block = self._switched_on(self.decoder.process(packet))
        heard = self._hearing.process(block)
        if packet is None:
            heard = np.concatenate([heard, self._hearing.flush()])
        return self._receiver.process(heard) if self._open and len(heard) else []

    def _switched_on(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        """Cut off the part before the receiver is switched on."""
        fs = self.decoder.format.fs
        end_s = (self.decoder.start_s or 0.0) + self.decoder.samples / fs
        early = max(0, round((self._start_s - end_s) * fs) + len(block))
        block = block[early:]
        if not self._open and len(block):
            self._open = True
            first_s = self._clock_s + end_s - len(block) / fs
            self._receiver.open_sound(self._hearing.rate, self._hearing.channels, start_s=first_s)
        return block


class _Looking:
    """The picture on its way into the receiver."""

    def __init__(
        self, programme: Programme, receiver: Receiver, start_s: float, clock_s: float
    ) -> None:
        self.decoder = PictureDecoder(programme)
        self._origin_s = programme.origin_s
        self._receiver, self._start_s, self._clock_s = receiver, start_s, clock_s
        self._open = False
        self._asleep_until_s: float | None = None

    def process(self, packet: Any) -> list[Event]:
        """Take a packet, None for the end."""
        if self._sleeps(packet):
            return []
        events: list[Event] = []
        for place, frame in self.decoder.process(packet):
            time_s = self.decoder.time_s(place)
            if time_s < self._start_s - 0.5 / float(self.decoder.format.fps):
                continue
            if not self._open:
                form = self.decoder.format
                self._receiver.open_picture(
                    form.width,
                    form.height,
                    form.fps,
                    depth=form.depth,
                    start_s=self._clock_s + time_s,
                )
                self._open = True
            events += self._receiver.see(luma_of(frame))
            # No mark in the picture: decode nothing for a while.
            if not self._receiver.looking:
                self._asleep_until_s, self._open = time_s + REST_S, False
                break
        return events

    def _sleeps(self, packet: Any) -> bool:
        """Pass over packets until it is time to look again, at a picture that needs no other."""
        if self._asleep_until_s is None:
            return False
        if packet is None or packet.pts is None or not packet.is_keyframe:
            return True
        if float(packet.pts * packet.time_base) - self._origin_s < self._asleep_until_s:
            return True
        self._asleep_until_s = None
        self.decoder.restart()
        return False
