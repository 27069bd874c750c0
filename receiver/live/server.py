"""The live television: a broadcast, received once, watched by several pages.

The broadcast's thread hands over happenings; every viewer has two WebSockets, one for the cuer
(``/feed``) and one for the media (``/media``, fragmented MP4 for Media Source Extensions).
"""

import asyncio
import base64
import contextlib
import json
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable
from typing import IO

from aiohttp import WSMsgType, web

from codec.cuer.voice import Voice
from receiver.live.broadcast import Broadcast, Happening, MediaFragment, MediaStart
from receiver.live.captions import CaptionsShown
from receiver.reception.authenticity import Trust
from receiver.reception.events import (
    AuthenticityChanged,
    Event,
    KeysFound,
    MotionPiece,
    StateChanged,
)
from receiver.television.memory import give_back_large_blocks
from receiver.television.protocol import pack_event
from receiver.television.server import TelevisionChannel

QUIET_S = 2.0
"""Without news for this long viewers see that the signal is lost."""

_QUEUE = 400
"""Messages that wait for a slow page before it is dropped."""

_RECENT_EVENTS = 60
"""Messages that a new page gets to begin with."""

_RECENT_FRAGMENTS = 3
"""Fragments of media that it gets."""

_Message = str | bytes


class LiveTelevision(TelevisionChannel):
    """A broadcast with its cuer on a local port.

    Parameters
    ----------
    source : str or binary file
        See `receiver.live.broadcast.Broadcast`.
    voice : Voice
    key : int
        Key of the watermark.
    format : str, optional
        Of a pipe.
    host, port
        Where to listen; port 0 takes a free one.
    trust, hold_s, avatar
        See `serve_live`.
    """

    def __init__(
        self, source: str | IO[bytes], voice: Voice,
        *, key: int = 0, format: str | None = None, host: str = "127.0.0.1", port: int = 0,
        trust: Trust | None = None, hold_s: float = 0.0, avatar: bytes | None = None,
    ) -> None:  # fmt: skip
        super().__init__(voice, live=True, host=host, port=port, avatar=avatar)
        self._hold_s = hold_s
        self._broadcast = Broadcast(
            source, voice, self._hand_over, key=key, format=format, trust=trust
        )
        self.metrics = self._broadcast.metrics
        self._loop: asyncio.AbstractEventLoop | None = None
        self._recent: deque[_Message] = deque(maxlen=_RECENT_EVENTS)
        self._state = pack_event(StateChanged(0.0, "searching"))
        self._whose: list[_Message] = []
        self._text: list[_Message] = []
        self._start: list[_Message] = []
        self._fragments: deque[bytes] = deque(maxlen=_RECENT_FRAGMENTS)
        self._listeners: dict[str, set[asyncio.Queue[_Message]]] = {"feed": set(), "media": set()}
        self._last_news_s = 0.0

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[str]:
        """Receive and listen; give the page's address; stop both at the end."""
        self._loop = asyncio.get_running_loop()
        self._last_news_s = self._loop.time()
        thread = threading.Thread(target=self._broadcast.run, daemon=True, name="broadcast")
        thread.start()
        watch = asyncio.create_task(self._watch())
        try:
            async with super().running() as address:
                yield address
        finally:
            watch.cancel()
            self._broadcast.stop()
            await asyncio.to_thread(thread.join, 1.0)

    def _hand_over(self, happening: Happening) -> None:
        """Pass a happening from the broadcast's thread to the server's."""
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # the server has just ended
                loop.call_soon_threadsafe(self.publish, happening)

    def publish(self, happening: Happening) -> None:
        """Pass a happening to the viewers; in the server's thread."""
        assert self._loop is not None
        self._last_news_s = self._loop.time()
        match happening:
            case MediaStart() | MediaFragment() if self._hold_s:
                self._loop.call_later(self._hold_s, self._show_media, happening)
            case MediaStart() | MediaFragment():
                self._show_media(happening)
            case CaptionsShown(start_s, end_s, png):
                picture = base64.b64encode(png).decode()
                shown = {"type": "captions", "start_s": start_s, "end_s": end_s, "png": picture}
                self._text = [json.dumps(shown)]
                self._send("feed", self._text[0])
            case _:
                self._show_event(happening)

    def _show_media(self, happening: MediaStart | MediaFragment) -> None:
        match happening:
            case MediaStart(mime, data, recoded, unseen):
                start = {"type": "start", "mime": mime, "recoded": recoded, "unseen": unseen}
                self._start = [json.dumps(start), data]
                self._fragments.clear()
                for message in self._start:
                    self._send("media", message)
            case MediaFragment(data):
                self._fragments.append(data)
                self._send("media", data)

    def _show_event(self, event: Event) -> None:
        message = pack_event(event)
        if isinstance(event, StateChanged):
            self._state = message
        elif isinstance(event, AuthenticityChanged):
            self._whose = [message]
        elif isinstance(event, MotionPiece | KeysFound):
            self._recent.append(message)
        self._send("feed", message)

    def _send(self, kind: str, message: _Message) -> None:
        for queue in list(self._listeners[kind]):
            try:
                queue.put_nowait(message)
            except asyncio.QueueFull:  # a viewer who does not keep up starts again
                self._listeners[kind].discard(queue)

    async def _watch(self) -> None:
        """Tell the viewers when the line has gone quiet, and when it speaks again."""
        assert self._loop is not None
        quiet = False
        while True:
            await asyncio.sleep(0.25)
            silent = self._loop.time() - self._last_news_s > QUIET_S
            if silent != quiet:
                quiet = silent
                self._send("feed", json.dumps({"type": "line", "quiet": quiet}))

    def _routes(self) -> list[web.RouteDef]:
        return [web.get("/media", self._media)]

    async def _media(self, request: web.Request) -> web.StreamResponse:
        return await self._converse(request, self._show)

    async def _show(self, socket: web.WebSocketResponse) -> None:
        await self._relay(socket, "media", lambda: [*self._start, *self._fragments])

    async def _tell(self, socket: web.WebSocketResponse) -> None:
        await self._relay(
            socket, "feed", lambda: [self._state, *self._whose, *self._text, *self._recent]
        )

    async def _relay(
        self, socket: web.WebSocketResponse, kind: str, before: Callable[[], list[_Message]]
    ) -> None:
        """Send the messages `before`, then new ones, until the viewer leaves or falls behind."""
        queue: asyncio.Queue[_Message] = asyncio.Queue(maxsize=_QUEUE)
        for earlier in before():
            queue.put_nowait(earlier)
        self._listeners[kind].add(queue)
        pump = asyncio.create_task(self._pump(socket, kind, queue))
        try:
            async for message in socket:
                if message.type is WSMsgType.ERROR:
                    break
        finally:
            self._listeners[kind].discard(queue)
            pump.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await pump

    async def _pump(
        self, socket: web.WebSocketResponse, kind: str, queue: asyncio.Queue[_Message]
    ) -> None:
        while queue in self._listeners[kind] or not queue.empty():
            message = await queue.get()
            if isinstance(message, str):
                await socket.send_str(message)
            else:
                await socket.send_bytes(message)
        await socket.close(code=1013, message=b"too slow")


