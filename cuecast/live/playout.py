"""The playout: a running programme in, the same programme with its cuer out, always.

It takes packets, lets them wait a constant time, and sends them on. The marking happens in another
process (`cuecast.live.worker`); when that is late or dead, the sound passes as it is.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from cuecast.command.files import PIPE
from cuecast.live.lines import Input, Output
from cuecast.live.multiplex import Aligner, Multiplex
from cuecast.live.pcm import PcmForm, PcmPassage
from cuecast.live.sound import LiveOptions
from cuecast.live.worker import Cuer, Told, Worker

DELAY_S, LOW_DELAY_S = 5.0, 2.5
"""From in to out: the embedder's own delay (2.7 s, 1.4 s low), coding, and time to compute."""

INTERPRETER_S = 1.0
"""What a live interpreter needs: her capture, her line, and the time to tell a key."""

COMPUTING_S = 1.2
"""What is left at least beside all waits, for coding and for a machine that is busy."""

_LOOP_S = 0.005
"""Seconds that the loop waits for arrivals at a time."""

_SILENT_S = 2.0
"""Seconds without arrivals after which the input counts as lost."""

_PATIENCE_S = 120.0
"""How long a pipe waits for the marking process before the programme passes as it is."""

_HELP = {
    "packets_total": ("counter", "Packets of the transport stream that came in."),
    "packets_lost_total": ("counter", "Holes in the counter of the sound's packets."),
    "garbage_bytes_total": ("counter", "Bytes that were no packets."),
    "datagrams_dropped_total": ("counter", "Datagrams that the playout was too slow for."),
    "bytes_out_total": ("counter", "Bytes that went out."),
    "marked_seconds_total": ("counter", "Sound that went out marked."),
    "bypass_seconds_total": ("counter", "Sound that went out as it was."),
    "bypasses_total": ("counter", "Changes from marked sound to bypass."),
    "stale_packets_total": ("counter", "Marked packets that came too late."),
    "restarts_total": ("counter", "Starts of the marking process after its end."),
    "input_losses_total": ("counter", "Times that nothing came in for two seconds."),
    "superframes_total": ("counter", "Superframes that were written."),
    "damaged_frames_total": ("counter", "Frames of the sound that could not be decoded."),
    "captions_total": ("counter", "Pieces of live text that are cued."),
    "captions_left_out_total": ("counter", "Pieces of live text that came too late."),
    "cuer_lag_seconds": ("gauge", "How far the cuer is behind the live text."),
    "poses_total": ("counter", "Frames of a live interpreter that came."),
    "keys_recognised_total": ("counter", "Keys that a live interpreter showed."),
    "delay_seconds": ("gauge", "From in to out, as stated."),
    "late_seconds": ("gauge", "How much later than due the last packet went out."),
    "marking": ("gauge", "1 while the sound that goes out is marked."),
    "held_bytes": ("gauge", "Bytes that wait for their time."),
}  # fmt: skip


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
        Told what happens, a line each.

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
        self, route: Route, cuer: Cuer, options: LiveOptions, tell: Callable[[str], None]
    ) -> None:
        self._tell = tell
        self.delay_s = LOW_DELAY_S if options.low_delay else DELAY_S
        hold_s = 0.0
        if cuer.motion == PIPE:
            hold_s = options.ahead_s + INTERPRETER_S + options.seen_s
            self.delay_s = max(self.delay_s, options.embedder_s + hold_s + COMPUTING_S)
        self._input, self._output = Input(route.source), Output(route.target)
        self._stop = threading.Event()
        self._figures = dict.fromkeys(_HELP, 0.0)
        paced = self._input.paced
        patience_s = max(0.5, self.delay_s - hold_s - options.embedder_s) if paced else None
        if options.on_air_s is None and not paced:
            options = replace(options, on_air_s=time.time())
        options = replace(options, delay_s=self.delay_s)
        self._worker = Worker(cuer, options, patience_s, hold_s)
        self._aligner = Aligner()
        common: dict[str, Any] = {
            "tell": tell, "wait": (lambda: False) if paced else self._wait, "by_stream": not paced,
        }  # fmt: skip
        self._multiplex: Multiplex | PcmPassage
        if route.form is not None:
            self._multiplex = PcmPassage(route.form, self.delay_s, self._worker.send, **common)
        else:
            self._multiplex = Multiplex(
                self.delay_s, self._worker.send, track=route.track, programme=route.programme,
                **common,
            )  # fmt: skip
        self._plain = route.form is not None
        self._figures["delay_seconds"] = self.delay_s

    def stop(self) -> None:
        """Ask `run` to take in nothing more and to send what it has."""
        self._stop.set()

    @property
    def marking(self) -> bool:
        """Whether the sound that goes out is marked."""
        return self._multiplex.marking

    def caption(self, line: bytes) -> None:
        """Take a line of live text, from any thread."""
        self._worker.send("caption", line)

    def interpret(self, line: bytes | None) -> None:
        """Take a line of a live interpreter, None at their end, from a thread of their own."""
        self._worker.interpret(line)

    def run(self) -> None:
        """Pass the programme on until it ends or `stop` is called.

        Raises
        ------
        CueError
            If the output ended.
        """
        if self._input.paced:
            self._tell(f"delay {self.delay_s:g} s")
        else:
            self._tell(f"delay {self.delay_s:g} s of the stream's own clock")
        heard_s, silent = time.monotonic(), False
        try:
            while not (self._stop.is_set() or self._input.over):
                arrivals = self._input.take(_LOOP_S)
                now_s = time.monotonic()
                for arrived_s, data in arrivals:
                    self._take(data, arrived_s)
                if arrivals:
                    heard_s = now_s
                    if silent:
                        self._tell("input: back")
                elif not silent and now_s - heard_s > _SILENT_S:
                    self._figures["input_losses_total"] += 1
                    self._tell("input: nothing comes")
                silent = not arrivals and now_s - heard_s > _SILENT_S
                self._collect()
                self._give(now_s)
            self._finish()
        finally:
            self._worker.close()
            self._input.close()
            self._output.close()

    def _take(self, data: bytes, arrived_s: float) -> None:
        packets = data if self._plain else self._aligner.process(data)
        if packets:
            self._multiplex.take(packets, arrived_s)

    def _give(self, now_s: float) -> None:
        due_s = self._multiplex.held_s
        for data in self._multiplex.give(now_s):
            self._output.send(data)
            self._figures["bytes_out_total"] += len(data)
            if self._input.paced:
                self._figures["late_seconds"] = max(0.0, now_s - due_s)

    def _collect(self, wait_s: float = 0.0) -> None:
        """Take what the marking process has ready."""
        for found in self._worker.results(wait_s):
            if isinstance(found, Told):
                if found.line:
                    self._tell(found.line)
                self._figures |= found.figures
            else:
                self._multiplex.put(found.epoch, found.pes)  # type: ignore[arg-type]

    def _wait(self) -> bool:
        """Wait for the marking process; tell whether it is still worth while."""
        until_s = time.monotonic() + _PATIENCE_S
        before = self._multiplex.marks
        while self._worker.alive and not self._worker.ended and time.monotonic() < until_s:
            self._collect(0.1)
            if self._multiplex.marks != before:
                return True
        return False

    def _finish(self) -> None:
        """Send what is held: at its time where there is one, else as it gets ready."""
        self._multiplex.end()
        self._worker.send("end")
        while self._input.paced and self._multiplex.held_s < float("inf"):
            now_s = time.monotonic()
            self._collect(_LOOP_S)
            self._give(now_s)
        for data in self._multiplex.rest():
            self._output.send(data)
        self._tell("the programme has ended")

    def prometheus(self) -> str:
        """Return the figures in Prometheus' text format, version 0.0.4."""
        figures = self._figures | self._multiplex.figures
        figures |= {
            "garbage_bytes_total": self._aligner.dropped,
            "datagrams_dropped_total": self._input.dropped,
            "restarts_total": self._worker.restarts,
            "marking": self._multiplex.marking,
            "held_bytes": self._multiplex.held_bytes,
        }
        lines = []
        for name, (kind, text) in _HELP.items():
            lines += [f"# HELP cuecast_{name} {text}", f"# TYPE cuecast_{name} {kind}"]
            lines.append(f"cuecast_{name} {float(figures[name])!r}")
        return "\n".join(lines) + "\n"
