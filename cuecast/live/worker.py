"""The playout's side of the process that marks, and of one that stands by.

The playout sends PES packets and live text, and takes marked PES packets. If the process dies, or
gives no sign of life, the one that stands by takes its place: it is given the sound that has not
gone out yet. Without one the process is started anew; meanwhile the programme
passes as it is. A playout that takes over from one that died goes on with its processes.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass, field, fields
from typing import Any

from cuecast.live.marking_process import MarkingProcess
from cuecast.live.options import LiveOptions, MarkedPes, RunClock
from cuecast.live.pcm import MarkedPcm
from synth.planning.scoring.text_score import Reading

_RESTART_S = (1.0, 2.0, 5.0, 10.0, 30.0)
"""Seconds before a worker is started again, the first times; then as the last."""

_HUNG_S = 2.0
"""Seconds without a sign of life after which a process counts as stopped; a busy one gives some."""

_HUNG_AGAIN_S = 60.0
"""Seconds after the start of a process before it can be given up for that."""

_GONE_S = 5.0
"""Longest wait in seconds, at the end, for a process to be gone."""

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


@dataclass
class WorkerState:
    """The processes and their last messages, as a playout that takes over has to know them.

    Attributes
    ----------
    marking, standing : int
        Numbers of the process that marks, and of that which stands by; 0 for none.
    standing_ready, ready, was_ready, ended : bool
        See `Worker`.
    restarts, takeovers, failures : int
    serial : int
        Number of the last process.
    number, done : int
        Of the last message, and of the last one that was worked on, where that is told.
    clock : RunClock, optional
        Of the sound under way.
    until : tuple of (int, int), optional
        Up to where the sound is marked: number of the sound, time stamp or sample.
    taken : dict of int to int
        Number of the last message taken from each process.
    sent : deque
        The last messages with their numbers and times.
    """

    marking: int = 0
    standing: int = 0
    standing_ready: bool = False
    ready: bool = False
    was_ready: bool = False
    ended: bool = False
    restarts: int = 0
    takeovers: int = 0
    failures: int = 0
    serial: int = 0
    number: int = 1
    done: int = 0
    clock: RunClock | None = None
    until: tuple[int, int] | None = None
    taken: dict[int, int] = field(default_factory=dict)
    sent: deque[tuple[int, float, tuple[Any, ...]]] = field(default_factory=deque)

    @property
    def processes(self) -> tuple[Any, ...]:
        """The values that change with the processes only."""
        return tuple(getattr(self, one.name) for one in fields(self)[:10])

    def set_processes(self, values: tuple[Any, ...]) -> None:
        """Take those values."""
        for one, value in zip(fields(self), values, strict=False):
            setattr(self, one.name, value)

    def note(self, serial: int, number: int, found: MarkedPiece | WorkerNote) -> None:
        """Note a message of a process, and its number."""
        self.taken[serial] = number
        if isinstance(found, WorkerNote):
            self.clock = found.clock or self.clock
        else:
            end = found.pes.end if isinstance(found.pes, MarkedPes) else found.pes.first
            self.until = found.epoch, end


FOUND, PROCESSES = b"f", b"s"
"""Kinds of records: a piece of marked sound or a note came; processes changed."""

Log = Callable[[bytes, Any], None]
"""Takes a kind and its content for a playout that stands by."""


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
    state : WorkerState, optional
        That of a playout which may die: then there are no processes until `adopt`.

    Attributes
    ----------
    state : WorkerState
    log : callable
        Takes records for a playout that stands by.
    """

    def __init__(
        self, cuer: Cuer, options: LiveOptions, patience_s: float | None, hold_s: float = 0.0,
        *, standby: bool = False, state: WorkerState | None = None,
    ) -> None:  # fmt: skip
        self._arguments = cuer, options, patience_s, hold_s
        self._keeps_s = options.delay_s if standby else 0.0
        self.state = state or WorkerState()
        self.log: Log = lambda kind, content: None
        self._process: MarkingProcess | None = None
        self._standby: MarkingProcess | None = None
        self._answered_s: float | None = None
        self._again_s = 0.0
        self._logged: tuple[Any, ...] = ()
        if state is None:
            self.state.marking, self._process = self._started()

    def adopt(self, found: MutableMapping[int, tuple[int, Any]]) -> None:
        """Go on with the processes of a playout that died, and take their lines."""
        state = self.state
        for serial in (state.marking, state.standing):
            if serial not in found:
                continue
            process = MarkingProcess(adopted=found.pop(serial))
            process.channel.taken = state.taken.get(serial, 0)
            process.channel.ask_again()
            if serial == state.marking:
                process.ready, self._process = state.ready, process
                for number, sent_s, message in state.sent:
                    process.post(number, sent_s, *message)
            else:
                process.ready, self._standby = state.standing_ready, process
        state.standing = state.standing if self._standby else 0
        if self._process is None:
            state.marking, state.ready = 0, False

    def _started(self) -> tuple[int, MarkingProcess]:
        self.state.serial += 1
        return self.state.serial, MarkingProcess(self._arguments)

    @property
    def processes(self) -> dict[int, MarkingProcess]:
        """The processes there are, by their numbers."""
        pairs = (self.state.marking, self._process), (self.state.standing, self._standby)
        return {serial: process for serial, process in pairs if process is not None}

    @property
    def alive(self) -> bool:
        """Whether there is a process."""
        return self._process is not None

    @property
    def ready(self) -> bool:
        """Whether the process can take sound."""
        return self.state.ready

    @property
    def idle(self) -> bool:
        """Whether it has worked on all messages; told by a process without `patience_s`."""
        return self.state.done >= self.state.number

    @property
    def ended(self) -> bool:
        """Whether it has marked all."""
        return self.state.ended

    @property
    def stands_by(self) -> bool:
        """Whether a second process could take over now."""
        return self._standby is not None and self._standby.ready

    def send(self, *message: Any) -> None:
        """Give the process a message."""
        now_s, state = time.monotonic(), self.state
        state.number += 1
        if self._keeps_s and message[0] in _KEPT_MESSAGES:
            state.sent.append((state.number, now_s, message))
            while state.sent[0][1] < now_s - self._keeps_s:
                state.sent.popleft()
        if self._process is not None:
            self._process.post(state.number, now_s, *message)

    def interpret(self, line: bytes | None) -> None:
        """Give the process a line of an interpreter, None at their end; wait while it is full."""
        came_s = time.monotonic()
        while (process := self._process) is not None and not process.interpret(came_s, line):
            continue

    def results(self, wait_s: float = 0.0) -> Iterator[MarkedPiece | WorkerNote]:
        """Yield returned packets; let another process take over if this one died or hangs."""
        self._look_after_standby()
        state = self.state
        if self._process is None:
            if time.monotonic() < self._again_s:
                return
            state.marking, self._process = self._started()
            self._process.post(state.number, time.monotonic(), "resume", state.clock, None)
        why = ""
        try:
            self._process.channel.flush()
            for found in self._process.channel.receive(wait_s):
                if found == "alive":
                    self._answered_s = time.monotonic()
                    continue
                if isinstance(found, int):
                    state.done = found
                    continue
                if isinstance(found, str):
                    state.ready = state.was_ready = self._process.ready = True
                    state.ended = found == "ended"
                    continue
                state.failures = 0
                number = self._process.channel.taken
                self.log(FOUND, (state.marking, number, found))
                state.note(state.marking, number, found)
                yield found
            if self._hangs():
                why = "gives no sign of life"
        except EOFError:
            why = "" if state.ended else self._process.ending
        if why:
            yield from self._replace(why)
        if state.processes != self._logged:
            self._logged = state.processes
            self.log(PROCESSES, self._logged)

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
        state = self.state
        self._process.close()
        self._process = None
        self._answered_s = None
        state.marking, state.ready = 0, False
        state.restarts += 1
        if self._standby is not None:
            process = self._process = self._standby
            state.marking, state.standing, self._standby = state.standing, 0, None
            state.ready, state.standing_ready = process.ready, False
            if not process.ready:  # it is loading: sooner there than a new one
                process.post(state.number, time.monotonic(), "resume", state.clock, None)
                yield WorkerNote(f"the marking process {why}: the next one is loading")
                return
            state.takeovers += 1
            self._resume(process)
            yield WorkerNote(f"the marking process {why}: the one that stood by takes over")
            return
        wait_s = _RESTART_S[min(state.failures, len(_RESTART_S) - 1)]
        state.failures += 1
        self._again_s = time.monotonic() + wait_s
        yield WorkerNote(f"the marking process {why}: again in {wait_s:.0f} s")

    def _resume(self, process: MarkingProcess) -> None:
        """Give a process the sound that is not marked yet, and the captions meanwhile."""
        state = self.state
        epoch, until = state.until or (0, None)
        before = state.sent[0][0] - 1 if state.sent else state.number
        process.post(before, time.monotonic(), "resume", state.clock, until)
        for number, sent_s, message in state.sent:
            passed = message[0] == "sound" and message[1] < epoch
            passed |= message[0] == "pcm" and until is not None and message[2] < until
            if not passed:
                process.post(number, sent_s, *message)

    def _look_after_standby(self) -> None:
        """Keep a process in reserve, loaded while the other one works."""
        state = self.state
        if not self._keeps_s or state.ended:
            return
        if self._standby is None:
            if state.ready and state.failures == 0:
                state.standing, self._standby = self._started()
            return
        try:
            self._standby.channel.flush()
            for found in self._standby.channel.receive(0.0):
                self._standby.ready |= found == "ready"
                state.taken[state.standing] = self._standby.channel.taken
                state.standing_ready = self._standby.ready
        except EOFError:
            self._standby.close()
            self._standby = None
            state.standing, state.standing_ready = 0, False

    def close(self) -> None:
        """End the processes."""
        for one in (self._process, self._standby):
            if one is not None:
                one.close(_GONE_S)
        self._process = self._standby = None
        self.state.ready = False
