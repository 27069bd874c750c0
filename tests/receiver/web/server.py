"""Static web servers of a folder: one that knows byte ranges, and Python's own."""

import asyncio
import contextlib
import re
import sys
from collections.abc import AsyncIterator
from pathlib import Path

from aiohttp import web

POLICY = (
    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; media-src *; connect-src *;"
    " img-src 'self' data:"
)
"""The least that the player's page asks of a site's policy, and media of any site for the tests."""


@contextlib.asynccontextmanager
async def serving(
    folder: Path, asked: list[str], open_to_others: tuple[str, ...] = ()
) -> AsyncIterator[str]:
    """Serve `folder` under `POLICY` at the address yielded; `asked` gets the paths asked for.

    Pages of other sites may read the files `open_to_others`.
    """

    async def answer(request: web.Request) -> web.StreamResponse:
        name = request.path.lstrip("/") or "index.html"
        asked.append(name)
        if not (folder / name).is_file():
            raise web.HTTPNotFound
        headers = {"Content-Security-Policy": POLICY}
        if name in open_to_others:
            headers["Access-Control-Allow-Origin"] = "*"
        return web.FileResponse(folder / name, headers=headers)

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


@contextlib.asynccontextmanager
async def http_server(folder: Path) -> AsyncIterator[str]:
    """Serve `folder` by `python -m http.server`, which knows no byte ranges."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "-d", str(folder),
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        found = re.search(rb"port (\d+)", await process.stdout.readline())
        assert found is not None
        yield f"http://127.0.0.1:{int(found[1])}"
    finally:
        process.terminate()
        await process.wait()
