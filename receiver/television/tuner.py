"""Tuners: a programme's cuer from any time on, as a stream of events.

`ProgrammeTuner` receives the mark of a file; `MotionTuner` plays a known motion the same way
(previews, tests); `EagerTuner` begins before it is asked. All are read by
`receiver.television.server` at the viewer's pace.
"""

import os
import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key
from receiver.media.programme import open_programme
from receiver.reception.authenticity import Trust
from receiver.reception.events import SUPERFRAME_S, KeysFound, MotionPiece, StateChanged
from receiver.reception.reception import ProgrammeReceiver, Progress

PREROLL_S = 3.2
"""How much earlier than the wanted time reception starts: acquisition plus the lead."""

PROBE_S = 4.0
"""Seconds of sound without a cuer after which the picture is looked at as well."""


class Tuner(Protocol):
    """Reception of one programme, from any time on."""

    def tune(self, start_s: float) -> Iterator[Progress]:
        """Yield everything that can be seen from `start_s` on, in order of reception."""
        ...


@dataclass(frozen=True, slots=True)
class ProgrammeTuner:
    """Receives sound and picture of a media file; times are those of a player that shows it.

    Attributes
    ----------
    path : str or path
        The programme.
    voice : Voice
    key : int
        Key of the watermark.
    trust : Trust, optional
        Whose cues these should be.
    """

    path: str | os.PathLike[str]
    voice: Voice
    key: int = 0
    trust: Trust | None = None

    def tune(self, start_s: float) -> Iterator[Progress]:
        """Yield the events of reception that starts early enough to show `start_s`.

        The picture is looked at, too, once the sound has had no cuer for `PROBE_S`, or loses one.
        """
        until_s = begin_s = max(0.0, start_s - PREROLL_S)
        found = False
        for progress in self._receive(begin_s, look=False):
            until_s = progress.until_s
            yield progress
            states = {event.state for event in progress.events if isinstance(event, StateChanged)}
            found = found or "locked" in states
            if states & {"degraded", "lost"} or (not found and until_s > begin_s + PROBE_S):
                resumed_s = until_s - PREROLL_S if found else begin_s
                for both in self._receive(resumed_s, look=True):
                    until_s = both.until_s
                    yield both
                break
        yield Progress(until_s, (StateChanged(until_s, "ended"),))

    def _receive(self, begin_s: float, *, look: bool) -> Iterator[Progress]:
        """Yield the events of sound, and of the picture if wanted or if there is no sound."""
        with open_programme(self.path) as programme:
            begin_s = max(0.0, begin_s - programme.player_s)
            programme.seek(begin_s)
            look = look or programme.sound is None or programme.picture is None
            yield from ProgrammeReceiver(
                programme, self.voice, key=self.key, start_s=begin_s, keep_keys=False,
                clock_s=programme.player_s, trust=self.trust, calm=True, look=look,
            ).progress()  # fmt: skip


class EagerTuner:
    """Receives the beginning of a programme before the first viewer asks for it.

    Parameters
    ----------
    tuner : Tuner
    ahead_s : float
        How far it receives beforehand.
    """

    def __init__(self, tuner: Tuner, ahead_s: float) -> None:
        self._tuner = tuner
        self._ahead_s = ahead_s
        self._ready: queue.SimpleQueue[Progress | Exception | None] = queue.SimpleQueue()
        self._stream: Iterator[Progress] | None = tuner.tune(0.0)
        threading.Thread(target=self._begin, args=(self._stream,), daemon=True).start()

    def _begin(self, stream: Iterator[Progress]) -> None:
        try:
            for progress in stream:
                self._ready.put(progress)
                if progress.until_s >= self._ahead_s:
                    break
        except Exception as error:
            self._ready.put(error)
        self._ready.put(None)

    def tune(self, start_s: float) -> Iterator[Progress]:
        """Yield what is known of the beginning, then the rest; other places as received."""
        stream, self._stream = self._stream, self._stream if start_s > 0 else None
        if stream is None or start_s > 0:
            yield from self._tuner.tune(start_s)
            return
        while (progress := self._ready.get()) is not None:
            if isinstance(progress, Exception):
                raise progress
            yield progress
        yield from stream


@dataclass(frozen=True, slots=True)
class MotionTuner:
    """Plays a motion as if it were received, one superframe at a time."""

    motion: Motion

    def tune(self, start_s: float) -> Iterator[Progress]:
        """Yield the pieces of the motion from `start_s` on."""
        motion = self.motion
        size = max(1, round(SUPERFRAME_S * motion.rate_hz))
        first = max(0, int((start_s - motion.start_s) * motion.rate_hz) // size)
        yield Progress(start_s, (StateChanged(start_s, "locked"),))
        for at in range(first * size, len(motion.params), size):
            piece = MotionPiece(
                motion.start_s + at / motion.rate_hz,
                motion.rate_hz,
                motion.params[at : at + size],
                ("L0", "L1"),
            )
            keys = self._keys_within(piece.start_s, piece.end_s)
            yield Progress(piece.end_s, (piece, KeysFound(keys, final=True)) if keys else (piece,))
        end_s = motion.start_s + motion.duration_s
        yield Progress(end_s, (StateChanged(end_s, "ended"),))

    def _keys_within(self, start_s: float, end_s: float) -> tuple[Key, ...]:
        keys = self.motion.score.keys if self.motion.score else ()
        return tuple(key for key in keys if start_s <= key.start < end_s)
