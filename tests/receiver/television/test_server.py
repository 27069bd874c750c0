"""The television's server: what it serves, what it refuses, and the feed."""

import asyncio
import contextlib
import json
import socket
import struct
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path

import aiohttp
import pytest
from yarl import URL

from codec.cuer.voice import load_voice
from codec.errors import CueError
from receiver.reception.reception import Progress
from receiver.television import server
from receiver.television.protocol import MAX_REQUEST_BYTES, parse_position
from receiver.television.server import AHEAD_S, FULL, MAX_VIEWERS, Television
from receiver.television.tuner import MotionTuner
from tests.receiver.standin import make_motion, make_voice

VOICE = make_voice()
MOTION = make_motion(VOICE, duration_s=60.0)
MEDIA = bytes(range(256)) * 40

Client = aiohttp.ClientSession


@contextlib.asynccontextmanager
async def television(folder: Path) -> AsyncIterator[tuple[Client, str]]:
    media = folder / "programme.mp4"
    media.write_bytes(MEDIA)
    showing = Television(MotionTuner(MOTION), VOICE, media).running()
    async with showing as address, aiohttp.ClientSession() as client:
        yield client, address


def run(tmp_path: Path, visit: Callable[[Client, str], Awaitable[None]]) -> None:
    async def main() -> None:
        async with television(tmp_path) as (client, address):
            await visit(client, address)

    asyncio.run(asyncio.wait_for(main(), 30))


def origin(address: str) -> dict[str, str]:
    return {"Origin": address.rstrip("/")}


def position(time_s: float, jumped: bool = True) -> str:
    return json.dumps({"type": "position", "time_s": time_s, "jumped": jumped})


def test_page_voice_and_headers(tmp_path: Path) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.get(address) as answer:
            assert answer.status == 200
            assert answer.content_type == "text/html"
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert answer.headers["X-Content-Type-Options"] == "nosniff"
        async with client.get(address + "page/main.js") as answer:
            assert answer.content_type == "text/javascript"
        async with client.get(address + "voice.json") as answer:
            assert (await answer.json())["identity"] == VOICE.identity

    run(tmp_path, visit)


def test_fixed_files_travel_compressed_and_once(tmp_path: Path) -> None:
    """All that a page with claire's avatar in one look fetches is at most 1.5 MB."""
    media = tmp_path / "programme.mp4"
    media.write_bytes(MEDIA)
    files = Television(MotionTuner(MOTION), load_voice(), media)._fixed
    asked_for = ("/page/index.html", "/avatar-man.bin", "/avatar-elder.bin")
    assert sum(file.size for name, file in files.items() if name not in asked_for) <= 1.5e6

    async def visit(client: Client, address: str) -> None:
        async with client.get(address + "page/main.js") as answer:
            tag, text = answer.headers["ETag"], await answer.text()
            assert answer.headers["Content-Encoding"] == "gzip"
        plain = {"Accept-Encoding": "identity"}
        async with client.get(address + "page/main.js", headers=plain) as answer:
            assert "Content-Encoding" not in answer.headers
            assert await answer.text() == text
        async with client.get(address + "page/main.js", headers={"If-None-Match": tag}) as answer:
            assert answer.status == 304
        async with client.get(address + "captions.vtt") as answer:
            assert answer.status == 404

    run(tmp_path, visit)


def test_programme_in_ranges(tmp_path: Path) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.get(address + "programme") as answer:
            assert (answer.status, await answer.read()) == (200, MEDIA)
            assert answer.headers["Accept-Ranges"] == "bytes"
        ask = {"Range": "bytes=1000-1099"}
        async with client.get(address + "programme", headers=ask) as answer:
            assert (answer.status, await answer.read()) == (206, MEDIA[1000:1100])
            assert answer.headers["Content-Range"] == f"bytes 1000-1099/{len(MEDIA)}"
        ask = {"Range": f"bytes={len(MEDIA)}-"}
        async with client.get(address + "programme", headers=ask) as answer:
            assert answer.status == 416

    run(tmp_path, visit)


