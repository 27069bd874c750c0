"""The process that marks: messages of the playout in, marked pieces of the sound out.

A failure in a message costs that message only.
"""

import importlib
import queue
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from codec.compiled import Settings
from codec.errors import CueError
from cuecast.command.cache import CompilationNotes
from cuecast.command.files import PIPE
from cuecast.live.channel import Channel
from cuecast.live.options import LiveOptions, MarkedPes, RunClock
from cuecast.live.packets import Pes
from cuecast.live.pcm import MarkedPcm, PcmForm
from cuecast.live.pcm_marker import PcmMarker
from cuecast.live.sound import SoundMarker
from cuecast.live.text import Caption, LiveMotion, read_caption
from cuecast.live.worker import Cuer, MarkedPiece, WorkerNote
from cuecast.media.timed_text import subtitles_of_packet

if TYPE_CHECKING:
    from cuecast.live.waiting import WaitingRoom

_BEAT_S = 0.25
"""Seconds between signs of life."""

_LAST_S = 5.0
"""How long a process stays whose work is done."""

_REPORT_S = 1.0
"""Seconds between reports of a worker."""

_LOOK_S = 0.02
"""How often the process looks for such lines."""

_CAUGHT_UP_S = 0.3
"""Age in seconds of sound that is marked again, once some had to be passed over."""

_TRIAL_S = 1.0
"""How long a process that is late tries to catch up before it passes sound over."""

_GAIN = 1.0
"""Seconds that it must catch up in a second for that."""

_EASED_FROM = 0.5
"""Share of its patience at which a process goes over to a cheaper level for sound."""

_CALM_S = 60.0
"""Seconds without lateness after which it goes back to the dearer level."""


def serve(
    cuer: Cuer, options: LiveOptions, patience_s: float | None, hold_s: float, line: Any, lines: Any
) -> None:
    """Work on messages until the playout is gone, and any that could go on in its place."""
    import signal

    # The playout has them, and ends this.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    Settings.listener = CompilationNotes()
    channel = Channel(line)
    try:
        marking = Marking(cuer, options, patience_s, channel.send, hold_s)
        channel.send("ready")
        threading.Thread(target=_beat, args=(channel.send,), daemon=True).start()
        while not marking.over:
            marking.read(lines)
            marking.tell_done()
            for message in channel.receive(marking.idle_s):
                marking.take(channel.taken, *message)
                marking.tell_done()
                if marking.over:
                    break
        channel.send("ended")
        for _ in channel.receive(_LAST_S):  # whoever goes on may ask for the end again
            pass
    except (OSError, EOFError, KeyboardInterrupt):
        return


def _beat(send: Callable[[Any], None]) -> None:
    """Give signs of life until the playout is gone."""
    while True:
        time.sleep(_BEAT_S)
        try:
            send("alive")
        except (OSError, ValueError):
            return


