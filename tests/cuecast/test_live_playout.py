"""The playout as a whole: a stream through the command, the marking process, the server."""

import asyncio
import json
import os
import signal
import socket
import threading
import time
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import Any

import aiohttp
import av
import numpy as np
import pytest

from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.live.packets import pid_of
from cuecast.live.playout import Playout, Route
from cuecast.live.server import PlayoutServer
from cuecast.live.sound import LiveOptions
from cuecast.live.worker import Cuer
from cuecast.media.tables import NULL_PID, PACKET

SECONDS = 9


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stream with a sound, as FFmpeg writes it, and its subtitles."""
    folder = tmp_path_factory.mktemp("air")
    sound, subtitles = make_sound()
    (folder / "a.srt").write_text(as_srt(subtitles), encoding="utf-8")
    with av.open(str(folder / "a.ts"), "w", format="mpegts") as out:
        picture: Any = out.add_stream("mpeg2video", rate=25)
        picture.width = picture.height = 64
        picture.pix_fmt = "yuv420p"
        heard: Any = out.add_stream("aac", rate=FS)
        heard.layout, heard.bit_rate = "stereo", 160_000
        for n in range(25 * SECONDS):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), n, np.uint8), format="rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            out.mux(picture.encode(frame))
            part = np.ascontiguousarray(sound[n * FS // 25 : (n + 1) * FS // 25].T)
            block = av.AudioFrame.from_ndarray(part, "fltp", "stereo")
            block.sample_rate, block.pts, block.time_base = FS, n * FS // 25, Fraction(1, FS)
            out.mux(heard.encode(block))
        out.mux(picture.encode(None))
        out.mux(heard.encode(None))
    return folder


def others(path: Path) -> list[bytes]:
    """All packets but those of the sound and the empty ones."""
    data = path.read_bytes()
    parts = [data[at : at + PACKET] for at in range(0, len(data), PACKET)]
    return [part for part in parts if pid_of(part) not in (257, NULL_PID)]


def test_a_file_passes_and_carries(
    air: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "b.ts"
    live = ["dub", "--live", str(air / "a.ts"), str(out), "--low-delay", "--pace", "sync"]
    assert main([*live, "--subtitles", str(air / "a.srt")]) == 0
    assert "the sound is marked" in capsys.readouterr().err
    assert others(out) == others(air / "a.ts")
    assert main(["receive", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["superframes"]["lost"] <= 1
    assert found["superframes"]["received"] >= 11
    assert main(["keys", "--file", str(air / "a.srt"), "--pace", "sync", "--json"]) == 0
    wanted = [(k["shape"], k["placement"]) for k in json.loads(capsys.readouterr().out)]
    heard = "".join(str(hash((k["shape"], k["placement"]))) for k in found["keys"][:8])
    assert heard in "".join(map(str, map(hash, wanted)))


def test_usage(air: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for given, message in [
        (["dub", "--live", str(air / "a.ts")], "say where from and where to"),
        (["dub", str(air / "a.ts")], "say the output with -o OUT"),
        (["dub", "--live", "-", "-", "--text", "-"], "only one of programme, live text"),
        (["dub", "--live", "-", "-", "--motion", "-"], "and interpreter can be the pipe"),
        (["dub", "--live", "-", "-", "--carriers", "video"], "only the carrier audio"),
    ]:
        assert main(given) == 2
        assert message in capsys.readouterr().err
    assert main(["dub", "--live", str(tmp_path / "none.ts"), str(tmp_path / "x.ts")]) == 3


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def test_datagrams_pass_whatever_happens_to_the_marking(air: Path) -> None:
    """Bypass before it is ready and after its death; live text and figures over HTTP; the end."""
    told: list[str] = []
    there, back = free_port(), free_port()
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", back))
    receiver.settimeout(0.5)
    playout = Playout(
        Route(f"udp://127.0.0.1:{there}", f"udp://127.0.0.1:{back}"), Cuer(),
        LiveOptions("standard", 0, -0.43, low_delay=True), told.append,
    )  # fmt: skip
    thread = threading.Thread(target=playout.run)
    thread.start()
    data = (air / "a.ts").read_bytes()
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    came = bytearray()
    with closing(PlayoutServer(playout, 0, told.append)) as server:
        os.kill(playout._worker._process.pid, signal.SIGKILL)
        asyncio.run(caption(server.port, "Bonsoir."))
        for at in range(0, len(data), 7 * PACKET):
            sender.sendto(data[at : at + 7 * PACKET], ("127.0.0.1", there))
            time.sleep(0.001)
        deadline = time.monotonic() + 20
        while len(came) < len(data) and time.monotonic() < deadline:
            try:
                came += receiver.recv(65536)
            except TimeoutError:
                continue
        figures = asyncio.run(metrics(server.port))
        playout.stop()
        thread.join(20)
    assert not thread.is_alive()
    assert bytes(came) == data
    assert any("the marking process ended (-9)" in line for line in told)
    assert "cuecast_restarts_total 1.0" in figures
    assert f"cuecast_packets_total {len(data) // PACKET}.0" in figures
    assert told[-1] == "the programme has ended"
    receiver.close()
    sender.close()


async def caption(port: int, text: str) -> None:
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"http://127.0.0.1:{port}/captions") as line,
    ):
        await line.send_str(json.dumps({"text": text}))


async def metrics(port: int) -> str:
    async with aiohttp.ClientSession() as session:
        async with session.get(f"http://127.0.0.1:{port}/health") as answer:
            assert answer.status in (200, 503)
        async with session.get(f"http://127.0.0.1:{port}/metrics") as answer:
            return await answer.text()
