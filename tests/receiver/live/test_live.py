"""Live reception: clocks that wrap and jump, transport streams with losses, fragments, figures."""

import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path

import av
import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from codec.cues.score import Key
from codec.errors import CueError
from receiver.live.broadcast import Broadcast, Happening, MediaFragment, MediaStart
from receiver.live.continuity import STAMP_PERIOD_S, SteadyClock
from receiver.reception.events import KeysFound, MotionPiece, StateChanged
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.reception.test_faults import TOLERANCE_S
from tests.receiver.seeded import seeded_speech, was_sent
from tests.receiver.standin import make_motion

pytestmark = pytest.mark.long(22)

VOICE = load_voice()
MOTION = replace(make_motion(VOICE, duration_s=16.0), score=seeded_speech(14.0))
SECONDS = 10
PACKET = 188


@cache
def sound(seconds: int = SECONDS) -> NDArray[np.float32]:
    return marked_noise(VOICE, MOTION, seconds)


def stream(codec: str = "aac", fps: int = 25, start_s: float = 0.0) -> bytes:
    return _stream(codec, fps, start_s)


@cache
def _stream(codec: str, fps: int, start_s: float) -> bytes:
    return transport_stream(sound(), codec=codec, fps=fps, start_s=start_s)


@cache
def received(codec: str) -> tuple[Broadcast, list[Happening]]:
    """The plain stream, received once for all who look at what came of it."""
    return receive(stream(codec))


def receive(data: bytes, form: str = "mpegts") -> tuple[Broadcast, list[Happening]]:
    happenings: list[Happening] = []
    broadcast = Broadcast(BytesIO(data), VOICE, happenings.append, format=form, once=True)
    broadcast.run()
    return broadcast, happenings


def pictures_of(media: bytes) -> Iterator[av.VideoFrame]:
    with av.open(BytesIO(media), "r") as container:
        yield from container.decode(video=0)


def motion_starts(happenings: list[Happening]) -> list[float]:
    return sorted(
        {round(h.start_s, 2) for h in happenings if isinstance(h, MotionPiece) and h.layers}
    )


def wrong_keys(happenings: list[Happening]) -> list[Key]:
    """Final keys that were never sent, or not then; where the programme began is what most say."""
    assert MOTION.score is not None
    sent = MOTION.score.keys
    final = [key for h in happenings if isinstance(h, KeysFound) and h.final for key in h.keys]
    assert len(final) > 5
    zeros = Counter(
        round(key.start - other.start, 1)
        for key in final
        for other in sent
        if (key.shape, key.placement) == (other.shape, other.placement)
    )
    zero_s = zeros.most_common(1)[0][0]
    return [key for key in final if not was_sent(key, sent, [zero_s], TOLERANCE_S)]


@pytest.mark.parametrize("codec", ["aac", "mp2"])
def test_everything_arrives_from_a_transport_stream(codec: str) -> None:
    broadcast, happenings = received(codec)
    figures = broadcast.metrics.document()
    assert figures["superframes_received_total"] >= 14
    assert figures["superframes_lost_total"] == 0
    assert wrong_keys(happenings) == []
    starts = motion_starts(happenings)
    assert np.allclose(np.diff(starts), 0.64, atol=0.011)
    states = [h.state for h in happenings if isinstance(h, StateChanged)]
    assert states == ["locked", "ended"]


@pytest.mark.parametrize("fps", [25, 50])
def test_cuer_is_due_with_the_picture(fps: int) -> None:
    """Time zero is the first time stamp on the line; motion lies within 20 ms of its time."""
    _, happenings = received("aac") if fps == 25 else receive(stream("aac", fps))
    media = b"".join(h.data for h in happenings if isinstance(h, MediaStart | MediaFragment))
    picture_zero_s = next(pictures_of(media)).time
    assert picture_zero_s is not None
    offsets = [(s - picture_zero_s) % 0.64 for s in motion_starts(happenings)]
    offsets = [min(o, 0.64 - o) for o in offsets]
    assert max(offsets) < 0.020


def test_fragments_play_from_each_picture_that_needs_no_other() -> None:
    _, happenings = received("aac")
    start = next(h for h in happenings if isinstance(h, MediaStart))
    fragments = [h.data for h in happenings if isinstance(h, MediaFragment)]
    assert start.mime == 'video/mp4; codecs="avc1.640028, mp4a.40.2"'
    assert len(fragments) >= 18
    assert len(list(pictures_of(start.data + b"".join(fragments)))) == 25 * SECONDS
    assert next(pictures_of(start.data + fragments[7])).key_frame


