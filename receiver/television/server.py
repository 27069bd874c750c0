"""The television: an HTTP server on the loopback that shows a programme with its cuer.

It serves the page's fixed files, the programme with range requests, the voice's matrices, and one
WebSocket per viewer that carries the cuer at the viewer's pace. Read-only; only requests that
name this host are answered (a page of another origin cannot read the programme or the feed).
"""

import asyncio
import contextlib
import ipaddress
import json
import mimetypes
import os
import socket as socketlib
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

from aiohttp import WSMsgType, web

from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.drawing.avatar_document import avatar_documents
from receiver.drawing.voice_document import voice_document
from receiver.reception.reception import Progress
from receiver.television.memory import give_back_compiler
from receiver.television.metrics import Metrics
from receiver.television.packed import Captions, PackedFile
from receiver.television.protocol import (
    MAX_REQUEST_BYTES,
    Position,
    pack_event,
    pack_heard,
    parse_position,
)
from receiver.television.tuner import Tuner

PAGE = Path(__file__).parents[1] / "page"
AHEAD_S = 30.0
"""How far reception runs ahead of a viewer of a file."""

MAX_VIEWERS = 8
"""Pages that may watch at a time: a household's."""

FULL = 4001
"""Code of a WebSocket closed because enough pages are watching."""

_HEAD_S = 5.0
"""A connection that has asked for nothing for so long is closed."""

_MAX_SILENT = 64
"""Connections that may be open without having asked for anything."""

_SAID_EVERY_S = 1.0
"""The page learns how far the programme was received whenever it went on so far."""

_REQUESTS_PER_S = 20
"""Messages per second that a page may send: more than any hand makes."""


_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self';"
    " img-src 'self' data:; media-src 'self' blob:; connect-src 'self' {socket};"
    " frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}

