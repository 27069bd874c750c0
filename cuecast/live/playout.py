"""The playout: a running programme in, the same programme with its cuer out, always.

It takes packets, lets them wait a constant time, and sends them on. The marking happens in another
process (`cuecast.live.worker`); when that is late or dead, the sound passes as it is. A second
playout goes on where this one dies (`cuecast.live.succession`).
"""

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from codec.errors import CueError
from cuecast.command.files import PIPE
from cuecast.live.figures import prometheus
from cuecast.live.guard import CAPTIONS_AT_ONCE, CAPTIONS_PER_S, RateLimit
from cuecast.live.lines import Input, Output
from cuecast.live.multiplex import Multiplex
from cuecast.live.options import LiveOptions
from cuecast.live.own_reception import OwnOutput
from cuecast.live.passage import DATAGRAM, Passage
from cuecast.live.pcm import PcmForm, PcmPassage
from cuecast.live.readiness import Announcer, Condition, Observation, condition_of
from cuecast.live.succession import Inheritance, ShadowOutput, Succession
from cuecast.live.worker import PROCESSES, Cuer, Worker, WorkerNote, WorkerState
from cuecast.media.tables import PACKET

DELAY_S, LOW_DELAY_S = 5.0, 2.5
"""From in to out: the embedder's own delay (2.7 s, 1.4 s low), coding, and time to compute."""

INTERPRETER_S = 1.0
"""Delay of a live interpreter: her capture, her line, and the time to recognise a key."""

COMPUTING_S = 1.2
"""Least time left beside all waits, for coding and for a machine that is busy."""

_LOOP_S = 0.005
"""Seconds that the loop waits for arrivals at a time."""

_SILENT_S = 2.0
"""Seconds without arrivals after which the input counts as lost."""

_STOPPED = 0.3
"""Share of the delay after which a playout that stands still is ended: its sound can then still be
marked in time."""

_OBSERVED_S = 0.25
"""Seconds between two looks at the state."""

_SHOWN_CHARACTERS = 200
"""Characters of a caption in the log."""

_LOOKED_AT = 1 << 20
"""Bytes of a pipe or a file after which something else than packets is an error."""

_PATIENCE_S, _LOADING_S = 120.0, 600.0
"""Seconds without progress of the marking process, and without its being ready, after which the
programme of a pipe passes as it is until there is some."""


@dataclass(frozen=True, slots=True)
class Route:
    """Where a programme comes from and goes to, and which of its sounds is meant.

    `form` is that of plain samples; without one it is a transport stream.
    """

    source: str
    target: str
    track: int = 0
    programme: int | None = None
    form: PcmForm | None = None


