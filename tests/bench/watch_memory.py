"""Memory of `watch` while a programme runs for minutes: the page's server, without a browser.

In: a marked film. Its packets go round until ``--minutes`` are full; a viewer asks for the cuer at
``--speed`` times real time. Out: resident memory at each tenth of the programme, on stdout. Exit
status 1 if the second half took over `GROWTH_MB` more than the first.
``python -m tests.bench.watch_memory FILM [--minutes 10] [--speed 4]``
"""

import argparse
import asyncio
import os
import re
import sys
import tempfile
import time
from pathlib import Path

import aiohttp

from tests.system.test_long import loop

GROWTH_MB = 10.0
"""Growth in MB that a longer list of keys and the allocator may cause."""


def resident_mb(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


async def follow(address: str, pid: int, seconds: float, speed: float) -> tuple[list[float], int]:
    """Move a viewer through the programme; return memory at each tenth, and messages received."""
    found: list[float] = []
    messages = 0
    origin = address.rstrip("/")
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(f"{origin}/feed", origin=origin) as feed,
    ):

        async def read() -> None:
            nonlocal messages
            async for _ in feed:
                messages += 1

        reader = asyncio.create_task(read())
        begun = time.monotonic()
        while len(found) < 10:
            at_s = min(seconds, speed * (time.monotonic() - begun))
            await feed.send_json({"type": "position", "time_s": round(at_s, 3), "jumped": at_s < 1})
            await asyncio.sleep(0.5)
            if at_s >= seconds * (len(found) + 1) / 10:
                found.append(resident_mb(pid))
                print(f"{at_s:.0f} s: {found[-1]:.0f} MB, {messages} messages", flush=True)
        reader.cancel()
    return found, messages


async def measure(film: Path, seconds: float, speed: float) -> int:
    arguments = [sys.executable, "-m", "cuecast", "watch", str(film), "--port", "0"]
    process = await asyncio.create_subprocess_exec(*arguments, stderr=asyncio.subprocess.PIPE)
    try:
        assert process.stderr is not None
        address = None
        while address is None:
            line = (await process.stderr.readline()).decode()
            if not line:
                print("watch ended", file=sys.stderr)
                return 2
            address = re.search(r"http://\S+", line)
        found, messages = await follow(address[0], process.pid, seconds, speed)
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()
    growth = max(found[5:]) - max(found[:5])
    print(f"most {max(found):.0f} MB, second half {growth:+.0f} MB, {messages} messages")
    return int(growth > GROWTH_MB or not messages)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("film", type=Path)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--speed", type=float, default=4.0)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "programme.mp4"
        loop(chosen.film, film, 60 * chosen.minutes)
        return asyncio.run(measure(film, 60 * chosen.minutes, chosen.speed))


if __name__ == "__main__":
    sys.exit(main())
