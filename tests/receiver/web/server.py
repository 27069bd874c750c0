"""A static web server of a folder with byte ranges, as `<video>` asks for them; notes each path."""

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

from aiohttp import web


@contextlib.asynccontextmanager
async def serving(folder: Path, asked: list[str]) -> AsyncIterator[str]:
    """Serve `folder` at the address yielded; `asked` gets the paths asked for."""

    async def answer(request: web.Request) -> web.StreamResponse:
        name = request.path.lstrip("/") or "index.html"
        asked.append(name)
        if not (folder / name).is_file():
            raise web.HTTPNotFound
        return web.FileResponse(folder / name)

    app = web.Application()
    app.router.add_get("/{name:.*}", answer)
    runner = web.AppRunner(app, access_log=None)
    await runner.setup()
    try:
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        yield f"http://127.0.0.1:{runner.addresses[0][1]}"
    finally:
        await runner.cleanup()