def bar_at(frame: av.VideoFrame) -> int:
    line = frame.to_ndarray(format="rgb24")[90, :, 0].astype(int)
    return int(np.argmax(line > 110)) if (line > 110).any() else -1


@pytest.mark.parametrize("interlaced", [False, True])
def test_mpeg2_is_recoded_in_step(interlaced: bool) -> None:
    """Browsers cannot play it: they get H.264 at the same times, and are told."""
    data = transport_stream(sound(4), picture_codec="mpeg2video", interlaced=interlaced)
    _, happenings = receive(data)
    start = next(h for h in happenings if isinstance(h, MediaStart))
    assert (start.recoded, start.unseen) == ("mpeg2video", "")
    assert start.mime.startswith('video/mp4; codecs="avc1.')
    media = start.data + b"".join(h.data for h in happenings if isinstance(h, MediaFragment))
    shown = list(pictures_of(media))
    assert len(shown) >= 90
    with av.open(BytesIO(data), "r") as container:
        zero_s = next(container.decode(video=0)).time or 0.0
    sound_s = min(h.start_s for h in happenings if isinstance(h, MotionPiece)) % 0.64
    numbers = np.array([bar_at(frame) // 2 for frame in shown])
    times = np.array([frame.time for frame in shown], dtype=float)
    assert (numbers >= 0).mean() > 0.95
    lag_s = np.median(times - numbers / 25)
    assert abs((sound_s - lag_s + 0.32) % 0.64 - 0.32) < 0.025, (zero_s, lag_s, sound_s)


def test_a_picture_that_nothing_plays_is_told() -> None:
    data = transport_stream(sound(3), picture_codec="ffv1", container="matroska")
    _, happenings = receive(data, "matroska")
    start = next(h for h in happenings if isinstance(h, MediaStart))
    assert (start.unseen, start.recoded) == ("ffv1", "")
    assert start.mime == 'video/mp4; codecs="mp4a.40.2"'


def test_time_stamps_that_wrap_are_not_noticed() -> None:
    _, plain = received("aac")
    broadcast, wrapped = receive(stream(start_s=STAMP_PERIOD_S - 5.0))
    assert broadcast.metrics.document()["splices_total"] == 0
    assert broadcast.metrics.document()["superframes_lost_total"] == 0
    assert len(motion_starts(wrapped)) == len(motion_starts(plain))


def test_a_splice_goes_on_with_the_new_programme() -> None:
    data = stream()
    half = len(data) // 2 // PACKET * PACKET
    late = stream(start_s=4000.0)
    broadcast, happenings = receive(data[:half] + late[half:])
    figures = broadcast.metrics.document()
    assert figures["splices_total"] >= 1
    assert figures["superframes_received_total"] >= 9
    starts = motion_starts(happenings)
    assert starts == sorted(starts)
    assert starts[-1] < 20.0


@pytest.mark.parametrize(
    "order", [("aac", "mp2"), pytest.param(("mp2", "aac"), marks=pytest.mark.slow)]
)
def test_the_sound_goes_on_in_another_codec(order: tuple[str, str]) -> None:
    """At the same address, as at the border of two programmes; found within two seconds."""
    first, second = (stream(codec, start_s=30.0 * i) for i, codec in enumerate(order))
    broadcast, happenings = receive(first + second)
    figures = broadcast.metrics.document()
    assert figures["connections_total"] == 1
    assert figures["superframes_received_total"] >= 23
    starts = motion_starts(happenings)
    assert any(start > 18.0 for start in starts)


def damaged(data: bytes, share: float, seed: int) -> bytes:
    """Leave out transport packets at random, a datagram of seven at a time."""
    rng = np.random.default_rng(seed)
    size = 7 * PACKET
    parts = [data[at : at + size] for at in range(0, len(data), size)]
    return b"".join(p for i, p in enumerate(parts) if i < 3 or rng.random() > share)


def test_one_packet_in_a_hundred_lost() -> None:
    broadcast, happenings = receive(damaged(stream(), 0.01, 1))
    figures = broadcast.metrics.document()
    assert figures["superframes_received_total"] >= 9
    assert wrong_keys(happenings) == []


def test_a_hole_of_five_seconds_is_told_and_over_soon() -> None:
    data = stream()
    part = len(data) // 4 // PACKET * PACKET
    broadcast, happenings = receive(data[:part] + data[part + len(data) * 5 // 10 :])
    states = [(h.state, h.time_s) for h in happenings if isinstance(h, StateChanged)]
    names = [state for state, _ in states]
    assert names[0] == "locked"
    assert names[-2:] in (["locked", "ended"], ["degraded", "ended"])
    assert broadcast.metrics.document()["holes_total"] >= 1
    starts = motion_starts(happenings)
    assert starts[-1] > 9.0
    assert wrong_keys(happenings) == []


class Stumbling(BytesIO):
    """A pipe that fails once, after half of what it has."""

    failed = False

    def read1(self, size: int | None = -1, /) -> bytes:
        if not self.failed and self.tell() > len(self.getbuffer()) // 2:
            self.failed = True
            raise OSError("no route")
        return super().read1(size)


def test_a_line_that_fails_is_opened_again_and_told_found() -> None:
    happenings: list[Happening] = []
    broadcast = Broadcast(Stumbling(stream()), VOICE, happenings.append, format="mpegts", once=True)
    broadcast.run()
    figures = broadcast.metrics.document()
    assert figures["connections_total"] == 2
    assert figures["superframes_received_total"] >= 13
    states = [h.state for h in happenings if isinstance(h, StateChanged)]
    assert "lost" in states
    assert states[states.index("lost") + 1 :] in (
        ["locked", "ended"],
        ["degraded", "locked", "ended"],
    )


def test_joining_in_the_middle() -> None:
    data = stream()
    broadcast, happenings = receive(data[len(data) * 3 // 10 // PACKET * PACKET + 5 * PACKET :])
    assert broadcast.metrics.document()["superframes_received_total"] >= 8
    assert wrong_keys(happenings) == []


def test_hls_playlist(tmp_path: Path) -> None:
    data = stream()
    lines = ["#EXTM3U", "#EXT-X-VERSION:3", "#EXT-X-TARGETDURATION:4", "#EXT-X-MEDIA-SEQUENCE:0"]
    size = (len(data) // 3 // PACKET + 1) * PACKET
    for number, at in enumerate(range(0, len(data), size)):
        (tmp_path / f"{number}.ts").write_bytes(data[at : at + size])
        lines += ["#EXTINF:3.34,", f"{number}.ts"]
    (tmp_path / "live.m3u8").write_text("\n".join([*lines, "#EXT-X-ENDLIST", ""]))
    happenings: list[Happening] = []
    broadcast = Broadcast(str(tmp_path / "live.m3u8"), VOICE, happenings.append, once=True)
    broadcast.run()
    assert broadcast.metrics.document()["superframes_received_total"] >= 14
    assert broadcast.metrics.document()["superframes_lost_total"] == 0


def test_hls_with_a_discontinuity(tmp_path: Path) -> None:
    """Two programmes in one playlist, each with its own clock."""
    lines = ["#EXTM3U", "#EXT-X-VERSION:3", "#EXT-X-TARGETDURATION:10"]
    for number, start_s in enumerate((0.0, 4000.0)):
        (tmp_path / f"{number}.ts").write_bytes(stream(start_s=start_s))
        lines += ["#EXTINF:10.0,", f"{number}.ts", "#EXT-X-DISCONTINUITY"]
    (tmp_path / "two.m3u8").write_text("\n".join([*lines[:-1], "#EXT-X-ENDLIST", ""]))
    happenings: list[Happening] = []
    broadcast = Broadcast(str(tmp_path / "two.m3u8"), VOICE, happenings.append, once=True)
    broadcast.run()
    figures = broadcast.metrics.document()
    assert figures["superframes_received_total"] >= 27
    assert motion_starts(happenings)[-1] > 18.0


def test_hls_window_that_slides(tmp_path: Path) -> None:
    """A live playlist of three pieces: the oldest leaves when the next one comes."""
    data = stream()
    size = (len(data) // 10 // PACKET + 1) * PACKET
    pieces = [data[at : at + size] for at in range(0, len(data), size)][:7]

    def publish(last: int, end: bool) -> None:
        first = max(0, last - 2)
        lines = ["#EXTM3U", "#EXT-X-VERSION:3", "#EXT-X-TARGETDURATION:1"]
        lines.append(f"#EXT-X-MEDIA-SEQUENCE:{first}")
        for number in range(first, last + 1):
            (tmp_path / f"{number}.ts").write_bytes(pieces[number])
            lines += ["#EXTINF:1.0,", f"{number}.ts"]
        text = "\n".join([*lines, *(["#EXT-X-ENDLIST"] if end else []), ""])
        (tmp_path / "new").write_text(text)
        (tmp_path / "new").replace(tmp_path / "live.m3u8")

    publish(2, end=False)
    happenings: list[Happening] = []
    broadcast = Broadcast(str(tmp_path / "live.m3u8"), VOICE, happenings.append, once=True)
    thread = threading.Thread(target=broadcast.run)
    thread.start()
    for last in range(3, len(pieces)):
        time.sleep(0.9)
        publish(last, end=last == len(pieces) - 1)
    thread.join(20)
    assert not thread.is_alive()
    assert broadcast.metrics.document()["superframes_received_total"] >= 8


def test_sound_alone_through_a_pipe() -> None:
    pipe = BytesIO()
    soundfile.write(pipe, sound(), 48000, format="WAV")
    happenings: list[Happening] = []
    pipe.seek(0)
    broadcast = Broadcast(pipe, VOICE, happenings.append, format="wav", once=True)
    broadcast.run()
    assert broadcast.metrics.document()["superframes_received_total"] >= 14
    start = next(h for h in happenings if isinstance(h, MediaStart))
    assert start.mime == 'video/mp4; codecs="mp4a.40.2"'
    fragments = [h.data for h in happenings if isinstance(h, MediaFragment)]
    assert len(fragments) >= 2 * (SECONDS - 1)
    assert max(map(len, fragments)) < 20_000


@pytest.mark.parametrize("data", [b"", b"\x47" * 4000, bytes(range(256)) * 60])
def test_garbage_is_an_error_of_one_line(data: bytes) -> None:
    with pytest.raises(CueError, match=r"cannot be received|neither sound nor picture"):
        receive(data)


def test_udp_on_the_loopback() -> None:
    """Sent four times as fast as it plays, one datagram in a hundred lost."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    happenings: list[Happening] = []
    broadcast = Broadcast(f"udp://127.0.0.1:{port}", VOICE, happenings.append)
    thread = threading.Thread(target=broadcast.run)
    thread.start()
    try:
        data = damaged(stream(), 0.01, 7)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            begin, size = time.monotonic() + 0.5, 7 * PACKET
            for at in range(0, len(data), size):
                due = begin + at / len(data) * SECONDS / 4
                time.sleep(max(0.0, due - time.monotonic()))
                sender.sendto(data[at : at + size], ("127.0.0.1", port))
            deadline = time.monotonic() + 10
            while time.monotonic() < deadline and len(motion_starts(happenings)) < 8:
                time.sleep(0.1)
            broadcast.stop()
            sender.sendto(data[: 7 * PACKET] * 2, ("127.0.0.1", port))
    finally:
        broadcast.stop()
        thread.join(20)
    assert not thread.is_alive()
    assert len(motion_starts(happenings)) >= 8
    assert wrong_keys(happenings) == []


def test_clock_follows_wraps_holes_and_splices() -> None:
    clock = SteadyClock()
    assert clock.place("sound", STAMP_PERIOD_S - 1.0, 0.02).time_s == pytest.approx(1.0)
    assert clock.place("picture", STAMP_PERIOD_S - 0.96).time_s == pytest.approx(1.04)
    assert clock.place("sound", 0.5).time_s == pytest.approx(2.5, abs=1e-6)
    assert clock.place("picture", 0.52).time_s == pytest.approx(2.52, abs=1e-6)
    hole = clock.place("sound", 8.5, 0.02)
    assert not hole.spliced
    assert hole.time_s == pytest.approx(10.5, abs=1e-6)
    splice = clock.place("sound", 70_000.0, 0.02)
    assert splice.spliced
    assert splice.time_s == pytest.approx(10.52, abs=1e-6)
    after = clock.place("picture", 70_000.04)
    assert not after.spliced
    assert after.time_s == pytest.approx(10.56, abs=1e-6)
    back = clock.place("sound", 69_000.0)
    assert back.spliced
    assert back.time_s == pytest.approx(10.56, abs=1e-6)