class Marking:
    """The process's work on the messages."""

    def __init__(
        self,
        cuer: Cuer,
        options: LiveOptions,
        patience_s: float | None,
        send: Callable[[Any], None],
        hold_s: float = 0.0,
    ) -> None:
        from codec.cuer.voice import load_voice

        self._voice = load_voice(cuer.voice)
        self._motion: Any = _motion(cuer, self._voice)
        _warm(self._motion, cuer, self._voice, options)
        self._options = options
        self._marker: Any = SoundMarker(self._motion, self._voice, options, self._note)
        self._send, self._patience_s = send, patience_s
        self._epoch = self._passed = 0
        self._late_since: tuple[float, float] | None = None
        self._fresh = False
        self._eased, self._busy_s = False, 0.0
        self._pressed_s: float | None = None
        self.eased_total = 0
        self._said = ""
        self._reported_s = 0.0
        self._done = self._told = 0
        self.over = False
        self._room: WaitingRoom | None = None
        if cuer.motion == PIPE:
            # Seeing keys takes libraries that nothing else here needs.
            from cuecast.live import waiting

            self._room = waiting.WaitingRoom(
                self._motion,
                ahead_s=options.ahead_s,
                seen_s=options.seen_s,
                hold_s=None if patience_s is None else hold_s,
            )
        self._hold_s = hold_s
        self.idle_s = 1.0 if self._room is None else _LOOK_S

    def read(self, lines: Any) -> None:
        """Take the lines of an interpreter that have come, and the sound that waited for them."""
        if self._room is None:
            return
        try:
            while self._room.hungry:
                came_s, line = lines.get_nowait()
                self._work(came_s, "line", line)
        except queue.Empty:
            pass
        while (found := self._room.leave(time.monotonic(), self._marker.heard_s)) is not None:
            number, sent_s, *message = found
            self._work(sent_s + self._hold_s, *message)
            self._room.heard(self._marker.heard_s, sent_s)
            self._done = number

    def take(self, number: int, sent_s: float, kind: str, *content: Any) -> None:
        """Take a message of the playout; with an interpreter it waits for her."""
        if self._room is None:
            self._work(sent_s, kind, *content)
            self._done = number
        else:
            self._room.enter(sent_s, (number, sent_s, kind, *content))

    def tell_done(self) -> None:
        """Tell a playout that waits for this process which message was the last one done."""
        if self._patience_s is None and self._done != self._told:
            self._told = self._done
            self._send(self._done)

    def _work(self, sent_s: float, kind: str, *content: Any) -> None:
        """Carry out a message; a failure is reported and costs only it."""
        try:
            getattr(self, f"_take_{kind}")(sent_s, *content)
        except CueError as error:
            self._note_once(str(error))
        except (BrokenPipeError, EOFError):
            raise
        except Exception as error:  # the programme goes on, whatever happens to the cuer
            self._note_once(f"{type(error).__name__}: {error}")
        self._report()

    def _take_sound(self, sent_s: float, epoch: int, kind: str, pes: Pes) -> None:
        self._choose_level(time.monotonic() - sent_s)
        if self._is_late(sent_s):
            self._passed += 1
            return
        if self._passed:
            clock = self._marker.clock
            self._marker.abandon()
            if clock is not None:
                self._marker.resume(clock, None)
            self._note(f"too slow: {self._passed} packets of sound were not marked")
            self._passed = 0
        if epoch != self._epoch:
            self._emit(self._marker.flush())
            self._epoch = epoch
        self._emit(self._marker.process(kind, pes))

    def _take_pcm(self, sent_s: float, form: PcmForm, first: int, data: bytes) -> None:
        if self._is_late(sent_s):
            self._passed += 1
            return
        if self._passed:
            self._note(f"too slow: {self._passed} pieces of sound were not marked")
            self._passed = 0
        if not isinstance(self._marker, PcmMarker):
            self._marker = PcmMarker(self._motion, self._voice, self._options, form)
        self._emit(self._marker.process(first, data))

    def _is_late(self, sent_s: float) -> bool:
        """Whether sound is passed over: once it is too late and not caught up with, until new."""
        if self._patience_s is None:
            return False
        now_s = time.monotonic()
        age_s = now_s - sent_s
        self._fresh |= age_s <= self._patience_s
        if not self._fresh:  # it came while this process was loading: its time has passed
            return True
        if self._passed or age_s <= self._patience_s:
            self._late_since = None
            return bool(self._passed) and age_s > _CAUGHT_UP_S
        if self._late_since is None:
            self._late_since = now_s, age_s
        tried_s, caught_up_s = now_s - self._late_since[0], self._late_since[1] - age_s
        return tried_s > _TRIAL_S and caught_up_s < _GAIN * tried_s

    def _choose_level(self, age_s: float) -> None:
        """Mark without rehearsal where sound waits for long, and with it again once it is calm."""
        if self._patience_s is None or not self._options.rehearsed:
            return
        now_s = time.monotonic()
        if not self._fresh or age_s < _EASED_FROM * self._patience_s:
            self._pressed_s = None
        elif self._pressed_s is None:
            self._pressed_s = now_s
        if self._pressed_s is not None:
            self._busy_s = now_s
        if not self._eased and self._pressed_s is not None and now_s - self._pressed_s > _TRIAL_S:
            self._eased = True
            self.eased_total += 1
            self._note("busy: marked without rehearsal from here on")
        elif self._eased and now_s - self._busy_s > _CALM_S:
            self._eased = False
            self._note("calm: marked with rehearsal again")
        else:
            return
        self._marker.rehearsed = not self._eased

    def _take_caption(self, sent_s: float, line: bytes) -> None:
        now_s = self._marker.heard_s - (time.monotonic() - sent_s if self._patience_s else 0.0)
        caption = read_caption(line, max(0.0, now_s))
        if caption is not None and isinstance(self._motion, LiveMotion):
            self._motion.add(caption)

    def _take_line(self, came_s: float, line: bytes | None) -> None:
        assert self._room is not None
        if line is None:
            self._room.ended = True
            self._note("interpreter: no more lines")
        else:
            self._room.line(came_s, line)

    def _take_subtitle(self, sent_s: float, pts: int, data: bytes) -> None:
        start_s = self._marker.time_s(pts)
        if start_s is None or not isinstance(self._motion, LiveMotion):
            return
        for one in subtitles_of_packet(data, start_s, start_s):
            self._motion.add(Caption(one.start_s, one.text))

    def _take_resume(self, sent_s: float, clock: RunClock | None, until: int | None) -> None:
        """Go on where another process ended; what waited for this one is not too late yet."""
        self._fresh = self._fresh or until is not None
        if clock is not None:
            self._marker.resume(clock, until)

    def _take_end(self, sent_s: float) -> None:
        self._emit(self._marker.flush())
        self.over = True

    def _emit(self, packets: Iterator[MarkedPes] | Iterator[MarkedPcm]) -> None:
        for pes in packets:
            self._send(MarkedPiece(self._epoch, pes))

    def _note(self, line: str) -> None:
        self._send(WorkerNote(line))

    def _note_once(self, line: str) -> None:
        if line != self._said:
            self._said = line
            self._note(line)

    def _report(self) -> None:
        if time.monotonic() - self._reported_s < _REPORT_S and not self.over:
            return
        self._reported_s = time.monotonic()
        figures: dict[str, float] = {
            "superframes_total": self._marker.superframes,
            "damaged_frames_total": getattr(self._marker, "damaged", 0),
            "eased_total": self.eased_total,
            "eased": self._eased,
            "joint_seconds_total": getattr(self._marker, "joint_s", 0.0),
        }
        if isinstance(self._motion, LiveMotion):
            figures |= {
                "captions_total": self._motion.captions,
                "captions_left_out_total": self._motion.left_out,
                "cuer_lag_seconds": self._motion.lag_s,
            }
        if self._room is not None:
            figures |= {
                "poses_total": self._motion.poses,
                "keys_recognised_total": self._motion.keys,
            }
        self._send(WorkerNote(figures=figures, clock=getattr(self._marker, "clock", None)))


