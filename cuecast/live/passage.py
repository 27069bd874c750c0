"""The programme between in and out: work that follows from a record of the input alone.

A second playout that does the same work on the same record holds the same packets in the same
state (`cuecast.live.succession`). Times are those of the record.
"""

import pickle
import struct
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol

from cuecast.live.aligner import Aligner
from cuecast.live.figures import HELP
from cuecast.live.lines import Arrival, arrival_of
from cuecast.live.multiplex import Multiplex
from cuecast.live.pcm import PcmPassage
from cuecast.live.worker import FOUND, PROCESSES, MarkedPiece, Worker, WorkerNote

DATAGRAM, TAKEN, CAPTION, GIVEN = b"d", b"t", b"c", b"g"
"""Kinds of records beside the worker's: a datagram came; some were taken; a line of live text;
packets left."""

_COUNT, _TIME = struct.Struct("<I"), struct.Struct("<d")


class Target(Protocol):
    """Takes packets that leave."""

    def send(self, data: bytes) -> None:
        """Take whole packets."""


class Passage:
    """Packets on their way.

    Parameters
    ----------
    multiplex : Multiplex or PcmPassage
    worker : Worker
    output : Target
    paced : bool
        Whether packets come and leave at their own pace.

    Attributes
    ----------
    figures : dict of str to float
    record : callable
        Takes the kind and the content of a record, for a playout that stands by.
    last : bytes
        Record of the last datagram.
    arrived : deque of Arrival
        Datagrams that wait to be taken, where this repeats the work of another playout.
    """

    def __init__(
        self, multiplex: Multiplex | PcmPassage, worker: Worker, output: Target, *, paced: bool
    ) -> None:
        self.multiplex, self.worker, self.output = multiplex, worker, output
        self.paced = paced
        self.aligner = Aligner()
        self.figures = dict.fromkeys(HELP, 0.0)
        self.record: Callable[[bytes, bytes], object] = lambda kind, data: None
        self.last = b""
        self.arrived: deque[Arrival] = deque()
        worker.log = self._log

    def _log(self, kind: bytes, content: Any) -> None:
        self.record(kind, pickle.dumps(content))

    def take(self, arrivals: Sequence[Arrival]) -> None:
        """Take arrivals."""
        if not arrivals:
            return
        self.record(TAKEN, _COUNT.pack(len(arrivals)))
        for arrived_s, data in arrivals:
            packets = data if isinstance(self.multiplex, PcmPassage) else self.aligner.process(data)
            if packets:
                self.multiplex.take(packets, arrived_s)

    def put(self, found: MarkedPiece | WorkerNote) -> None:
        """Take a piece or a note of the marking process."""
        if isinstance(found, WorkerNote):
            self.figures |= found.figures
        else:
            self.multiplex.put(found.epoch, found.pes)  # type: ignore[arg-type]

    def caption(self, line: bytes) -> None:
        """Take a line of live text."""
        self.record(CAPTION, line)
        self.worker.send("caption", line)

    def give(self, now_s: float) -> None:
        """Let the packets go that are due."""
        due_s = self.multiplex.held_s
        if due_s <= now_s:
            self.record(GIVEN, _TIME.pack(now_s))
        for data in self.multiplex.give(now_s):
            self.output.send(data)
            self.figures["bytes_out_total"] += len(data)
            self.figures["late_seconds"] = max(0.0, now_s - due_s) if self.paced else 0.0

    def state(self, waiting: Iterable[Arrival], last: bytes, sent: int) -> bytes:
        """Return the state, for `set_state` of another one.

        `waiting` are datagrams that were not taken yet, `last` is the record of the last one, and
        `sent` the number of those that left.
        """
        return pickle.dumps(
            (self.multiplex, self.aligner, self.figures, self.worker.state, list(waiting), last,
             sent)
        )  # fmt: skip

    def set_state(self, state: bytes) -> int:
        """Take the state of another one; return the number of datagrams that left."""
        self.multiplex, self.aligner, self.figures, self.worker.state, waiting, last, sent = (
            pickle.loads(state)
        )
        self.multiplex.tie(
            send=self.worker.send, tell=lambda line: None, wait=lambda: False, watch=None
        )
        self.arrived, self.last = deque(waiting), last
        return int(sent)

    def replay(self, kind: bytes, data: bytes) -> None:
        """Do the work that a record of another one stands for."""
        if kind == DATAGRAM:
            self.last = data
            self.arrived.append(arrival_of(data))
        elif kind == TAKEN:
            self.take([self.arrived.popleft() for _ in range(_COUNT.unpack(data)[0])])
        elif kind == FOUND:
            serial, number, found = pickle.loads(data)
            self.worker.state.note(serial, number, found)
            self.put(found)
        elif kind == PROCESSES:
            self.worker.state.set_processes(pickle.loads(data))
        elif kind == CAPTION:
            self.caption(data)
        elif kind == GIVEN:
            self.give(_TIME.unpack(data)[0])
