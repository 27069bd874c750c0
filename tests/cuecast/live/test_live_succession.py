"""A second playout goes on where one dies: nothing of the programme is lost or sent twice."""

import itertools
import os
import random
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cuecast.live.channel import Channel, pair
from cuecast.live.lines import Input, datagrams
from cuecast.live.multiplex import Multiplex
from cuecast.live.options import LiveOptions, MarkedPes
from cuecast.live.packets import write_pes
from cuecast.live.passage import DATAGRAM, Passage
from cuecast.live.ring import Ring
from cuecast.live.succession import ShadowOutput
from cuecast.live.worker import Cuer, MarkedPiece, Worker, WorkerState
from tests.bench.hour_on_air import Service, free_port, others, paced, packets_of, write_stream


def test_counters_of_the_ring_never_go_back_for_the_other_process() -> None:
    ring = Ring()
    beats = (
        f"from cuecast.live.ring import Ring; one = Ring({ring.file})\nfor _ in range(100_000):\n"
    )
    code = [sys.executable, "-c", beats + "    one.beat()"]
    last, back = 0, 0
    with subprocess.Popen(code, pass_fds=[ring.file]) as child:
        while last < 100_000 and (child.poll() is None or ring.pulse > last):
            last, before = ring.pulse, last
            back += last < before
    ring.close()
    assert last == 100_000
    assert not back


def test_messages_arrive_whole_and_once() -> None:
    ours, theirs = pair()
    one, other = Channel(ours), Channel(theirs)
    messages = [os.urandom(n) for n in (10, 32_768, 100_000)]
    for number, message in enumerate(messages, 1):
        one.post(number, message)
        one.post(number, message)  # whoever goes on repeats what may have arrived
    assert list(other.receive(0.0)) == messages
    over = threading.Event()

    def mark() -> None:
        for message in messages:
            other.send(message)
        while not over.is_set():
            list(other.receive(0.1))

    thread = threading.Thread(target=mark)
    thread.start()
    assert list(itertools.islice(one.receive(5.0), 1)) == messages[:1]
    ours.recv(100_000)  # one that is killed takes a part of a message with it
    heir = Channel(socket.socket(fileno=os.dup(ours.fileno())))
    heir.taken = one.taken
    heir.ask_again()
    one.close()
    deadline, found = time.monotonic() + 20, list[bytes]()
    while len(found) < 2 and time.monotonic() < deadline:
        found += list(heir.receive(0.1))
    assert found == messages[1:]
    over.set()
    thread.join(60.0)
    assert not thread.is_alive()
    heir.close()
    with pytest.raises(EOFError):
        list(other.receive(1.0))
    other.close()


def test_records_go_round() -> None:
    ring = Ring()
    rng, sent, came = random.Random(1), 0, 0
    for _ in range(40):
        records = [(b"d", rng.randbytes(rng.randrange(1 << 20))) for _ in range(3)]
        assert all(ring.write(*one) for one in records)
        assert list(Ring(os.dup(ring.file)).read()) == records
    while ring.write(b"d", bytes(1 << 20)):
        sent += 1
    assert 10 < sent < 17
    came = sum(1 for _ in ring.read())
    assert came == sent
    ring.close()


class Kept:
    """Takes packets that leave."""

    def __init__(self) -> None:
        self.data, self.sent = bytearray(), 0

    def send(self, data: bytes) -> None:
        self.data += data
        self.sent += len(datagrams(data))


def test_one_that_follows_holds_the_same(tmp_path: Path) -> None:
    """It repeats the work of the other one, and sends from where that one stopped."""
    data = write_stream(tmp_path, 3)
    ring, kept, after = Ring(), Kept(), Kept()
    options = LiveOptions("standard", 0, -0.43, delay_s=0.5)

    def passage(output: object) -> Passage:
        worker = Worker(Cuer(), options, 1.0, standby=True, state=WorkerState())
        made = Passage(Multiplex(0.5, worker.send), worker, output, paced=True)  # type: ignore[arg-type]
        return made

    active, heir, seen = passage(kept), passage(Kept()), 0
    size = 7 * 188
    for n, at in enumerate(range(0, len(data), size)):
        now_s, piece = 0.03 * n, data[at : at + size]
        if n == 15:
            assert heir.set_state(active.state([], b"", kept.sent)) == kept.sent
            heir.output = ShadowOutput(ring, kept.sent)
            active.record = ring.write
        active.record(DATAGRAM, struct.pack("=dB", now_s, 0) + piece)
        active.take([(now_s, piece)])
        state = active.worker.state
        for _, epoch, _, pes in [m for number, _, m in state.sent if number > seen]:
            marked = write_pes(0xC0, pes.pts, b"\xff" + b"".join(pes.parts))
            found = MarkedPiece(epoch, MarkedPes(pes.pts, pes.pts + 2160, marked))
            active.worker.log(b"f", (1, n, found))
            active.put(found)
        seen = state.number
        active.give(now_s)
        if n == 35:  # from here on it has not sent, although it meant to
            ring.sent, cut = kept.sent, len(kept.data)
        if n == 45:
            break
    for kind, record in ring.read():
        heir.replay(kind, record)
    assert isinstance(heir.output, ShadowOutput)
    for one in heir.output.rest():
        after.send(one)
    assert after.data == kept.data[cut:]
    assert heir.worker.state.number == active.worker.state.number
    heir.output = after
    heir.multiplex.tie(send=lambda *message: None)
    active.give(1e9)
    heir.give(1e9)
    assert after.data == kept.data[cut:]
    ring.close()


_BEGIN_S = 1.5
"""Unmarked sound at a programme's beginning: up to its tables, and a superframe's."""


@contextmanager
def on_air(folder: Path, *more: str) -> Iterator[tuple[Service, int, Input]]:
    source, target = free_port(), free_port()
    back = Input(f"udp://127.0.0.1:{target}")
    service = Service(source, target, folder, list(more))
    try:
        while not service.figures()["successor_stands_by"]:
            time.sleep(0.5)
        yield service, source, back
    finally:
        service.end()
        back.close()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_killed_playout_loses_nothing(tmp_path: Path, number: signal.Signals) -> None:
    """Killed twice at random times: the one that took over has a successor, too."""
    pieces = paced(write_stream(tmp_path, 60))
    rng, came = random.Random(), []
    kills = [rng.uniform(12, 20), rng.uniform(42, 46)] if number == signal.SIGKILL else [15.0]
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with line, on_air(tmp_path) as (service, source, back):
        begun_s, sent = time.monotonic(), []
        for due, data in pieces:
            while time.monotonic() < begun_s + due:
                came += back.take(max(0.0, begun_s + due - time.monotonic()))
            if kills and due >= kills[0]:
                os.kill(service.active(), number)
                kills.pop(0)
            line.sendto(data, ("127.0.0.1", source))
            sent.append((due, data))
        until = time.monotonic() + 8
        while time.monotonic() < until:
            came += back.take(0.1)
        figures = service.figures()
    assert [p for _, p in others(came)] == [p for _, p in others(sent)]
    assert figures["successions_total"] == (2 if number == signal.SIGKILL else 1)
    # Before the first superframe, and at each takeover.
    assert figures["bypass_seconds_total"] <= _BEGIN_S + figures["successions_total"] * 1.0
    assert len(packets_of(came)) >= len(packets_of(sent))
