"""Time from the press of play to the first picture of the cuer, in Chromium beside `watch`.

In: a marked film. Out: for each of ``--runs`` fresh servers and browsers, seconds from `watch`'s
start to its address, from there until the film can play, and from play to the first picture with
the cuer; that picture's programme time. The last one is asked for within 2 s.
``python -m tests.bench.first_cue FILM [--runs 3]``
"""

import argparse
import asyncio
import json
import re
import sys
import time
from pathlib import Path

from tests.chromium import browse

PLAY = """new Promise((resolve) => {
    const begun = performance.now();
    const look = () => {
        if (cuecast.drawn.visibility > 0) {
            resolve(JSON.stringify([(performance.now() - begun) / 1000, cuecast.drawn.timeS]));
        } else requestAnimationFrame(look);
    };
    cuecast.video.play().then(look);
})"""


async def measure(film: Path) -> list[float]:
    """Return the three times in s and the programme's time of the first cue."""
    begun = time.monotonic()
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "cuecast", "watch", str(film), "--port", "0",
        stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        address = None
        while address is None:
            line = (await process.stderr.readline()).decode()
            if not line:
                raise SystemExit("watch ended")
            address = re.search(r"http://\S+", line)
        served = time.monotonic()
        async with browse(address[0]) as page:
            await page.until("window.cuecast && cuecast.video.readyState >= 3", 60)
            ready = time.monotonic()
            shown_s, at_s = json.loads(await page.evaluate(PLAY))
    finally:
        process.kill()
        await process.wait()
    return [served - begun, ready - served, shown_s, at_s]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("film", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    chosen = parser.parse_args()
    for _ in range(chosen.runs):
        times = asyncio.run(measure(chosen.film))
        print("address {:.2f} s, can play {:.2f} s, cue {:.2f} s (at {:.2f} s)".format(*times))


if __name__ == "__main__":
    main()
