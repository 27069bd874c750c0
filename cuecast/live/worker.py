"""The playout's side of the process that marks, and of one that stands by.

The playout sends PES packets and live text, and takes marked PES packets. If the process dies, or
gives no sign of life, the one that stands by takes its place: it is given the sound that has not
gone out yet. Without one the process is started anew; meanwhile the programme
passes as it is.
"""

import queue
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing import get_context
from typing import Any

from cuecast.live.options import LiveOptions, MarkedPes, RunClock
from cuecast.live.pcm import MarkedPcm
from synth.planning.scoring.text_score import Reading

_WAITING = 4000
"""Messages that may wait for the process: minutes of sound."""

_RESTART_S = (1.0, 2.0, 5.0, 10.0, 30.0)
"""Seconds before a worker is started again, the first times; then as the last."""

_LINES = 400
"""Lines of an interpreter that may wait for the process."""

_HUNG_S = 2.0
"""Seconds without a sign of life after which a process counts as stopped; a busy one gives some."""

_HUNG_AGAIN_S = 60.0
"""Seconds after the start of a process in which it is not given up for that."""

_KEPT_MESSAGES = ("sound", "pcm", "subtitle", "caption")
"""Kinds of messages that a process which takes over is given again."""


@dataclass(frozen=True, slots=True)
class Cuer:
    """Who cues, and what: everything that a new process needs.

    Attributes
    ----------
    voice : str
    reading : Reading
    seed : int
    alignment : str
    subtitles, motion : str
        Files whose time 0 is the first sample; one of them or none: then live text is cued. The
        motion ``-`` is that of a live interpreter.
    """

    voice: str = "claire"
    reading: Reading = field(default_factory=Reading)
    seed: int = 0
    alignment: str = "attina"
    subtitles: str = ""
    motion: str = ""


@dataclass(frozen=True, slots=True)
class MarkedPiece:
    """A marked piece of the sound with this number of the playout."""

    epoch: int
    pes: MarkedPes | MarkedPcm


@dataclass(frozen=True, slots=True)
class WorkerNote:
    """Something to note, figures by their names, and the clock of the sound under way."""

    line: str = ""
    figures: dict[str, float] = field(default_factory=dict)
    clock: RunClock | None = None


class MarkingProcess:
    """One process that marks, with the ways to it and back."""

    def __init__(self, arguments: tuple[Any, ...]) -> None:
        context = get_context("spawn")
        self.messages: Any = context.Queue(_WAITING)
        self.lines: Any = context.Queue(_LINES)
        self.results, theirs = context.Pipe(duplex=False)
        self.process = context.Process(
            target=_serve, args=(*arguments, self.messages, self.lines, theirs), daemon=True
        )
        self.process.start()
        theirs.close()
        self.started_s = time.monotonic()
        self.ready = False

    def send(self, sent_s: float, *message: Any) -> None:
        """Give it a message; one that is full of them gets none."""
        try:
            self.messages.put_nowait((sent_s, *message))
        except (queue.Full, ValueError, OSError):
            return

    def close(self) -> None:
        """End it."""
        self.process.kill()
        self.process.join(5.0)
        for one in (self.messages, self.lines):
            one.cancel_join_thread()
            one.close()
        self.results.close()


def _serve(*arguments: Any) -> None:
    """Mark, in the process that does so."""
    # That process imports what it works with; the playout needs none of it.
    from cuecast.live.marking import serve

    serve(*arguments)


