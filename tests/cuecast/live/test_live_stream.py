"""Running transport streams: what is not the sound stays bit for bit, the sound stays in step."""

import functools
import itertools
import os
import random
import signal
import time
from collections import deque
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from cuecast.demo.content import FS, make_sound
from cuecast.live.aligner import Aligner
from cuecast.live.frames import FrameCutter, framed
from cuecast.live.marked_sound import MarkedSound
from cuecast.live.multiplex import Multiplex
from cuecast.live.options import LiveOptions, MarkedPes
from cuecast.live.packets import (
    PERIOD,
    Pes,
    PesReader,
    packed,
    pid_of,
    read_stamp,
    room,
    step,
    write_pes,
    write_stamp,
)
from cuecast.live.sound import SoundMarker
from cuecast.live.text import LiveMotion
from cuecast.live.worker import Cuer, MarkedPiece, Worker
from cuecast.media.tables import NULL_PID, PACKET
from synth.planning.scoring.text_score import Reading
from watermark.audio.receiver import AudioReceiver

ENCODERS = {
    "mp2": ("mp2", 192_000),
    "aac": ("aac", 128_000),
    "latm": ("aac", 96_000),
    "ac3": ("ac3", 256_000),
    "eac3": ("eac3", 192_000),
}


@functools.cache
def programme() -> NDArray[np.float32]:
    """Sound in stereo, shape (n, 2)."""
    sound: NDArray[np.float32] = make_sound()[0]
    return sound


def coded(kind: str, sound: NDArray[np.float32], fs: int = FS) -> list[tuple[int, bytes]]:
    """FFmpeg's packets of a sound, shape (n, 2), and the number of their first sample."""
    name, rate = ENCODERS[kind]
    coder: Any = av.CodecContext.create(name, "w")
    coder.sample_rate, coder.layout, coder.bit_rate = fs, "stereo", rate
    coder.format = "s16" if kind == "mp2" else "fltp"
    coder.open()
    out = []
    for start in range(0, len(sound) - coder.frame_size + 1, coder.frame_size):
        part = sound[start : start + coder.frame_size]
        plain: NDArray[Any] = np.ascontiguousarray(part.T)
        if kind == "mp2":
            plain = np.round(part * 32767).astype(np.int16).reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(plain, coder.format.name, "stereo")
        frame.sample_rate, frame.pts, frame.time_base = fs, start, Fraction(1, fs)
        out += [(p.pts, bytes(p)) for p in coder.encode(frame)]
    return out


@pytest.mark.parametrize("kind", ENCODERS)
def test_frames_of_ffmpeg_are_cut_and_made(kind: str) -> None:
    sound = programme()[:FS]
    stream = [framed(kind, data, FS, 2) for _, data in coded(kind, sound)]
    whole = b"".join(stream)
    rng = random.Random(1)
    cutter, found, at = FrameCutter(kind), [], 0
    while at < len(whole):
        size = rng.randint(1, 900)
        found += [frame.data for frame, _ in cutter.process(whole[at : at + size])]
        at += size
    assert found == stream
    decoder: Any = av.CodecContext.create({"latm": "aac_latm"}.get(kind, kind), "r")
    samples = sum(f.samples for data in found for f in decoder.decode(av.Packet(data)))
    assert samples >= len(sound) - 2 * 1536