def serve_live(
    source: str | IO[bytes], voice: Voice,
    *, key: int = 0, format: str | None = None, host: str = "127.0.0.1", port: int = 0,
    on_ready: Callable[[str], None] = print, trust: Trust | None = None,
    hold_s: float = 0.0, avatar: bytes | None = None,
) -> None:  # fmt: skip
    """Show a broadcast with its cuer until interrupted (Ctrl-C).

    Parameters
    ----------
    source : str or binary file
        ``udp://127.0.0.1:5004``, an HLS playlist, a path, or a pipe.
    voice : Voice
    key : int
        Key of the watermark.
    format : str, optional
        Of a pipe: ``mpegts``, ``wav``, ...
    host, port
        Where to listen; port 0 takes a free one.
    on_ready : callable
        Gets the page's address.
    trust : Trust, optional
        Whose cues these should be.
    hold_s : float
        How much later than it comes the programme is shown: cues that are verified first come
        later, too.
    avatar : bytes, optional
        Document of an avatar that replaces the voice's.
    """

    async def run() -> None:
        television = LiveTelevision(
            source,
            voice,
            key=key,
            format=format,
            host=host,
            port=port,
            trust=trust,
            hold_s=hold_s,
            avatar=avatar,
        )
        async with television.running() as address:
            on_ready(address)
            await asyncio.Event().wait()

    give_back_large_blocks()
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(run())
