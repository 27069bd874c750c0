"""What a set-top box spends on a broadcast's sound: ``cuecast watch`` on UDP with one viewer.

The command runs as its users run it, on a transport stream of sound alone in real time, the
programme again and again; a viewer takes feed and media. Measured after a start that is left out:
processor time over time, which is a share of one core, and memory. The report goes to
``artefacts/line/box.json``.
"""

import asyncio
import contextlib
import json
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import aiohttp
from pytest_benchmark.fixture import BenchmarkFixture

from tests.receiver.badair import POOL_S, pool
from tests.receiver.transmitter import Transmitter
from tests.receiver.viewer import memory_mb

REPORT = Path(__file__).resolve().parents[2] / "artefacts" / "line" / "box.json"
START_S = 5.0
"""Time for the command to load its programs, and to find the signal."""


def processor_s(pid: int) -> float:
    """Return the processor time that a process with all its threads has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def view(address: str, name: str) -> int:
    """Take whatever a page would be sent, until cancelled."""
    taken = 0
    headers = {"Origin": address.rstrip("/")}
    async with (
        aiohttp.ClientSession() as client,
        client.ws_connect(address + name, headers=headers) as feed,
    ):
        with contextlib.suppress(asyncio.CancelledError):
            async for message in feed:
                taken += len(message.data)
    return taken


async def measure(codec: str, pid: int, address: str, port: int) -> dict[str, float]:
    transmitter = Transmitter(pool(codec), port, POOL_S)
    viewers = [asyncio.create_task(view(address, name)) for name in ("feed", "media")]
    transmitter.start()
    await asyncio.sleep(START_S)
    before_s, begin = processor_s(pid), time.monotonic()
    await asyncio.to_thread(transmitter.join)
    share = (processor_s(pid) - before_s) / (time.monotonic() - begin)
    async with aiohttp.ClientSession() as client, client.get(address + "status.json") as answer:
        figures = await answer.json()
    for viewer in viewers:
        viewer.cancel()
    feed, media = await asyncio.gather(*viewers)
    return {
        "share_of_one_core": round(share, 4),
        "resident_mb": memory_mb(pid)[0],
        "superframes_received": figures["superframes_received_total"],
        "superframes_lost": figures["superframes_lost_total"],
        "feed_bytes": feed,
        "media_bytes": media,
    }


def receive(codec: str) -> dict[str, float]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "cuecast", "watch", f"udp://127.0.0.1:{port}"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as box:
        try:
            assert box.stderr is not None
            address = next(
                found[0] for line in box.stderr if (found := re.search(r"http://\S+/", line))
            )
            return asyncio.run(measure(codec, box.pid, address, port))
        finally:
            box.terminate()


def test_share_of_a_core(benchmark: BenchmarkFixture) -> None:
    found: dict[str, dict[str, float]] = {}
    benchmark.pedantic(  # type: ignore[no-untyped-call]
        lambda: found.update({codec: receive(codec) for codec in ("aac", "mp2")}), rounds=1
    )
    REPORT.parent.mkdir(parents=True, exist_ok=True)
    REPORT.write_text(json.dumps(found, indent=1))
    print(json.dumps(found, indent=1))
    assert all(run["superframes_received"] > 50 for run in found.values())
    assert all(run["feed_bytes"] and run["media_bytes"] for run in found.values())