@pytest.mark.parametrize(
    "path",
    ["page/../server.py", "page/%2e%2e/server.py", "page/..%2fserver.py", "page/", "etc/passwd",
     "page//etc/passwd", "page/style.css/../../server.py", "programme/../server.py"],
)  # fmt: skip
def test_nothing_else_has_a_name(tmp_path: Path, path: str) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.get(URL(address + path, encoded=True)) as answer:
            assert answer.status == 404

    run(tmp_path, visit)


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH"])
def test_nothing_can_be_written(tmp_path: Path, method: str) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.request(method, address + "programme", data=b"x") as answer:
            assert answer.status == 405

    run(tmp_path, visit)


@pytest.mark.parametrize("path", ["", "programme", "voice.json", "feed"])
@pytest.mark.parametrize(
    "headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}]
)
def test_foreign_hosts_and_origins_are_refused(
    tmp_path: Path, path: str, headers: dict[str, str]
) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.get(address + path, headers=headers) as answer:
            assert answer.status == 403

    run(tmp_path, visit)


def test_feed_needs_an_origin(tmp_path: Path) -> None:
    async def visit(client: Client, address: str) -> None:
        with pytest.raises(aiohttp.WSServerHandshakeError) as error:
            await client.ws_connect(address + "feed")
        assert error.value.status == 403

    run(tmp_path, visit)


def test_feed_runs_ahead_of_the_viewer_and_no_further(tmp_path: Path) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.ws_connect(address + "feed", headers=origin(address)) as socket:
            await socket.send_str(position(3.0))
            starts = []
            with contextlib.suppress(TimeoutError):
                while True:
                    message = await socket.receive(timeout=0.5)
                    if message.type is aiohttp.WSMsgType.BINARY:
                        starts.append(start_of(message.data))
            assert starts[0] <= 3.0 < starts[0] + 0.64
            assert 3.0 + AHEAD_S - 0.64 <= starts[-1] <= 3.0 + AHEAD_S
            await socket.send_str(position(45.0))
            message = await socket.receive(timeout=2)
            while message.type is not aiohttp.WSMsgType.BINARY:
                message = await socket.receive(timeout=2)
            assert 44.3 < start_of(message.data) <= 45.0

    run(tmp_path, visit)


def start_of(data: bytes) -> float:
    return float(struct.unpack_from("<d", data, 8)[0])


@pytest.mark.parametrize(
    "text",
    ["", "[]", "null", "{", '{"type":"position"}', '{"type":"x","time_s":1}',
     '{"type":"position","time_s":-1}', '{"type":"position","time_s":1e9}',
     '{"type":"position","time_s":NaN}', "[" * 200, '"' + "x" * MAX_REQUEST_BYTES + '"'],
)  # fmt: skip
def test_malformed_positions(text: str) -> None:
    with pytest.raises(CueError):
        parse_position(text)


@pytest.mark.parametrize("text", ["nonsense", "x" * (MAX_REQUEST_BYTES + 1), position(1e12)])
def test_a_viewer_who_breaks_the_protocol_is_sent_away(tmp_path: Path, text: str) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.ws_connect(address + "feed", headers=origin(address)) as socket:
            await socket.send_str(text)
            message = await socket.receive(timeout=5)
            assert message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
        async with client.get(address) as answer:
            assert answer.status == 200

    run(tmp_path, visit)


def test_a_flood_is_cut_off(tmp_path: Path) -> None:
    async def visit(client: Client, address: str) -> None:
        async with client.ws_connect(address + "feed", headers=origin(address)) as socket:
            with contextlib.suppress(ConnectionError):
                for _ in range(100):
                    await socket.send_str(position(1.0, jumped=False))
            message = await socket.receive(timeout=5)
            assert message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)

    run(tmp_path, visit)


