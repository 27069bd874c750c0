"""Running transport streams: all but one sound stays bit for bit, marked sound in its place."""

import itertools
import random
from collections import deque
from pathlib import Path
from typing import Any

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cuecast.demo.content import FS
from cuecast.live.aligner import Aligner
from cuecast.live.marked_sound import MarkedSound
from cuecast.live.multiplex import Multiplex
from cuecast.live.options import MarkedPes
from cuecast.live.packets import (
    PERIOD,
    PesReader,
    packed,
    pid_of,
    read_stamp,
    room,
    step,
    write_pes,
    write_stamp,
)
from cuecast.media.tables import NULL_PID, PACKET
from tests.cuecast.live.streams import SOUND_PID, packets_of, transport_stream


@given(st.integers(0, PERIOD - 1), st.integers(-(1 << 30), 1 << 30))
def test_stamps(pts: int, by: int) -> None:
    assert read_stamp(write_stamp(pts)) == pts
    assert step((pts + by) % PERIOD, pts) == by


@given(st.binary(max_size=184), st.booleans(), st.sampled_from([b"", b"\x10abcdef"]))
def test_packets_hold_what_they_are_given(data: bytes, starts: bool, fields: bytes) -> None:
    data = data[: room(fields)]
    packet = packed(0x123, 7, data, starts=starts, fields=fields)
    assert len(packet) == PACKET
    assert pid_of(packet) == 0x123
    assert packet[PACKET - len(data) :] == data
    assert bool(packet[1] & 0x40) == starts


