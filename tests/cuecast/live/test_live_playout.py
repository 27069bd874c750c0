"""The playout as a whole: a stream through the command, the marking process, the server."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
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
from cuecast.live.options import LiveOptions
from cuecast.live.packets import pid_of
from cuecast.live.playout import Playout, Route
from cuecast.live.server import PlayoutServer
from cuecast.live.worker import Cuer
from cuecast.media.tables import NULL_PID, PACKET

SECONDS = 9


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stream with a sound, as FFmpeg writes it, and its subtitles."""
    folder = tmp_path_factory.mktemp("air")
    write_air(folder, SECONDS, 160_000)
    return folder


def write_air(folder: Path, seconds: int, bit_rate: int, silent_s: int = 0, fs: int = FS) -> None:
    """Write a.ts, whose sound has this bit rate and begins silent, and a.srt."""
    sound, subtitles = make_sound()
    sound = np.concatenate([np.zeros((silent_s * fs, 2), np.float32), sound])
    (folder / "a.srt").write_text(as_srt(subtitles), encoding="utf-8")
    with av.open(str(folder / "a.ts"), "w", format="mpegts") as out:
        picture: Any = out.add_stream("mpeg2video", rate=25)
        picture.width = picture.height = 64
        picture.pix_fmt = "yuv420p"
        heard: Any = out.add_stream("aac", rate=fs)
        heard.layout, heard.bit_rate = "stereo", bit_rate
        for n in range(25 * seconds):
            frame = av.VideoFrame.from_ndarray(
                np.full((64, 64, 3), n % 256, np.uint8), format="rgb24"
            )
            frame.pts, frame.time_base = n, Fraction(1, 25)
            out.mux(picture.encode(frame))
            part = np.ascontiguousarray(sound[n * fs // 25 : (n + 1) * fs // 25].T)
            block = av.AudioFrame.from_ndarray(part, "fltp", "stereo")
            block.sample_rate, block.pts, block.time_base = fs, n * fs // 25, Fraction(1, fs)
            out.mux(heard.encode(block))
        out.mux(picture.encode(None))
        out.mux(heard.encode(None))


def others(path: Path) -> list[bytes]:
    """All packets but those of the sound and the empty ones."""
    data = path.read_bytes()
    parts = [data[at : at + PACKET] for at in range(0, len(data), PACKET)]
    return [part for part in parts if pid_of(part) not in (257, NULL_PID)]


def test_a_file_passes_and_carries(
    air: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "b.ts"
    live = ["playout", str(air / "a.ts"), str(out), "--low-delay", "--pace", "sync"]
    assert main([*live, "--subtitles", str(air / "a.srt")]) == 0
    log = capsys.readouterr().err
    assert "state starting: the marking process is loading" in log
    assert "state marked" in log
    assert "state stopping: no more input is taken" in log
    assert others(out) == others(air / "a.ts")
    assert main(["receive", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["superframes"]["lost"] <= 2
    assert found["superframes"]["received"] >= 11
    assert main(["keys", "--file", str(air / "a.srt"), "--pace", "sync", "--json"]) == 0
    wanted = [(k["shape"], k["placement"]) for k in json.loads(capsys.readouterr().out)]
    heard = "".join(str(hash((k["shape"], k["placement"]))) for k in found["keys"][:8])
    assert heard in "".join(map(str, map(hash, wanted)))


def test_a_frugal_line_keeps_its_cuer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rehearsed on the usual coders alone, 10 of 19 superframes arrived."""
    write_air(tmp_path, 12, 96_000)
    names = [str(tmp_path / name) for name in ("a.ts", "b.ts", "a.srt")]
    assert main(["playout", *names[:2], "--subtitles", names[2]]) == 0
    capsys.readouterr()
    assert main(["receive", names[1], "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["superframes"]["received"] >= 15
    sizes = [(tmp_path / name).stat().st_size for name in ("a.ts", "b.ts")]
    assert sizes[1] < 1.03 * sizes[0]  # packets hold as many frames as before
    stamps = sound_packets(tmp_path / "b.ts")
    assert max(np.diff(stamps)) < 1.1 * 90_000 * 1024 / FS


def sound_packets(path: Path) -> list[int]:
    """Time stamps of the coded sound, which decodes without an error."""
    with av.open(str(path)) as file:
        packets = [packet for packet in file.demux(audio=0) if packet.pts is not None]
        assert not any(packet.is_corrupt for packet in packets)
        for packet in packets:
            packet.decode()
        return [int(packet.pts or 0) for packet in packets]


def test_sound_in_long_packets_is_waited_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """FFmpeg puts 4.8 s of silence into a packet: the playout waited 120 s for each mark in it.

    Marked sound takes more packets than the plain one had; its end was cut off.
    """
    write_air(tmp_path, 14, 96_000, silent_s=6)
    names = [str(tmp_path / name) for name in ("a.ts", "b.ts", "a.srt")]
    assert main(["playout", *names[:2], "--subtitles", names[2]]) == 0
    assert "bypass" not in capsys.readouterr().err
    before, after = sound_packets(tmp_path / "a.ts"), sound_packets(tmp_path / "b.ts")
    assert abs(after[-1] - before[-1]) < 0.05 * 90_000
    assert main(["receive", names[1], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["superframes"]["received"] >= 12


def test_sound_that_cannot_be_marked_passes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_air(tmp_path, 16, 96_000, fs=22_050)
    names = [str(tmp_path / name) for name in ("a.ts", "b.ts", "a.srt")]
    assert main(["playout", *names[:2], "--subtitles", names[2]]) == 0
    assert "sampling rate 22050 Hz" in capsys.readouterr().err
    assert (tmp_path / "b.ts").read_bytes() == (tmp_path / "a.ts").read_bytes()


def test_usage(air: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    token = tmp_path / "token"
    token.write_text("abc\n")
    for given, message in [
        (["dub", "--live", str(air / "a.ts")], "the following arguments are required: OUT"),
        (["dub", str(air / "a.ts")], "say the output with -o OUT"),
        (["playout", "-", "-", "--text", "-"], "only one of programme, live text"),
        (["playout", "-", "-", "--motion", "-"], "and interpreter can be the pipe"),
        (["playout", "-", "-", "--token-file", str(token)], "need --port"),
    ]:
        assert main(given) == 2
        assert message in capsys.readouterr().err
    for given, message in [
        (["playout", str(tmp_path / "none.ts"), str(tmp_path / "x.ts")], "none.ts"),
        (["playout", str(air / "a.srt"), str(tmp_path / "x.ts")], "a.srt: no transport stream"),
        (["playout", "-", "-", "--port", "0", "--host", "0.0.0.0"], "needs --token-file"),
        (["playout", "-", "-", "--port", "0", "--token-file", str(token)], "this one 3"),
    ]:
        assert main(given) == 3
        assert message in capsys.readouterr().err
    assert not (tmp_path / "x.ts").exists()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def test_datagrams_pass_whatever_happens_to_the_marking(
    air: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bypass before it is ready and after its death; live text and figures over HTTP; the end."""
    monkeypatch.setattr("cuecast.live.worker._RESTART_S", (600.0,))
    told: list[str] = []
    there, back = free_port(), free_port()
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", back))
    receiver.settimeout(0.5)
    playout = Playout(
        Route(f"udp://127.0.0.1:{there}", f"udp://127.0.0.1:{back}"),
        Cuer(),
        LiveOptions("standard", 0, -0.43, low_delay=True),
        told.append,
    )
    thread = threading.Thread(target=playout.run)
    thread.start()
    data = (air / "a.ts").read_bytes()
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    came = bytearray()
    with closing(PlayoutServer(playout, 0, told.append)) as server:
        marking = playout._worker._process
        assert marking is not None
        os.kill(marking.pid, signal.SIGKILL)
        assert "state" in asyncio.run(health(server.port))
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
    assert 'cuecast_state{state="marked"} 0.0' in figures
    assert any('caption from 127.0.0.1: "{' in line for line in told)
    assert told[-1] == "the programme has ended"
    receiver.close()
    sender.close()


def run_command(*given: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "cuecast", "playout", *given],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.mark.usefixtures("hangups_end")
@pytest.mark.parametrize("mode", ["--text", "--motion", "programme"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_it_gracefully_while_a_pipe_is_open(
    mode: str, number: signal.Signals
) -> None:
    """A thread that waits in Python's buffer for the pipe made the interpreter abort."""
    back = free_port()
    source = "-" if mode == "programme" else f"udp://127.0.0.1:{free_port()}"
    more = [] if mode == "programme" else [mode, "-"]
    with run_command(source, f"udp://127.0.0.1:{back}", *more) as process:
        assert process.stderr is not None
        log = b""
        while b"state starting" not in log:
            log += process.stderr.read1(4096) or pytest.fail(log.decode())  # type: ignore[attr-defined]
        process.send_signal(number)
        try:
            _, rest = process.communicate(timeout=60)
        finally:
            process.kill()
        assert process.returncode == 0, (log + rest).decode()
    assert b"state stopping" in rest
    assert b"Fatal" not in rest


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["--text", "--motion", "programme"])
def test_twenty_of_twenty_stops_are_graceful(mode: str) -> None:
    for number in [signal.SIGTERM, signal.SIGINT] * 10:
        test_a_signal_ends_it_gracefully_while_a_pipe_is_open(mode, number)


async def caption(port: int, text: str) -> None:
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"http://127.0.0.1:{port}/captions") as line,
    ):
        await line.send_str(json.dumps({"text": text}))


async def health(port: int) -> dict[str, str]:
    async with (
        aiohttp.ClientSession() as session,
        session.get(f"http://127.0.0.1:{port}/health") as answer,
    ):
        found: dict[str, str] = await answer.json()
        assert answer.status == (200 if found["state"] in ("ready", "marked") else 503)
        return found


async def metrics(port: int) -> str:
    async with (
        aiohttp.ClientSession() as session,
        session.get(f"http://127.0.0.1:{port}/metrics") as answer,
    ):
        return await answer.text()