@pytest.mark.parametrize("kind", ENCODERS)
def test_cutter_finds_frames_again_behind_damage(kind: str) -> None:
    stream = [framed(kind, data, FS, 2) for _, data in coded(kind, programme()[: FS // 2])]
    junk = random.Random(2).randbytes(500)
    found = [f.data for f, _ in FrameCutter(kind).process(junk + b"".join(stream))]
    assert found[-len(stream) + 1 :] == stream[1:]


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


def transport_stream(path: Path, seconds: int = 4) -> bytes:
    """A stream of FFmpeg's: picture, MPEG audio, a second sound, empty packets."""
    sound = programme()[: seconds * FS]
    with av.open(str(path), "w", format="mpegts", options={"muxrate": "900000"}) as out:
        picture: Any = out.add_stream("mpeg2video", rate=25)
        picture.width = picture.height = 64
        picture.pix_fmt = "yuv420p"
        sounds: list[Any] = [out.add_stream(name, rate=FS) for name in ("mp2", "aac")]
        for stream, rate in zip(sounds, (192_000, 96_000), strict=True):
            stream.layout, stream.bit_rate = "stereo", rate
        for n in range(25 * seconds):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), n, np.uint8), format="rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            out.mux(picture.encode(frame))
            part = sound[n * FS // 25 : (n + 1) * FS // 25]
            for stream in sounds:
                plain: NDArray[Any] = np.ascontiguousarray(part.T)
                if stream is sounds[0]:
                    plain = np.round(part * 32767).astype(np.int16).reshape(1, -1)
                heard = av.AudioFrame.from_ndarray(
                    plain, "s16" if stream is sounds[0] else "fltp", "stereo"
                )
                heard.sample_rate, heard.pts = FS, n * FS // 25
                heard.time_base = Fraction(1, FS)
                out.mux(stream.encode(heard))
        for stream in (picture, *sounds):
            out.mux(stream.encode(None))
    return path.read_bytes()


@pytest.fixture(scope="module")
def stream(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return transport_stream(tmp_path_factory.mktemp("air") / "a.ts")


def packets_of(data: bytes, pid: int) -> list[bytes]:
    parts = (data[at : at + PACKET] for at in range(0, len(data), PACKET))
    return [part for part in parts if pid_of(part) == pid]


SOUND_PID = 257


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


def test_packets_hold_as_many_frames_as_those_that_came() -> None:
    """Packets of one frame took up to 1.8 times the space on a line of 64 kbit/s."""
    voice = load_voice("claire")
    marker = SoundMarker(LiveMotion(voice, Reading()), voice, LiveOptions("standard", 0, -0.43))
    made: list[MarkedPes] = []
    frames = coded("mp2", programme()[: 6 * FS])
    for at in range(0, len(frames), 5):
        data = b"".join(one for _, one in frames[at : at + 5])
        for pes in _pes_of(write_pes(0xC0, frames[at][0] * 90_000 // FS, data)):
            made += list(marker.process("mp2", pes))
    made += list(marker.flush())
    lengths = [round((one.end - one.pts) * FS / 1152 / 90_000) for one in made]
    assert set(lengths[:-1]) == {5}
    assert abs(sum(lengths) - len(frames)) <= 2


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


def marked(
    kind: str, sound: NDArray[np.float32], start: int
) -> tuple[SoundMarker, list[MarkedPes]]:
    """Mark a sound, shape (n, 2), whose time stamps begin with `start`."""
    marker = SoundMarker(
        LiveMotion(load_voice("claire"), Reading()),
        load_voice("claire"),
        LiveOptions("standard", 0, -0.43, low_delay=True),
    )
    made: list[MarkedPes] = []
    reader, counter = PesReader(), itertools.count()
    for number, data in coded(kind, sound):
        pts = (start + number * 90_000 // FS) % PERIOD
        pes = write_pes(0xC0, pts, framed(kind, data, FS, 2))
        payloads = [pes[at : at + 184] for at in range(0, len(pes), 184)]
        for n, payload in enumerate(payloads):
            packet = packed(SOUND_PID, next(counter) & 15, payload, starts=n == 0)
            for one in reader.process(packet):
                made += marker.process(kind, one)
    return marker, [*made, *marker.flush()]


@pytest.mark.parametrize("silent_s", [0, 5])
def test_a_line_that_begins_silent_keeps_its_rate(silent_s: int) -> None:
    """FFmpeg makes 4 kbit/s of digital silence; a run's coder is opened in its first seconds."""
    sound = np.concatenate([np.zeros((silent_s * FS, 2), np.float32), programme()[: 6 * FS]])
    _, made = marked("aac", sound, 0)
    loud = [one for one in made if one.pts > (silent_s + 1) * 90_000]
    bits = 8 * sum(len(one.data) for one in loud)
    assert 100_000 < bits * 90_000 / (loud[-1].end - loud[0].pts) < 145_000


@pytest.mark.parametrize("kind", ["mp2", "aac"])
def test_marked_sound_is_in_step_and_carries(kind: str) -> None:
    sound = programme()[: 6 * FS]
    start = PERIOD - 3 * 90_000  # the stamps begin anew on the way
    marker, made = marked(kind, sound, start)
    times, heard = decoded(kind, made)
    offset = round(step(times[0], start) * FS / 90_000)
    n = min(len(sound) - offset, len(heard)) - FS
    a = sound[FS + offset : n, 0].astype(float)
    best = max(range(-60, 61), key=lambda d: float(a @ heard[FS + d : FS + d + len(a), 0]))
    assert abs(best) <= 4  # 0.1 ms
    assert all(step(b, a) > 0 for a, b in itertools.pairwise(times))
    receiver = AudioReceiver(FS, 2)
    found = [*receiver.process(heard.astype(np.float32)), *receiver.flush()]
    assert sum(one.l0 is not None for one in found) >= 7
    assert marker.superframes >= 8


def packets_of_sound(sound: NDArray[np.float32], start: int) -> list[Pes]:
    return [
        pes
        for number, data in coded("mp2", sound)
        for pes in _pes_of(
            write_pes(0xC0, start + number * 90_000 // FS, framed("mp2", data, FS, 2))
        )
    ]


def _pes_of(data: bytes) -> list[Pes]:
    reader = PesReader()
    parts = [data[at : at + 184] for at in range(0, len(data), 184)]
    found = [
        pes
        for n, part in enumerate(parts)
        for pes in reader.process(packed(SOUND_PID, n & 15, part, starts=n == 0))
    ]
    return [*found, *reader.flush()]


@pytest.mark.parametrize("change", ["another process", "no rehearsal"])
def test_marking_goes_on_on_the_same_grid(change: str) -> None:
    """Whoever receives stays in step: at most the superframe of the joint is lost."""
    options = LiveOptions("standard", 0, -0.43, low_delay=True)
    voice = load_voice("claire")
    one, other = (SoundMarker(LiveMotion(voice, Reading()), voice, options) for _ in range(2))
    packets = packets_of_sound(programme()[: 11 * FS], 900_000)
    half = next(n for n, pes in enumerate(packets) if (pes.pts or 0) > 900_000 + 6.1 * 90_000)
    made = [m for pes in packets[:half] for m in one.process("mp2", pes)]
    rest = packets[half:]
    if change == "another process":
        assert one.clock is not None
        other.resume(one.clock, made[-1].end)
        first = next(n for n, pes in enumerate(packets) if (pes.pts or 0) > made[-1].end)
        one, rest = other, packets[first - 3 :]
    else:
        one.rehearsed = False
    made += [m for pes in rest for m in one.process("mp2", pes)]
    made += one.flush()
    assert 0.0 < one.joint_s < 0.64
    assert all(abs(step(b.pts, a.end)) < 90_000 * 0.025 for a, b in itertools.pairwise(made))
    _, heard = decoded("mp2", made)
    receiver = AudioReceiver(FS, 2)
    found = [*receiver.process(heard.astype(np.float32)), *receiver.flush()]
    places = [f.position_s / 0.64 for f in found if f.l0 is not None]
    apart = np.diff(places)
    np.testing.assert_allclose(apart, np.round(apart), atol=0.02)  # a frame of the joint
    assert round(places[-1] - places[0]) + 1 - len(places) <= 1
    assert len(places) >= 13


@pytest.mark.slow
def test_a_killed_process_costs_less_than_a_second() -> None:
    """The one that stands by goes on where the marked sound ends, whatever was on its way."""
    options = LiveOptions("standard", 0, -0.43, delay_s=600.0)
    worker = Worker(Cuer(), options, None, standby=True)
    made: list[MarkedPes] = []

    def take(until: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 300
        while not until():
            assert time.monotonic() < deadline
            found = worker.results(0.1)
            made.extend(one.pes for one in found if isinstance(one, MarkedPiece))  # type: ignore[misc]

    try:
        take(lambda: worker.stands_by)
        packets = packets_of_sound(programme()[: 16 * FS], 900_000)
        for pes in packets[: len(packets) // 2]:
            worker.send("sound", 1, "mp2", pes)
        take(lambda: bool(made))
        marking = worker._process
        assert marking is not None
        os.kill(marking.pid, signal.SIGKILL)
        take(lambda: worker.state.takeovers == 1)
        for pes in packets[len(packets) // 2 :]:
            worker.send("sound", 1, "mp2", pes)
        worker.send("end")
        take(lambda: worker.ended)
    finally:
        worker.close()
    assert all(abs(step(b.pts, a.end)) < 90_000 * 0.025 for a, b in itertools.pairwise(made))
    _, heard = decoded("mp2", made)
    receiver = AudioReceiver(FS, 2)
    found = [*receiver.process(heard.astype(np.float32)), *receiver.flush()]
    places = [one.position_s / 0.64 for one in found if one.l0 is not None]
    assert round(places[-1] - places[0]) + 1 - len(places) <= 1
    assert len(places) >= 22


def decoded(kind: str, made: list[MarkedPes]) -> tuple[list[int], NDArray[np.float64]]:
    decoder: Any = av.CodecContext.create(kind, "r")
    cutter = FrameCutter(kind)
    parts = []
    for pes in made:
        for frame, _ in cutter.process(pes.data[14:]):
            for one in decoder.decode(av.Packet(frame.data)):
                x = one.to_ndarray().astype(float)
                parts.append(x.T if one.format.is_planar else x.reshape(-1, 2))
    sound = np.concatenate(parts)
    return [pes.pts % PERIOD for pes in made], sound / (32768 if np.abs(sound).max() > 4 else 1)