def test_viewers_are_counted(tmp_path: Path) -> None:
    async def visit(client: Client, address: str) -> None:
        async with contextlib.AsyncExitStack() as stack:
            for _ in range(MAX_VIEWERS):
                connection = client.ws_connect(address + "feed", headers=origin(address))
                socket = await stack.enter_async_context(connection)
                await socket.send_str(position(0.0))
                assert (await socket.receive(timeout=5)).type is aiohttp.WSMsgType.TEXT
            one_more = client.ws_connect(address + "feed", headers=origin(address))
            message = await (await stack.enter_async_context(one_more)).receive(timeout=5)
            assert (message.type, message.data) == (aiohttp.WSMsgType.CLOSE, FULL)
            assert message.extra == "8 pages are watching already"

    run(tmp_path, visit)


@pytest.mark.parametrize("host", ["0.0.0.0", "::1", "127.0.0.1", "localhost"])
def test_every_address_of_this_machine_answers(tmp_path: Path, host: str) -> None:
    """As a browser names it: an address, or this machine's name; never another's."""

    async def visit() -> None:
        media = tmp_path / "programme.mp4"
        media.write_bytes(MEDIA)
        showing = Television(MotionTuner(MOTION), VOICE, media, host=host).running()
        async with showing as address, aiohttp.ClientSession() as client:
            port = URL(address).port
            async with client.get(address, headers=origin(address)) as answer:
                assert answer.status == 200
            names = ("192.168.1.7", "[fd00::7]", "localhost", socket.gethostname().upper())
            for name in names:
                headers = {"Host": f"{name}:{port}", "Origin": f"http://{name}:{port}"}
                async with client.get(address, headers=headers) as answer:
                    assert answer.status == 200, name
            for name in ("evil.example", f"evil.example:{port}", "192.168.1.7:1", f"[::1:{port}"):
                async with client.get(address, headers={"Host": name}) as answer:
                    assert answer.status in (400, 403), name

    asyncio.run(asyncio.wait_for(visit(), 30))


def test_connections_that_ask_for_nothing_are_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "_HEAD_S", 1.0)

    async def visit(client: Client, address: str) -> None:
        place = URL(address)
        assert place.host is not None
        open_ones = []
        for number in range(200):
            reader, writer = await asyncio.open_connection(place.host, place.port)
            if number % 2:
                writer.write(b"GET / HTTP/1.1\r\nHost: ")
            open_ones.append((reader, writer))
        async with client.get(address) as answer:
            assert answer.status == 200
        for reader, writer in open_ones:
            with contextlib.suppress(ConnectionError):
                assert await asyncio.wait_for(reader.read(), 5) == b""
            writer.close()

    run(tmp_path, visit)


class Failing:
    """A tuner whose programme is damaged."""

    def tune(self, start_s: float) -> Iterator[Progress]:
        yield Progress(start_s, ())
        raise CueError("programme.mp4: damaged: no more of it")


def test_a_programme_that_fails_is_told(tmp_path: Path) -> None:
    async def visit() -> None:
        media = tmp_path / "programme.mp4"
        media.write_bytes(MEDIA)
        television = Television(Failing(), VOICE, media)
        async with television.running() as address, aiohttp.ClientSession() as client:
            async with client.ws_connect(address + "feed", headers=origin(address)) as socket:
                await socket.send_str(position(0.0))
                message = await socket.receive(timeout=5)
                assert (message.type, message.data) == (aiohttp.WSMsgType.CLOSE, 1011)
                assert "damaged" in str(message.extra)
            assert television.metrics.document()["failures"] == {"CueError": 1}

    asyncio.run(asyncio.wait_for(visit(), 30))


def test_missing_media_and_taken_port(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="no such file"):
        Television(MotionTuner(MOTION), VOICE, tmp_path / "absent.mp4")

    async def visit(client: Client, address: str) -> None:
        port = int(address.rsplit(":", 1)[1].strip("/"))
        media = tmp_path / "programme.mp4"
        with pytest.raises(CueError, match=f"cannot listen on 127.0.0.1:{port}"):
            async with Television(MotionTuner(MOTION), VOICE, media, port=port).running():
                pass

    run(tmp_path, visit)