class Worker:
    """The processes that mark for one playout.

    Parameters
    ----------
    cuer : Cuer
    options : LiveOptions
    patience_s : float, optional
        Sound that has waited longer is passed over; None: all of it is marked.
    hold_s : float
        How long sound waits for a live interpreter.
    standby : bool
        Whether a second process stands by once the first one is ready.

    Attributes
    ----------
    restarts, takeovers : int
        Processes that ended or were given up; those whose place was taken at once.
    ready, was_ready, ended : bool
        Whether the process can take sound; whether one could, ever; whether it has marked all.
    """

    def __init__(
        self, cuer: Cuer, options: LiveOptions, patience_s: float | None, hold_s: float = 0.0,
        *, standby: bool = False,
    ) -> None:  # fmt: skip
        self._arguments = cuer, options, patience_s, hold_s
        self._keeps_s = options.delay_s if standby else 0.0
        self._process: MarkingProcess | None = MarkingProcess(self._arguments)
        self._standby: MarkingProcess | None = None
        self._sent: deque[tuple[float, tuple[Any, ...]]] = deque()
        self._clock: RunClock | None = None
        self._until: tuple[int, int] | None = None
        self._answered_s: float | None = None
        self._failures = 0
        self._again_s = 0.0
        self.restarts = self.takeovers = 0
        self.ready = self.was_ready = self.ended = False

    @property
    def alive(self) -> bool:
        """Whether there is a process."""
        return self._process is not None

    @property
    def stands_by(self) -> bool:
        """Whether a second process could take over now."""
        return self._standby is not None and self._standby.ready

    def send(self, *message: Any) -> None:
        """Give the process a message."""
        now_s = time.monotonic()
        if self._keeps_s and message[0] in _KEPT_MESSAGES:
            self._sent.append((now_s, message))
            while self._sent[0][0] < now_s - self._keeps_s:
                self._sent.popleft()
        if self._process is not None:
            self._process.send(now_s, *message)

    def interpret(self, line: bytes | None) -> None:
        """Give the process a line of an interpreter, None at their end; wait while it is full."""
        came_s = time.monotonic()
        while True:
            process = self._process
            try:
                if process is not None:
                    process.lines.put((came_s, line), timeout=1.0)
                return
            except (ValueError, OSError):
                return
            except queue.Full:
                continue

    def results(self, wait_s: float = 0.0) -> Iterator[MarkedPiece | WorkerNote]:
        """Yield returned packets; let another process take over if this one died or hangs."""
        self._look_after_standby()
        if self._process is None:
            if time.monotonic() < self._again_s:
                return
            self._process = MarkingProcess(self._arguments)
            self._process.send(time.monotonic(), "resume", self._clock, None)
        why = ""
        try:
            while self._process.results.poll(wait_s):
                wait_s = 0.0
                found = self._process.results.recv()
                if found == "alive":
                    self._answered_s = time.monotonic()
                    continue
                if isinstance(found, str):
                    self.ready = self.was_ready = self._process.ready = True
                    self.ended = found == "ended"
                    continue
                self._failures = 0
                yield self._noted(found)
            if not self._process.process.is_alive() and not self.ended:
                raise EOFError
            if self._hangs():
                why = "gives no sign of life"
        except (EOFError, OSError):
            why = f"ended ({self._process.process.exitcode})"
        if why:
            yield from self._replace(why)

    def _noted(self, found: MarkedPiece | WorkerNote) -> MarkedPiece | WorkerNote:
        if isinstance(found, WorkerNote):
            self._clock = found.clock or self._clock
        else:
            end = found.pes.end if isinstance(found.pes, MarkedPes) else found.pes.first
            self._until = found.epoch, end
        return found

    def _hangs(self) -> bool:
        """Whether the process that marks gives no sign of life, though there is another one."""
        if self._answered_s is None or not self.stands_by or self.ended:
            return False
        assert self._process is not None
        now_s = time.monotonic()
        return (
            now_s - self._answered_s > _HUNG_S and now_s - self._process.started_s > _HUNG_AGAIN_S
        )

    def _replace(self, why: str) -> Iterator[WorkerNote]:
        """Let the process that stands by take over, or start one later."""
        assert self._process is not None
        self._process.close()
        self._process = None
        self._answered_s = None
        self.ready = False
        self.restarts += 1
        if self.ended:
            return
        if self._standby is not None and self._standby.ready:
            self._process, self._standby = self._standby, None
            self.ready = True
            self.takeovers += 1
            self._resume(self._process)
            yield WorkerNote(f"the marking process {why}: the one that stood by takes over")
            return
        if self._standby is not None:  # it is loading: sooner there than a new one
            self._process, self._standby = self._standby, None
            self._process.send(time.monotonic(), "resume", self._clock, None)
            yield WorkerNote(f"the marking process {why}: the next one is loading")
            return
        wait_s = _RESTART_S[min(self._failures, len(_RESTART_S) - 1)]
        self._failures += 1
        self._again_s = time.monotonic() + wait_s
        yield WorkerNote(f"the marking process {why}: again in {wait_s:.0f} s")

    def _resume(self, process: MarkingProcess) -> None:
        """Give a process the sound that is not marked yet, and the captions meanwhile."""
        epoch, until = self._until or (0, None)
        process.send(time.monotonic(), "resume", self._clock, until)
        for sent_s, message in self._sent:
            passed = message[0] == "sound" and message[1] < epoch
            passed |= message[0] == "pcm" and until is not None and message[2] < until
            if not passed:
                process.send(sent_s, *message)

    def _look_after_standby(self) -> None:
        """Keep a process in reserve, loaded while the other one works."""
        if not self._keeps_s or self.ended:
            return
        if self._standby is None:
            if self.ready and self._failures == 0:
                self._standby = MarkingProcess(self._arguments)
            return
        try:
            while self._standby.results.poll(0):
                self._standby.ready |= self._standby.results.recv() == "ready"
            dead = not self._standby.process.is_alive()
        except (EOFError, OSError):
            dead = True
        if dead:
            self._standby.close()
            self._standby = None

    def close(self) -> None:
        """End the processes."""
        for one in (self._process, self._standby):
            if one is not None:
                one.close()
        self._process = self._standby = None
        self.ready = False