@pytest.fixture(scope="module")
def stream(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return transport_stream(tmp_path_factory.mktemp("air") / "a.ts")


def test_pes_are_those_that_ffmpeg_reads(stream: bytes, tmp_path: Path) -> None:
    reader, found = PesReader(), b""
    for packet in packets_of(stream, SOUND_PID):
        for pes in reader.process(packet):
            found += b"".join(pes.parts)
    found += b"".join(b"".join(pes.parts) for pes in reader.flush())
    (tmp_path / "a.ts").write_bytes(stream)
    with av.open(str(tmp_path / "a.ts")) as container:
        wanted = b"".join(bytes(p) for p in container.demux(container.streams.audio[0]))
    assert found == wanted
    assert reader.lost == 0


def run(multiplex: Multiplex, data: bytes, size: int = 7 * PACKET) -> bytes:
    out = bytearray()
    for n, at in enumerate(range(0, len(data), size)):
        multiplex.take(data[at : at + size], n * 0.01)
        out += b"".join(multiplex.give(n * 0.01))
    multiplex.end()
    return bytes(out) + b"".join(multiplex.rest())


def test_without_marked_sound_everything_passes(stream: bytes) -> None:
    assert run(Multiplex(0.5, lambda *message: None), stream) == stream


def test_only_the_sound_is_exchanged(stream: bytes) -> None:
    """Other bytes for each PES, at once: all else stays, in its place."""
    sent: list[Any] = []
    multiplex = Multiplex(0.5, lambda *message: sent.append(message))
    out = bytearray()
    for n, at in enumerate(range(0, len(stream), 7 * PACKET)):
        multiplex.take(stream[at : at + 7 * PACKET], n * 0.01)
        for _, epoch, kind, pes in sent:
            assert kind == "mp2"
            data = b"".join(pes.parts)
            marked = write_pes(0xC0, pes.pts, bytes(byte ^ 0xFF for byte in data))
            multiplex.put(epoch, MarkedPes(pes.pts, pes.pts + 12_960, marked))
        sent.clear()
        out += b"".join(multiplex.give(n * 0.01))
    made = bytes(out) + b"".join(multiplex.rest())
    assert len(made) == len(stream)
    exchanged = 0
    for at in range(0, len(stream), PACKET):
        before, after = stream[at : at + PACKET], made[at : at + PACKET]
        if pid_of(before) not in (SOUND_PID, NULL_PID):
            assert before == after
        exchanged += before != after
    assert exchanged > 0.9 * len(packets_of(stream, SOUND_PID))
    reader, found = PesReader(), []
    for packet in packets_of(made, SOUND_PID):
        found += list(reader.process(packet))
    assert reader.lost == 0
    stamps = [pes.pts for pes in found if pes.pts is not None]
    assert stamps == sorted(stamps)
    assert multiplex.figures["marked_seconds_total"] > 3


def test_late_sound_is_bypassed_and_comes_back(stream: bytes) -> None:
    sent: list[Any] = []
    marking = [False]
    multiplex = Multiplex(0.2, lambda *message: sent.append(message))
    for at in range(0, len(stream), 7 * PACKET):
        now_s = at / len(stream) * 4
        multiplex.take(stream[at : at + 7 * PACKET], now_s)
        for _, epoch, _, pes in sent:
            if not 1.5 < now_s < 2.5:  # the marking process is away
                data = write_pes(0xC0, pes.pts, b"\xff" + b"".join(pes.parts))
                multiplex.put(epoch, MarkedPes(pes.pts, pes.pts + 12_960, data))
        sent.clear()
        for _ in multiplex.give(now_s):
            if multiplex.marking != marking[-1]:
                marking.append(multiplex.marking)
    assert marking == [False, True, False, True]
    assert multiplex.figures["bypasses_total"] == 1
    assert 0.5 < multiplex.figures["bypass_seconds_total"] < 2


def test_a_hole_in_the_marked_sound_is_bypassed(stream: bytes) -> None:
    """Later marked sound is there already: what lies before it goes out as it is, not at all."""
    sent: list[Any] = []
    multiplex = Multiplex(2.0, lambda *message: sent.append(message))
    out, start = bytearray(), None
    for at in range(0, len(stream), 7 * PACKET):
        now_s = at / len(stream) * 4
        multiplex.take(stream[at : at + 7 * PACKET], now_s)
        for _, epoch, _, pes in sent:
            start = pes.pts if start is None else start
            if not 90_000 < step(pes.pts, start) < 135_000:  # passed over by a busy process
                data = write_pes(0xC0, pes.pts, b"\xff" + b"".join(pes.parts))
                multiplex.put(epoch, MarkedPes(pes.pts, pes.pts + 12_960, data))
        sent.clear()
        out += b"".join(multiplex.give(now_s))
    out += b"".join(multiplex.rest())
    reader, stamps = PesReader(), []
    for packet in packets_of(bytes(out), SOUND_PID):
        stamps += [pes.pts for pes in reader.process(packet) if pes.pts is not None]
    lengths = [step(b, a) for a, b in itertools.pairwise(stamps)]
    assert max(lengths) <= 2 * 12_960
    assert 0.2 < multiplex.figures["bypass_seconds_total"] < 1.0
    assert multiplex.figures["bypasses_total"] == 1


def test_marked_sound_covers_a_packet_without_a_hole() -> None:
    """Sound that ends within a long packet was taken for all of it: a quarter of a second fell out.

    On the way back to the programme's own sound the rest of the marked one goes out first.
    """
    sound, frame = MarkedSound(), 1920
    for n in (*range(100, 112), *range(130, 200)):
        sound.put(1, MarkedPes(n * frame, (n + 1) * frame, write_pes(0xC0, n * frame, b"x" * 300)))
    assert sound.covers(1, 104 * frame, 4 * frame, follows=False)
    assert not sound.covers(1, 109 * frame, 4 * frame, follows=False)
    assert not sound.covers(1, 120 * frame, 4 * frame, follows=False)
    assert not sound.covers(2, 104 * frame, 4 * frame, follows=False)
    sound.begin(1, 104 * frame, None)
    sound.next(104 * frame)
    assert sound.until == 105 * frame
    assert sound.covers(1, 108 * frame, 4 * frame, follows=True)
    assert not sound.covers(1, 109 * frame, 4 * frame, follows=True)
    reader, rest = PesReader(), sound.rest(112 * frame)
    packets = [rest[at : at + PACKET] for at in range(0, len(rest), PACKET)]
    found = [one for packet in packets for one in reader.process(packet)]
    assert [one.pts for one in found] == [n * frame for n in range(105, 112)]
    assert sound.until == 112 * frame
    assert sound.covers(1, 130 * frame, 9 * frame, follows=False)


def test_short_packets_leave_evenly_in_place_of_long_ones(stream: bytes) -> None:
    """Packets of one frame in place of one with a quarter of a second: some came too late."""
    sent: list[Any] = []
    multiplex = Multiplex(1.0, lambda *message: sent.append(message))
    out, put, frame = bytearray(), [], 1152 * 90_000 // FS
    for at in range(0, len(stream), 7 * PACKET):
        now_s = at / len(stream) * 4
        multiplex.take(stream[at : at + 7 * PACKET], now_s)
        for _, epoch, _, pes in sent:
            data = b"".join(pes.parts)
            for n in range(len(data) // 576):
                put.append(pes.pts + n * frame)
                one = write_pes(0xC0, put[-1], data[576 * n : 576 * (n + 1)])
                multiplex.put(epoch, MarkedPes(put[-1], put[-1] + frame, one))
        sent.clear()
        out += b"".join(multiplex.give(now_s))
    out += b"".join(multiplex.rest())
    reader, found = PesReader(), []
    for packet in packets_of(bytes(out), SOUND_PID):
        found += list(reader.process(packet))
    assert put == [pes.pts for pes in (*found, *reader.flush())][: len(put)]
    assert multiplex.figures["stale_packets_total"] == 0


def shifted(stream: bytes, ticks: int) -> bytes:
    """Return the stream with the time stamps of its sound moved, and its clock away."""
    out = bytearray(stream)
    for at in range(0, len(out), PACKET):
        if out[at + 3] & 0x20 and out[at + 4]:
            out[at + 5] &= ~0x10 & 0xFF
        packet = bytes(out[at : at + PACKET])
        if pid_of(packet) == SOUND_PID and packet[1] & 0x40:
            stamp = at + packet.index(b"\x00\x00\x01") + 9
            moved = (read_stamp(bytes(out[stamp : stamp + 5])) + ticks) % (1 << 33)
            out[stamp : stamp + 5] = write_stamp(moved)
    return bytes(out)


@pytest.mark.parametrize("early", [False, True])
@pytest.mark.parametrize("ticks", [0, -300_000, 2_000_000, 1 << 32])
def test_the_sound_goes_on_where_the_clock_jumps(stream: bytes, ticks: int, early: bool) -> None:
    """Marked sound that comes late, or early, and longer: none is left out or sent too early."""
    sent: deque[Any] = deque()

    def mark() -> bool:
        if len(sent) <= 3:
            return False
        _, epoch, _, pes = sent.popleft()
        data = write_pes(0xC0, pes.pts, b"\xff" * 200 + b"".join(pes.parts))
        multiplex.put(epoch, MarkedPes(pes.pts, pes.pts + 12_960, data))
        return True

    multiplex = Multiplex(0.5, lambda *message: sent.append(message), wait=mark, by_stream=True)
    out, made, held = bytearray(), shifted(stream, 0) + shifted(stream, ticks), []
    for at in range(0, len(made), 7 * PACKET):
        multiplex.take(made[at : at + 7 * PACKET], 0.0)
        while early and mark():
            pass
        out += b"".join(multiplex.give(0.0))
        held.append(multiplex.held_bytes)
    multiplex.end()
    sent.extend([()] * 3)
    while mark():
        pass
    out += b"".join(multiplex.rest())
    assert max(held) < 0.4 * len(stream)
    stamps = []
    for data in (made, bytes(out)):
        reader, found = PesReader(), []
        for packet in packets_of(data, SOUND_PID):
            found += list(reader.process(packet))
        stamps.append([one.pts for one in (*found, *reader.flush())])
    assert reader.lost == 0  # in the output: its packets are numbered through
    assert stamps[0] == stamps[1]
    assert multiplex.figures["bypass_seconds_total"] == 0


def test_a_clock_that_always_jumps_costs_no_memory(stream: bytes) -> None:
    told: list[str] = []
    multiplex = Multiplex(0.5, lambda *message: None, by_stream=True, tell=told.append)
    parts = [shifted(stream[: 400 * PACKET], 0 if n % 2 else 2_000_000) for n in range(30)]
    out = bytearray()
    for part in parts:
        multiplex.take(part, 0.0)
        out += b"".join(multiplex.give(0.0))
    assert bytes(out) + b"".join(multiplex.rest()) == b"".join(parts)
    assert len(told) == 2
    assert len(multiplex._kinds) < 20


def test_what_cannot_go_out_is_not_kept(stream: bytes) -> None:
    """Packets of a sound that never begins, and marked sound behind that of a former number."""
    multiplex = Multiplex(0.5, lambda *message: None)
    multiplex.take(stream, 0.0)
    part = packed(SOUND_PID, 0, bytes(184), starts=False)
    for n in range(20):
        multiplex.take(100 * part, 1.0 + n)
        for _ in multiplex.give(1.0 + n):
            pass
    assert len(multiplex._under_way) <= 512
    sound = MarkedSound()
    for n in range(100):
        sound.put(1 if n < 5 else 2, MarkedPes(n * 1920, (n + 1) * 1920, b"x"))
    sound.forget(2, 10_000_000, keeps=1)
    assert len(sound._waiting) == 100
    sound.forget(2, 10_000_000)
    assert not sound._waiting


def test_a_clock_that_stands_still_holds_no_more_than_the_limit(
    stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cuecast.live.multiplex.MOST_HELD", 50_000)
    multiplex = Multiplex(0.5, lambda *message: None, by_stream=True, programme=9)
    out = bytearray()
    for at in range(0, len(stream), 7 * PACKET):
        multiplex.take(stream[at : at + 7 * PACKET], 0.0)
        out += b"".join(multiplex.give(0.0))
        assert multiplex.held_bytes <= 50_000
    assert bytes(out) + b"".join(multiplex.rest()) == stream


def test_lost_packets_leave_a_hole_in_the_pes(stream: bytes) -> None:
    packets = packets_of(stream, SOUND_PID)
    del packets[next(n for n, p in enumerate(packets) if n > 20 and not p[1] & 0x40)]
    reader, found = PesReader(), []
    for packet in packets:
        found += list(reader.process(packet))
    assert reader.lost == 1
    assert sum(len(pes.parts) == 2 for pes in found) == 1


def test_garbage_between_packets_is_passed_over(stream: bytes) -> None:
    rng = random.Random(4)
    data = stream[: 50 * PACKET] + rng.randbytes(1001) + stream[50 * PACKET : 100 * PACKET]
    aligner, out, at = Aligner(), b"", 0
    while at < len(data):
        size = rng.randint(1, 2000)
        out += aligner.process(data[at : at + size])
        at += size
    assert stream[: 49 * PACKET] == out[: 49 * PACKET]
    assert stream[52 * PACKET : 99 * PACKET] in out


def test_a_sound_on_another_pid_is_followed(stream: bytes) -> None:
    """The map changes: the sound that was second is the only one."""
    sent: list[Any] = []
    multiplex = Multiplex(0.1, lambda *message: sent.append(message), track=1)
    run(multiplex, stream)
    assert {kind for _, _, kind, _ in sent} == {"aac"}
    assert {epoch for _, epoch, _, _ in sent} == {1}


@pytest.mark.parametrize(
    ("track", "programme", "line"),
    [(1, None, "programme 1: sound aac on PID 258"),
     (1, 1, "programme 1: sound aac on PID 258"),
     (2, None, "programme 1: sound mp2 on PID 257 (there is no sound 2)"),
     (0, 7, "programme 1 (there is no 7): sound mp2 on PID 257")],
)  # fmt: skip
def test_another_sound_than_the_one_asked_for_is_said(
    stream: bytes, track: int, programme: int | None, line: str
) -> None:
    told: list[str] = []
    multiplex = Multiplex(
        0.1, lambda *message: None, track=track, programme=programme, tell=told.append
    )
    run(multiplex, stream)
    assert told == [line]
