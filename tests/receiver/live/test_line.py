"""Lines that outlive what comes on them: datagrams, pipes, programmes that change their form."""

import os
import socket
import threading
from io import BytesIO

import av
import pytest

from codec.cuer.voice import load_voice
from codec.errors import CueError
from receiver.live import line
from receiver.live.broadcast import Broadcast, Happening
from receiver.live.line import DatagramLine, Pipe
from receiver.reception.events import MotionPiece
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.standin import make_motion
from tests.receiver.transmitter import Transmitter

pytestmark = pytest.mark.long(12)

SECONDS = 10
FAST = 3


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def at_other_addresses(data: bytes, *, service: bool = True) -> bytes:
    """The same packets under other identifiers, as another service or the same one."""
    file = BytesIO()
    options = {"mpegts_start_pid": "1024"}
    if service:
        options |= {"mpegts_pmt_start_pid": "1280", "mpegts_service_id": "7"}
    with av.open(BytesIO(data), "r") as old, av.open(file, "w", "mpegts", options=options) as new:
        streams = {stream.index: new.add_stream_from_template(stream) for stream in old.streams}
        for packet in old.demux():
            if packet.dts is not None:
                packet.stream = streams[packet.stream.index]
                new.mux(packet)
    return file.getvalue()


def test_a_programme_at_other_addresses_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when a tuner is set to another channel: no packet of the old streams comes any more."""
    monkeypatch.setattr(line, "PATIENCE_S", line.PATIENCE_S / FAST)
    voice = load_voice()
    sound = marked_noise(voice, make_motion(voice, SECONDS + 4.0), SECONDS)
    first, second = transport_stream(sound), transport_stream(sound, codec="mp2")
    port, happenings = free_port(), list[Happening]()
    broadcast = Broadcast(f"udp://127.0.0.1:{port}", voice, happenings.append)
    thread = threading.Thread(target=broadcast.run)
    thread.start()

    def found_again() -> bool:
        starts = [h.start_s for h in happenings if isinstance(h, MotionPiece) and h.layers]
        return max(starts, default=0.0) > SECONDS + 1

    try:
        for _ in range(6):  # a busy machine begins late to listen
            transmitter = Transmitter(first, port, SECONDS / FAST)
            transmitter.start()
            transmitter.join()
            if broadcast.metrics.document()["connections_total"] >= 1:
                break
        for _ in range(6):  # and lags behind
            transmitter = Transmitter(at_other_addresses(second), port, SECONDS / FAST)
            transmitter.start()
            transmitter.join()
            if found_again():
                break
    finally:
        broadcast.stop()
        thread.join(20)
    assert not thread.is_alive()
    assert found_again()
    assert broadcast.metrics.document()["connections_total"] >= 2


@pytest.mark.parametrize(
    "url",
    ["udp://", "udp://127.0.0.1", "udp://127.0.0.1:0", "udp://127.0.0.1:99999",
     "udp://no.such.host.invalid:5004", "udp://203.0.113.9:5004", "udp://[::1:5004",
     "udp://239.1.2.3:5004?localaddr=nowhere"],
)  # fmt: skip
def test_addresses_that_cannot_be_listened_to(url: str) -> None:
    with pytest.raises(CueError, match="cannot be listened to"):
        DatagramLine(url)


def test_a_port_in_use_is_told() -> None:
    port = free_port()
    first = DatagramLine(f"udp://127.0.0.1:{port}")
    with pytest.raises(CueError, match="cannot be listened to"):
        DatagramLine(f"udp://127.0.0.1:{port}")
    first.stop()


def test_datagrams_come_in_pieces_of_any_size() -> None:
    port = free_port()
    source = DatagramLine(f"udp://@:{port}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for part in (b"first", b"second"):
            sender.sendto(part, ("127.0.0.1", port))
    assert [source.read(3), source.read(99), source.read(99)] == [b"fir", b"st", b"second"]
    source.stop()
    assert source.read(1) == b""


def test_who_waits_is_woken_at_the_end() -> None:
    source = DatagramLine(f"udp://127.0.0.1:{free_port()}")
    found: list[bytes] = []
    reader = threading.Thread(target=lambda: found.append(source.read(100)))
    reader.start()
    source.stop()
    reader.join(5)
    assert not reader.is_alive()
    assert found == [b""]


def test_silence_pretends_to_be_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(line, "READ_TIMEOUT_S", 0.05)
    port = free_port()
    source = DatagramLine(f"udp://127.0.0.1:{port}")
    assert source.read(10) == b""
    assert not source.over
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"again", ("127.0.0.1", port))
    monkeypatch.setattr(line, "READ_TIMEOUT_S", 5.0)
    assert source.read(10) == b"again"
    source.stop()


def test_a_pipe_gives_what_it_has() -> None:
    """It does not wait until a block is full: that would be a second of a thin stream."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as file, os.fdopen(writing, "wb", buffering=0) as other:
        source = Pipe(file)
        other.write(b"little")
        assert source.read(32768) == b"little"
        other.close()
        assert source.read(32768) == b""
        assert source.over


def test_a_pipe_of_no_use_pretends_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(line, "PATIENCE_S", 0.0)
    source = Pipe(BytesIO(bytes(3 * line.PATIENCE_BYTES)))
    assert source.read(line.PATIENCE_BYTES + 1)
    source.useful()
    assert source.read(line.PATIENCE_BYTES + 1)
    assert source.read(1) == b""
    assert not source.over
    source.connect()
    assert source.read(1) == b"\0"