def _warm(motion: Any, cuer: Cuer, voice: Any, options: LiveOptions) -> None:
    """Load what would otherwise be loaded while the first sound waits."""
    if cuer.motion == PIPE:
        from cuecast.live.interpreter import warm_recognition

        warm_recognition(voice)
    elif not isinstance(motion, LiveMotion):
        motion.window(0.0, 1)
    marker = SoundMarker(LiveMotion(voice, cuer.reading), voice, options)
    for _ in marker.mark(np.random.default_rng(0).normal(0, 0.1, (4 * 48_000, 2))):
        pass


def _motion(cuer: Cuer, voice: Any) -> Any:
    """Return the motion that a `Cuer` stands for."""
    motions = importlib.import_module("cuecast.dubbing.motions")
    if cuer.motion == PIPE:
        from cuecast.live.interpreter import InterpretedMotion

        return InterpretedMotion(voice)
    if cuer.motion:
        from codec.cuer.motion import load_motion

        return motions.GivenMotion(load_motion(cuer.motion), voice)
    if cuer.subtitles:
        from synth.language.subtitles import read_subtitles
        from synth.planning.scoring.text_score import score_of_subtitles

        subtitles = read_subtitles(cuer.subtitles)
        score = score_of_subtitles(subtitles, warn=lambda line: None, reading=cuer.reading)
        return motions.SynthesisedMotion(
            score, voice, seed=cuer.seed, options=cuer.reading.options, alignment=cuer.alignment
        )
    return LiveMotion(voice, cuer.reading, seed=cuer.seed, alignment=cuer.alignment)
