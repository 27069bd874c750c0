"""The sound of a line, marked: frames as they came, in step, and the mark in it."""

import itertools
import os
import random
import signal
import time
from collections.abc import Callable
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from cuecast.demo.content import FS
from cuecast.live.frames import FrameCutter, framed
from cuecast.live.options import LiveOptions, MarkedPes
from cuecast.live.packets import PERIOD, Pes, PesReader, packed, step, write_pes
from cuecast.live.sound import SoundMarker
from cuecast.live.text import LiveMotion
from cuecast.live.worker import Cuer, MarkedPiece, Worker
from synth.planning.scoring.text_score import Reading
from tests.cuecast.live.streams import ENCODERS, SOUND_PID, coded, programme
from watermark.audio.receiver import AudioReceiver


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
