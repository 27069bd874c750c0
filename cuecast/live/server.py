"""Figures for Prometheus, health and live text of a playout over HTTP.

``/metrics`` in Prometheus' text format; ``/health`` is 200 while sound that comes in leaves marked
(states ready and marked), else 503, with the state and its reason as JSON; ``/captions`` is a
WebSocket that takes live text, a JSON object a message, and answers refused ones with ``error``.
"""

import asyncio
import threading
from collections.abc import Callable

from aiohttp import WSMsgType, web

from codec.errors import CueError
from cuecast.live.guard import Guard
from cuecast.live.playout import Playout

_LONGEST_MESSAGE = 16_384
"""Bytes of a message of live text at most."""

_PATIENCE = 100
"""Refused messages after which a connection is closed."""


class PlayoutServer:
    """Serves one playout from a thread of its own.

    Parameters
    ----------
    playout : Playout
    port : int
        0 for any that is free.
    tell : callable
        Takes a line of the log.
    guard : Guard
        Address to listen on, and who may send live text.

    Raises
    ------
    CueError
        If nothing can be served there.
    """

    def __init__(
        self, playout: Playout, port: int, tell: Callable[[str], None], guard: Guard | None = None
    ) -> None:
        self._playout, self._guard = playout, guard or Guard()
        self._host = host = self._guard.host
        self._loop = asyncio.new_event_loop()
        self.port = port
        opened = threading.Event()
        self._failure: OSError | None = None
        self._thread = threading.Thread(
            target=self._serve, args=(opened,), daemon=True, name="playout-server"
        )
        self._thread.start()
        opened.wait(10.0)
        if self._failure is not None:
            raise CueError(f"port {port}: cannot be served: {self._failure.strerror}")
        tell(f"http://{host}:{self.port}/metrics, live text on ws://{host}:{self.port}/captions")

    def _serve(self, opened: threading.Event) -> None:
        asyncio.set_event_loop(self._loop)
        runner = web.AppRunner(self._application(), access_log=None)
        self._loop.run_until_complete(runner.setup())
        try:
            site = web.TCPSite(runner, self._host, self.port)
            self._loop.run_until_complete(site.start())
            self.port = runner.addresses[0][1]
        except OSError as error:
            self._failure = error
            return
        finally:
            opened.set()
        self._loop.run_forever()
        self._loop.run_until_complete(runner.cleanup())
        self._loop.close()

    def _application(self) -> web.Application:
        application = web.Application()
        application.router.add_get("/metrics", self._metrics)
        application.router.add_get("/health", self._health)
        application.router.add_get("/captions", self._captions)
        return application

    async def _metrics(self, request: web.Request) -> web.Response:
        return web.Response(
            text=self._playout.prometheus(),
            headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"},
        )

    async def _health(self, request: web.Request) -> web.Response:
        condition = self._playout.condition
        return web.json_response(
            {"state": condition.state, "reason": condition.reason}
            | ({"read_back": received} if (received := self._playout.received) else {}),
            status=200 if condition.can_mark else 503,
        )

    async def _captions(self, request: web.Request) -> web.StreamResponse:
        source = str(request.remote)
        objection = self._guard.objection(request.headers)
        if objection is not None:
            self._playout.refuse(source, objection)
            return web.Response(status=403, text=f"{objection}\n")
        socket = web.WebSocketResponse(max_msg_size=_LONGEST_MESSAGE, heartbeat=30.0)
        await socket.prepare(request)
        refused = 0
        async for message in socket:
            if message.type == WSMsgType.ERROR:
                self._playout.refuse(source, f"{message.data} (limit {_LONGEST_MESSAGE} bytes)")
                break
            if message.type != WSMsgType.TEXT:
                continue
            try:
                self._playout.caption(message.data.encode(), source)
            except CueError as error:
                refused += 1
                await socket.send_json({"error": str(error)})
            if refused > _PATIENCE:
                await socket.close(code=1008, message=b"too many captions")
        return socket

    def close(self) -> None:
        """Stop serving."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