class Playout:
    """One programme on its way.

    Parameters
    ----------
    route : Route
    cuer : Cuer
    options : LiveOptions
    tell : callable
        Called with events, a line each.
    standby : bool
        Whether others stand by where the input comes at its own pace: a second marking process,
        and a second playout.
    read_back : bool
        Whether a transport stream that goes out at its own pace is received again.
    argv : sequence of str
        Command line of a second playout; without one there is none.
    inheritance : Inheritance, optional
        Of the playout that this one follows first, in place of an input and output of its own.

    Attributes
    ----------
    delay_s : float
        From in to out.

    Raises
    ------
    CueError
        If the source or the target cannot be opened.
    """

    def __init__(
        self, route: Route, cuer: Cuer, options: LiveOptions, tell: Callable[[str], None],
        *, standby: bool = True, read_back: bool = True, argv: Sequence[str] = (),
        inheritance: Inheritance | None = None,
    ) -> None:  # fmt: skip
        self._tell, self._route, self._inheritance = tell, route, inheritance
        self._argv = argv if standby and cuer.motion != PIPE else ()
        self.delay_s = LOW_DELAY_S if options.low_delay else DELAY_S
        hold_s = 0.0
        if cuer.motion == PIPE:
            hold_s = options.ahead_s + INTERPRETER_S + options.seen_s
            self.delay_s = max(self.delay_s, options.embedder_s + hold_s + COMPUTING_S)
        self._output: Output | ShadowOutput
        if inheritance is None:
            self._input, self._output = Input(route.source), Output(route.target)
        else:
            self._output = ShadowOutput(inheritance.ring, 0)
        paced = self._paced = inheritance is not None or self._input.paced
        patience_s = max(0.5, self.delay_s - hold_s - options.embedder_s) if paced else None
        if options.on_air_s is None and not paced:
            options = replace(options, on_air_s=time.time())
        options = replace(options, delay_s=self.delay_s)
        self._worker = Worker(
            cuer,
            options,
            patience_s,
            hold_s,
            standby=standby and paced,
            state=None if inheritance is None else WorkerState(),
        )
        self._watch = None
        if read_back and paced and route.form is None:
            self._watch = OwnOutput(options.key, options.through, tell)
        self._passage = Passage(self._new_multiplex(), self._worker, self._output, paced=paced)
        self._passage.figures["delay_seconds"] = self.delay_s
        self._succession: Succession | None = None
        self._stop = threading.Event()
        self._announcer = Announcer(tell, time.monotonic)
        self._captions = RateLimit(CAPTIONS_PER_S, CAPTIONS_AT_ONCE, time.monotonic)
        self._lines: deque[bytes] = deque()
        self._refused_s = 0.0
        self._silent = True
        self._waiting_since_s: float | None = None
        self._observed_s = 0.0
        self._progress, self._progress_s = (0, 0), time.monotonic()
        self._ending = False
        self._known = paced or route.form is not None

    def _new_multiplex(self) -> Multiplex | PcmPassage:
        route, paced = self._route, self._paced
        common: dict[str, Any] = {
            "tell": self._tell,
            "wait": (lambda: False) if paced else self._wait,
            "by_stream": not paced,
        }
        if route.form is not None:
            return PcmPassage(route.form, self.delay_s, self._worker.send, **common)
        return Multiplex(
            self.delay_s,
            self._worker.send,
            track=route.track,
            programme=route.programme,
            watch=self._watch,
            **common,
        )

    @property
    def _multiplex(self) -> Multiplex | PcmPassage:
        return self._passage.multiplex

    def stop(self) -> None:
        """Ask `run` to take in nothing more and to send the rest."""
        self._stop.set()

    @property
    def condition(self) -> Condition:
        """State and its reason."""
        return self._announcer.condition

    @property
    def received(self) -> dict[str, float | int | bool]:
        """Superframes of the last minute, sent and read back; empty before there is one."""
        last = None if self._watch is None else self._watch.count.last
        if last is None:
            return {}
        return {"sent": last.sent, "received": last.received, "alarm": last.alarms}

    def caption(self, line: bytes, source: str) -> None:
        """Take a line of live text, from any thread; the log names its source.

        Raises
        ------
        CueError
            If captions come faster than the limit.
        """
        if not self._captions.allows():
            self.refuse(source, f"more than {CAPTIONS_PER_S:g} captions per second")
            raise CueError(f"live text: more than {CAPTIONS_PER_S:g} captions per second")
        if line.strip():
            shown = line[:_SHOWN_CHARACTERS].decode("utf-8", "replace").strip()
            self._tell(f"caption from {source}: {json.dumps(shown, ensure_ascii=False)}")
        self._lines.append(line)

    def refuse(self, source: str, why: str) -> None:
        """Count live text that is refused; log it at most once a second."""
        self._passage.figures["captions_refused_total"] += 1
        now_s = time.monotonic()
        if now_s - self._refused_s >= 1.0:
            self._refused_s = now_s
            total = int(self._passage.figures["captions_refused_total"])
            self._tell(f"caption refused from {source}: {why} ({total} refused so far)")

    def interpret(self, line: bytes | None) -> None:
        """Take a line of a live interpreter, None at their end, from a thread of their own."""
        self._worker.interpret(line)

    def follow(self) -> bool:
        """Follow the playout that this one stands by for; return whether it is to go on instead."""
        assert self._inheritance is not None
        heir, output = self._inheritance, self._output
        assert isinstance(output, ShadowOutput)
        if not heir.follow(self, _STOPPED * self.delay_s):
            return False
        passage = self._passage
        self._output = passage.output = Output(self._route.target, heir.output)
        self._output.sent = heir.ring.sent
        for data in output.rest():
            self._output.send(data)
        self._worker.adopt(heir.processes)
        self._input = Input(self._route.source, heir.input, passage.last)
        self._input.put(passage.arrived)
        self._multiplex.tie(tell=self._tell, watch=self._watch)
        passage.figures["successions_total"] += 1
        heir.close()
        self._tell("the playout ended: the one that stood by goes on")
        return True

    def set_state(self, state: bytes) -> None:
        """Take the state of the playout that this one follows."""
        assert self._inheritance is not None
        sent = self._passage.set_state(state)
        self._output = self._passage.output = ShadowOutput(self._inheritance.ring, sent)

    def replay(self, kind: bytes, data: bytes) -> None:
        """Do the work that a record of that playout stands for."""
        assert self._inheritance is not None
        self._passage.replay(kind, data)
        if kind == PROCESSES:
            state = self._worker.state
            self._inheritance.forget(state.serial, (state.marking, state.standing))

    def run(self) -> None:
        """Pass the programme on until it ends or `stop` is called.

        Raises
        ------
        CueError
            If the output ended.
        """
        by = "" if self._paced else " of the stream's own clock"
        self._tell(f"delay {self.delay_s:g} s{by}")
        heard_s, lost = time.monotonic(), False
        self._observe(heard_s)
        target = self._output.handle
        if self._argv and self._paced and target is not None:
            self._succession = Succession(self._argv, (self._input.handle, target), self._tell)
        try:
            while not (self._stop.is_set() or self._input.over):
                arrived = self._take(_LOOP_S)
                now_s = time.monotonic()
                if arrived:
                    heard_s = now_s
                    if lost:
                        self._tell("input: back")
                    self._silent = lost = False
                elif not lost and now_s - heard_s > _SILENT_S:
                    self._passage.figures["input_losses_total"] += 1
                    self._tell("input: nothing comes")
                    self._silent = lost = True
                self._collect()
                self._passage.give(now_s)
                self._keep_successor()
                if now_s - self._observed_s >= _OBSERVED_S:
                    self._observe(now_s)
            self._observe(time.monotonic())
            self._stop.set()
            self._observe(time.monotonic())
            self._finish()
        finally:
            self._end_succession()
            self._worker.close()
            if self._watch is not None:
                self._watch.close()
            self._input.close()
            self._output.close()

    def _take(self, wait_s: float) -> bool:
        """Take what has come, waiting at most that long; return whether some of the programme."""
        arrivals = self._input.take(wait_s)
        self._passage.take(arrivals)
        if not (self._known or self._stop.is_set()):
            self._look()
        while self._lines:
            self._passage.caption(self._lines.popleft())
        return bool(arrivals)

    def _look(self) -> None:
        """Look whether a pipe or a file is a transport stream.

        Raises
        ------
        CueError
            If most of its beginning is something else.
        """
        other = self._passage.aligner.dropped
        size = other + PACKET * int(self._multiplex.figures["packets_total"])
        if not (size >= _LOOKED_AT or self._input.over):
            return
        if 2 * other > size or not size:
            name = "standard input" if self._route.source == PIPE else self._route.source
            raise CueError(
                f"{name}: no transport stream of packets of {PACKET} bytes; "
                "for programmes in other files there is dub"
            )
        self._known = True

    def _keep_successor(self) -> None:
        """Keep the playout that stands by informed; start one once this can mark."""
        succession = self._succession
        if succession is None or not (self._worker.stands_by or succession.one):
            return
        if succession.one is not None:
            succession.one.processes(self._worker.processes)
            succession.one.ring.beat()
        try:
            asks = succession.look()
            if asks is None:
                return
            assert isinstance(self._output, Output)
            waiting, last = self._input.mirrored(partial(asks.write, DATAGRAM))
            self._passage.record = asks.write
            self._output.ring, asks.ring.sent = asks.ring, self._output.sent
            asks.begin(self._passage.state(waiting, last, self._output.sent))
        except (EOFError, OSError):
            self._forget_successor()
            succession.give_up()

    def _forget_successor(self) -> None:
        assert isinstance(self._output, Output)
        self._input.mirrored()
        self._passage.record = lambda kind, data: None
        self._output.ring = None

    def _end_succession(self) -> None:
        """End the playout that stands by: this one ends as it should."""
        if self._succession is not None:
            self._forget_successor()
            self._succession.close()
            self._succession = None

    def _observe(self, now_s: float) -> None:
        """Work out the state; log its changes."""
        self._observed_s = now_s
        if self._watch is not None and self._worker.ready:
            self._watch.look()
        if self._silent or not self._worker.ready:
            self._waiting_since_s = None
        elif self._waiting_since_s is None or self._multiplex.marking:
            self._waiting_since_s = now_s
        seen = Observation(
            self._stop.is_set(),
            self._silent,
            self._worker.ready,
            self._worker.state.was_ready,
            self._multiplex.marking,
            self._multiplex.audible,
            now_s - (self._waiting_since_s or now_s),
            1.5 * self.delay_s,
        )
        self._announcer.observe(condition_of(seen))

    def _collect(self, wait_s: float = 0.0) -> None:
        """Take the output of the marking process."""
        for found in self._worker.results(wait_s):
            self._passage.put(found)
            if isinstance(found, WorkerNote):
                if found.line:
                    self._tell(found.line)
                if found.clock is not None and self._watch is not None:
                    self._watch.count.clock(found.clock)

    def _wait(self) -> bool:
        """Wait for the marking process; return whether it is still worth while."""
        worker, before = self._worker, self._multiplex.marks
        while worker.alive and not worker.ended:
            self._collect(0.0 if worker.idle and not self._ending else 0.1)
            now_s, progress = time.monotonic(), (self._multiplex.marks, worker.state.done)
            if progress != self._progress:
                self._progress, self._progress_s = progress, now_s
            if progress[0] != before:
                return True
            if now_s - self._progress_s > (_PATIENCE_S if worker.ready else _LOADING_S):
                return False
            if worker.idle and not self._read_on():
                return False
        return False

    def _read_on(self) -> bool:
        """Give more to a marking process that has used up all; return whether there can be more."""
        if self._stop.is_set() or self._input.over:
            self._end()
            return True
        if not self._multiplex.can_wait:
            return False
        self._take(0.1)
        return True

    def _end(self) -> None:
        """Tell once that nothing more comes."""
        if not self._ending:
            self._ending = True
            self._multiplex.end()
            self._worker.send("end")

    def _finish(self) -> None:
        """Send held packets: at their time where there is one, else as they get ready."""
        self._end_succession()
        self._end()
        while self._paced and self._multiplex.held_s < float("inf"):
            now_s = time.monotonic()
            self._collect(_LOOP_S)
            self._passage.give(now_s)
        for data in self._multiplex.rest():
            self._output.send(data)
        self._tell("the programme has ended")

    def prometheus(self) -> str:
        """Return the figures in Prometheus' text format, version 0.0.4."""
        state = self._worker.state
        figures = self._passage.figures | self._multiplex.figures
        figures |= {
            "garbage_bytes_total": self._passage.aligner.dropped,
            "datagrams_dropped_total": self._input.dropped,
            "restarts_total": state.restarts,
            "takeovers_total": state.takeovers,
            "stands_by": self._worker.stands_by,
            "successor_stands_by": self._succession is not None and self._succession.stands_by,
            "marking": self._multiplex.marking,
            "held_bytes": self._multiplex.held_bytes,
            "state_changes_total": self._announcer.changes_total,
        }
        if self._watch is not None:
            figures |= self._watch.figures()
        return prometheus(figures, self.condition.state)
