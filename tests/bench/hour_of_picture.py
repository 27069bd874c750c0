"""An hour of 1080p through embedder and receiver, without the picture codec: memory and losses.

    python tests/bench/hour_of_picture.py --clip ../shared/data/video/bbb_720p25.mp4

A clip's first seconds, made larger, go round and round. Every minute of picture a line tells what
arrived, how much memory the process holds and how fast it is. Exit status 1 if a superframe was
lost or memory grew.
"""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from watermark.link.superframe import SUPERFRAME_S
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import PROFILES
from watermark.video.receive import VideoReceiver

WIDTH, HEIGHT, FPS = 1920, 1080, 25
SCENE = 50  # frames that go round: two seconds


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clip", type=Path, required=True)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--profile", default="standard", choices=PROFILES)
    options = parser.parse_args()
    profile, minutes = PROFILES[options.profile], round(60 * options.hours)

    def payload(k: int) -> tuple[bytes, bytes]:
        rng = np.random.default_rng(k)
        return rng.bytes(profile.l0_bytes), rng.bytes(profile.l1_bytes)

    embedder = VideoEmbedder(WIDTH, HEIGHT, FPS, payload, profile=profile.name)
    receiver = VideoReceiver(WIDTH, HEIGHT, FPS)
    lumas, arrived, resident_mb = scene(options.clip), 0, []
    for minute in range(1, minutes + 1):
        began = time.process_time()
        for luma in islice(lumas, 60 * FPS):
            for marked in embedder.process(luma):
                for found in receiver.process(marked):
                    k = round(found.position_s / SUPERFRAME_S)
                    arrived += (found.l0, found.l1) == payload(k)
        resident_mb.append(resident())
        speed = 60 / (time.process_time() - began)
        print(
            f"{minute} min: {arrived} superframes, {resident_mb[-1]:.1f} MB, {speed:.1f} times "
            f"real time, PSNR {embedder.report().psnr_db:.2f} dB",
            flush=True,
        )
    # The last two are still on their way.
    lost = embedder.report().superframes - arrived - 2
    print(f"lost: {max(0, lost)} of {embedder.report().superframes}")
    return int(lost > 0 or resident_mb[-1] > 1.02 * resident_mb[0])


def scene(clip: Path) -> Iterator[NDArray[Any]]:
    """Yield the clip's first frames again and again, at full size."""
    with av.open(str(clip)) as container:
        frames = [
            f.reformat(WIDTH, HEIGHT, format="yuv420p").to_ndarray()[:HEIGHT]
            for f in islice(container.decode(video=0), SCENE)
        ]
    # The embedder keeps what it is given for a while, so that each is a copy.
    return (frames[n % SCENE].copy() for n in count())


def resident() -> float:
    """Memory of this process in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    sys.exit(main())
