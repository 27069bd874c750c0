"""Live reception that goes on, whatever came in or failed; causes are counted and shown."""

import threading
import time
from collections.abc import Callable
from io import BytesIO
from typing import Any

import pytest

from codec.cuer.voice import load_voice
from codec.errors import CueError
from receiver.live.broadcast import Broadcast, Happening
from receiver.live.line import DatagramLine
from receiver.reception.engine import Receiver
from receiver.reception.events import MotionPiece
from receiver.television.metrics import Metrics
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.live.test_line import free_port
from tests.receiver.standin import make_motion

VOICE = load_voice()
PACKET = 188


@pytest.fixture(scope="module")
def stream() -> bytes:
    return transport_stream(marked_noise(VOICE, make_motion(VOICE, duration_s=16.0), 8))


def crc32_mpeg(data: bytes | bytearray) -> int:
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte << 24
        for _ in range(8):
            register = (register << 1 ^ (0x104C11DB7 if register & 0x80000000 else 0)) & 0xFFFFFFFF
    return register


def of_data_only(stream: bytes) -> bytes:
    """The tables of a stream, which name data only, and packets that hold nothing."""
    packets = [bytearray(stream[at : at + PACKET]) for at in range(0, len(stream), PACKET)]
    for packet in packets:
        section = packet[5 : 8 + (packet[6] & 0x0F) * 256 + packet[7]]
        if (packet[1] & 0x1F) * 256 + packet[2] >= 0x100:
            packet[1], packet[2] = 0x1F, 0xFF
        elif packet[1] & 0x40 and packet[4] == 0 and section[0] == 0x02:
            at = 12 + (section[10] & 0x0F) * 256 + section[11]
            while at < len(section) - 4:
                section[at] = 0x86  # SCTE 35: where advertisements are
                at += 5 + (section[at + 3] & 0x0F) * 256 + section[at + 4]
            section[-4:] = crc32_mpeg(section[:-4]).to_bytes(4, "big")
            packet[5 : 5 + len(section)] = section
    return b"".join(packets)


class Breaking(BytesIO):
    """A pipe that fails at a place, once."""

    def __init__(self, data: bytes, at: int) -> None:
        super().__init__(data)
        self._at = at

    def read1(self, size: int | None = -1, /) -> bytes:
        left = self._at - self.tell()
        if left == 0:
            self._at = -1
            raise OSError("no route")
        return super().read1(size if left < 0 else min(size or -1, left))


def received(broadcast: Broadcast, happenings: list[Happening], enough: Callable[[], bool]) -> None:
    thread = threading.Thread(target=broadcast.run)
    thread.start()
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and thread.is_alive() and not enough():
        time.sleep(0.05)
    alive = thread.is_alive()
    broadcast.stop()
    thread.join(20)
    assert alive
    assert not thread.is_alive()


def motion(happenings: list[Happening]) -> int:
    return sum(isinstance(h, MotionPiece) and bool(h.layers) for h in happenings)


def test_a_stream_that_names_data_only_is_opened_again(stream: bytes) -> None:
    data = of_data_only(stream)
    happenings: list[Happening] = []
    pipe = Breaking(data + stream, len(data))
    broadcast = Broadcast(pipe, VOICE, happenings.append, format="mpegts")
    received(broadcast, happenings, lambda: motion(happenings) >= 8)
    assert motion(happenings) >= 8
    assert broadcast.metrics.document()["failures"]


@pytest.mark.parametrize("cause", [CueError, RuntimeError, MemoryError, IndexError])
def test_an_error_of_any_kind_costs_a_moment(
    cause: type[Exception], stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    sound, blocks = Receiver.process, 0

    def process(self: Receiver, block: Any) -> Any:
        nonlocal blocks
        blocks += 1
        if blocks in (40, 60):
            raise cause("a fault of our own")
        return sound(self, block)

    monkeypatch.setattr(Receiver, "process", process)
    happenings: list[Happening] = []
    broadcast = Broadcast(BytesIO(stream), VOICE, happenings.append, format="mpegts")
    received(broadcast, happenings, lambda: motion(happenings) >= 5)
    assert motion(happenings) >= 5
    figures = broadcast.metrics.document()
    assert figures["failures"][cause.__name__] == 2
    assert (
        f'cuecast_failures_total{{cause="{cause.__name__}"}} 2.0' in broadcast.metrics.prometheus()
    )


def test_what_failed_last_is_shown() -> None:
    metrics = Metrics()
    for number in range(100):
        metrics.fail(type(f"Cause{number}", (Exception,), {})("x" * 1000))
    figures = metrics.document()
    assert len(figures["failures"]) == 33
    assert sum(figures["failures"].values()) == 100
    assert figures["last_failure"].startswith("Cause99: xxx")
    assert len(figures["last_failure"]) == 300


def test_a_socket_that_fails_is_opened_again() -> None:
    causes: list[Exception] = []
    line = DatagramLine(f"udp://127.0.0.1:{free_port()}", on_failure=causes.append)
    try:
        first = line._socket
        first.close()
        deadline = time.monotonic() + 10
        while time.monotonic() < deadline and line._socket is first:
            time.sleep(0.05)
        assert line._socket is not first
        assert [type(cause) for cause in causes] == [OSError]
    finally:
        line.stop()