_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class TelevisionChannel(ABC):
    """What every television serves: page, voice, avatar, figures, and a feed of its own kind.

    Parameters
    ----------
    voice : Voice
        Gives the parameters their meaning.
    live : bool
        Whether the programme comes as it is made.
    host : str
        Address to listen on; default: the loopback.
    port : int
        0 takes a free one.
    captions : Captions, optional
        The programme's text.
    avatar : bytes, optional
        Document of an avatar that replaces the voice's.
    """

    def __init__(
        self,
        voice: Voice,
        *,
        live: bool,
        host: str = "127.0.0.1",
        port: int = 0,
        captions: Captions | None = None,
        avatar: bytes | None = None,
    ) -> None:
        self.metrics = Metrics()
        self._live = live
        self._captions = captions
        self._fixed = page_files(PAGE)
        self._fixed["/"] = self._fixed["/page/index.html"]
        self._fixed["/voice.json"] = PackedFile(
            json.dumps(voice_document(voice, own_avatar=avatar is not None)).encode(),
            "application/json",
        )
        if captions is not None:
            self._fixed["/captions.vtt"] = PackedFile(captions.data, _kind_of("captions.vtt"))
        for name, document in avatar_documents(voice, avatar).items():
            self._fixed[f"/{name}"] = PackedFile(document, "application/octet-stream")
        self._host, self._port = host, port
        self._names = frozenset({host.lower(), "localhost", *_own_names()})
        self._silent: dict[web.RequestHandler, asyncio.TimerHandle] = {}
        self._sockets_per_page = 2 if live else 1
        self._sockets: set[web.WebSocketResponse] = set()

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[str]:
        """Listen; give the page's address; stop and close every viewer at the end.

        Raises
        ------
        CueError
            If the port is not free.
        """
        runner = web.AppRunner(
            self._application(), access_log=None, shutdown_timeout=1.0, keepalive_timeout=15.0
        )
        await runner.setup()
        loop = asyncio.get_running_loop()
        listener: asyncio.Server | None = None
        thrift = asyncio.create_task(give_back_compiler())
        try:
            try:
                listener = await loop.create_server(
                    lambda: self._greet(runner), self._host, self._port
                )
            except OSError as error:
                raise CueError(f"cannot listen on {self._host}:{self._port}: {error}") from error
            self._port = listener.sockets[0].getsockname()[1]
            yield f"http://{_address_of(self._host)}:{self._port}/"
        finally:
            thrift.cancel()
            if listener is not None:
                listener.close()
            for socket in list(self._sockets):
                await socket.close()
            await runner.cleanup()

    def _greet(self, runner: web.AppRunner) -> web.RequestHandler:
        """Take a connection; close it, or the oldest of too many, if it asks for nothing."""
        assert runner.server is not None
        handler = runner.server()
        loop = asyncio.get_running_loop()
        while len(self._silent) >= _MAX_SILENT:
            self._hang_up(next(iter(self._silent)))
        self._silent[handler] = loop.call_later(_HEAD_S, self._hang_up, handler)
        return handler

    def _hang_up(self, handler: web.RequestHandler) -> None:
        timer = self._silent.pop(handler, None)
        if timer is not None:
            timer.cancel()
        if handler.transport is not None:
            handler.transport.abort()

    def _application(self) -> web.Application:
        application = web.Application(middlewares=[self._guard], client_max_size=1024)
        application.add_routes([*self._common_routes(), *self._routes()])
        return application

    def _common_routes(self) -> list[web.RouteDef]:
        return [
            web.get("/", self._fixed_file),
            web.get("/page/{name}", self._fixed_file),
            web.get("/voice.json", self._fixed_file),
            web.get("/avatar{look:(-[a-z]+)?}.bin", self._fixed_file),
            web.get("/captions.vtt", self._fixed_file),
            web.get("/feed", self._feed),
            web.get("/status.json", self._status),
            web.get("/metrics", self._prometheus),
        ]

    @web.middleware
    async def _guard(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        """Refuse foreign hosts and origins; add the headers of a closed page.

        An address is nobody's name: a page that another one's name server led here has a name.
        """
        timer = self._silent.pop(request.protocol, None)
        if timer is not None:
            timer.cancel()
        origin = request.headers.get("Origin")
        if not self._is_own(request.host):
            raise web.HTTPForbidden(text=f"host {request.host} is not this television")
        if origin is not None and origin != f"http://{request.host}":
            raise web.HTTPForbidden(text=f"origin {origin} is not this television")
        response = await handler(request)
        if not response.prepared:
            for name, value in _HEADERS.items():
                response.headers[name] = value.replace("{socket}", f"ws://{request.host}")
        return response

    def _is_own(self, host: str) -> bool:
        """Return whether a request's Host names this television: an address, or a name of ours."""
        try:
            parts = urlsplit(f"http://{host}")
            name, port = parts.hostname or "", parts.port or 80
        except ValueError:
            return False
        return port == self._port and (name in self._names or _is_address(name))

    async def _fixed_file(self, request: web.Request) -> web.StreamResponse:
        """Serve one of the page's own files; nothing else has a name here."""
        file = self._fixed.get(request.path)
        if file is None:
            raise web.HTTPNotFound
        return file.response(request)

    async def _status(self, request: web.Request) -> web.StreamResponse:
        captions = self._captions.language if self._captions else None
        document = {"live": self._live, "captions": captions, **self.metrics.document()}
        return web.json_response(document)

    async def _prometheus(self, request: web.Request) -> web.StreamResponse:
        return web.Response(text=self.metrics.prometheus(), content_type="text/plain")

    async def _feed(self, request: web.Request) -> web.StreamResponse:
        return await self._converse(request, self._tell)

    async def _converse(
        self, request: web.Request, talk: Callable[[web.WebSocketResponse], Awaitable[None]]
    ) -> web.StreamResponse:
        """Open a WebSocket for a page of this television and let `talk` use it."""
        if request.headers.get("Origin") is None:
            raise web.HTTPForbidden(text="the feed is for the page of this television")
        socket = web.WebSocketResponse(
            max_msg_size=MAX_REQUEST_BYTES, heartbeat=20.0, compress=False
        )  # media is compressed already
        await socket.prepare(request)
        if len(self._sockets) >= MAX_VIEWERS * self._sockets_per_page:
            message = f"{MAX_VIEWERS} pages are watching already"
            await socket.close(code=FULL, message=message.encode())
            return socket
        self._sockets.add(socket)
        self.metrics.set("viewers", len(self._sockets) // self._sockets_per_page)
        try:
            await talk(socket)
        except CueError as error:
            self.metrics.fail(error)
            await socket.close(code=1011, message=str(error).encode()[:100])
        finally:
            self._sockets.discard(socket)
            self.metrics.set("viewers", len(self._sockets) // self._sockets_per_page)
        return socket

    @abstractmethod
    def _routes(self) -> list[web.RouteDef]:
        """Return what this kind of television serves beside the common things."""

    @abstractmethod
    async def _tell(self, socket: web.WebSocketResponse) -> None:
        """Serve one viewer's feed until it is closed."""


def page_files(folder: Path) -> dict[str, PackedFile]:
    """Return the files of a folder under the paths at which a page finds them."""
    return {
        f"/page/{file.name}": PackedFile(file.read_bytes(), _kind_of(file.name))
        for file in folder.iterdir()
        if file.is_file()
    }


def _kind_of(name: str) -> str:
    """Return the media type of a fixed file."""
    kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
    kind = "text/vtt" if name.endswith(".vtt") else kind
    return f"{kind}; charset=utf-8" if kind.startswith("text/") else kind


def _own_names() -> set[str]:
    """Names of this machine, as far as it knows them."""
    name = socketlib.gethostname().lower()
    return {name, name.partition(".")[0], f"{name.partition('.')[0]}.local"}


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _address_of(host: str) -> str:
    """Return how a browser on this machine names what listens at `host`.

    Examples
    --------
    >>> [_address_of(host) for host in ("::1", "0.0.0.0", "::", "tv.example")]
    ['[::1]', '127.0.0.1', '[::1]', 'tv.example']
    """
    if not _is_address(host):
        return host
    address = ipaddress.ip_address(host)
    if address.is_unspecified:
        return "127.0.0.1" if address.version == 4 else "[::1]"
    return f"[{host}]" if address.version == 6 else host


class Television(TelevisionChannel):
    """A programme in a file, with its cuer.

    Parameters
    ----------
    tuner : Tuner
        Where the cuer comes from.
    voice : Voice
        Gives the parameters their meaning.
    media : path
        The file that the browser plays, in a container and codecs that it knows.
    host, port
        Where to listen; port 0 takes a free one.
    captions : Captions, optional
        The programme's text.
    avatar : bytes, optional
        Document of an avatar that replaces the voice's.

    Examples
    --------
    ::

        async with Television(tuner, voice, "programme.mp4").running() as address:
            print(address)
            await asyncio.Event().wait()
    """

    def __init__(
        self, tuner: Tuner, voice: Voice, media: str | os.PathLike[str],
        *, host: str = "127.0.0.1", port: int = 0, captions: Captions | None = None,
        avatar: bytes | None = None,
    ) -> None:  # fmt: skip
        super().__init__(voice, live=False, host=host, port=port, captions=captions, avatar=avatar)
        self._tuner = tuner
        self._media = Path(media)
        if not self._media.is_file():
            raise CueError(f"{media}: no such file")

    def _routes(self) -> list[web.RouteDef]:
        return [web.get("/programme", self._programme)]

    async def _tell(self, socket: web.WebSocketResponse) -> None:
        await Viewer(socket, self._tuner).serve()

    async def _programme(self, request: web.Request) -> web.StreamResponse:
        kind = mimetypes.guess_type(self._media.name)[0] or "video/mp4"
        return web.FileResponse(self._media, headers={"Content-Type": kind})


class Viewer:
    """One page: reads where the viewer is, and sends the cuer from there on, some time ahead."""

    def __init__(self, socket: web.WebSocketResponse, tuner: Tuner) -> None:
        self._socket = socket
        self._tuner = tuner
        self._position = Position(0.0, True)
        self._moved = asyncio.Event()
        self._jumps = 0

    async def serve(self) -> None:
        """Run until the page closes the socket or breaks the protocol.

        Raises
        ------
        CueError
            If the programme cannot be received where the viewer is.
        """
        pump = asyncio.create_task(self._pump())
        listen = asyncio.create_task(self._listen())
        await asyncio.wait((pump, listen), return_when=asyncio.FIRST_COMPLETED)
        for task in (pump, listen):
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await task

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        window_s, seen = loop.time(), 0
        async for message in self._socket:
            if loop.time() - window_s > 1:
                window_s, seen = loop.time(), 0
            seen += 1
            if seen > _REQUESTS_PER_S:
                await self._socket.close(code=1008, message=b"too many messages")
                return
            if message.type is not WSMsgType.TEXT:
                continue
            try:
                self._position = parse_position(message.data)
            except CueError as error:
                await self._socket.close(code=1008, message=str(error).encode()[:100])
                return
            self._jumps += self._position.jumped
            self._moved.set()

    async def _pump(self) -> None:
        """Receive at the viewer's place, again after each jump."""
        while True:
            await self._until_moved(lambda: self._jumps > 0)
            self._jumps = 0
            start_s = self._position.time_s
            await self._send_from(self._tuner.tune(start_s))

    async def _send_from(self, stream: Iterator[Progress]) -> None:
        """Send until the viewer jumps or the stream ends, at most `AHEAD_S` ahead."""
        from_s = until_s = said_s = self._position.time_s
        while True:
            await self._until_moved(partial(self._wants, until_s))
            if self._jumps:
                return
            progress = await asyncio.to_thread(next, stream, None)
            if progress is None:
                return
            until_s = progress.until_s
            if abs(until_s - said_s) >= _SAID_EVERY_S:
                said_s = until_s
                await self._socket.send_str(pack_heard(min(from_s, until_s), until_s))
            for event in progress.events:
                message = pack_event(event)
                if isinstance(message, str):
                    await self._socket.send_str(message)
                else:
                    await self._socket.send_bytes(message)

    def _wants(self, until_s: float) -> bool:
        return self._jumps > 0 or until_s < self._position.time_s + AHEAD_S

    async def _until_moved(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self._moved.clear()
            await self._moved.wait()


def serve(
    tuner: Tuner, voice: Voice, media: str | os.PathLike[str],
    *, host: str = "127.0.0.1", port: int = 0, on_ready: Callable[[str], None] = print,
    captions: Captions | None = None, avatar: bytes | None = None,
) -> None:  # fmt: skip
    """Show a programme with its cuer until interrupted (Ctrl-C).

    Parameters
    ----------
    tuner : Tuner
        Where the cuer comes from: `receiver.television.tuner.ProgrammeTuner` for a marked file.
    voice : Voice
    media : path
        The file that the browser plays.
    host, port
        Where to listen; port 0 takes a free one.
    on_ready : callable
        Gets the page's address.
    captions : Captions, optional
        The programme's text.
    avatar : bytes, optional
        Document of an avatar that replaces the voice's.

    Raises
    ------
    CueError
        If the media is missing or the port is not free.
    """

    async def run() -> None:
        television = Television(
            tuner, voice, media, host=host, port=port, captions=captions, avatar=avatar
        )
        async with television.running() as address:
            on_ready(address)
            await asyncio.Event().wait()

    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(run())
