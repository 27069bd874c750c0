"""What the sound carrier costs, beside FFmpeg's own AAC encode of the same programme in one run.

In: a sound file; out: processor times as multiples of that encode's. Ratios hold on other machines
and under load, speeds do not. Run: ``python tests/bench/sound_cost.py CLIP``.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.sound_channels import encode
from watermark.audio.embed import AudioEmbedder
from watermark.audio.profile import FS, find_profile
from watermark.audio.receive import AudioReceiver

BLOCK = 4800
Sound = NDArray[np.float32]


def mark(x: Sound, profile: str, coder: str | None) -> Sound:
    """Mark a sound as `dub` does; `coder` as in `make_rehearsal`."""
    chosen, rng = find_profile(profile), np.random.default_rng(0)
    superframe = rng.bytes(chosen.l0_bytes), rng.bytes(chosen.l1_bytes)
    embedder = AudioEmbedder(
        FS, x.shape[1], lambda k: superframe, profile=profile,
        rehearsal=make_rehearsal(chosen, 0, coder),
    )  # fmt: skip
    parts = [embedder.process(x[i : i + BLOCK]) for i in range(0, len(x), BLOCK)]
    return np.concatenate([*parts, embedder.flush()])


def receive(x: Sound) -> int:
    """Superframes that are found."""
    receiver = AudioReceiver(FS, x.shape[1])
    parts = [receiver.process(x[i : i + BLOCK]) for i in range(0, len(x), BLOCK)]
    return sum(len(part) for part in parts) + len(receiver.flush())


def cost_s(work: Callable[[], object]) -> float:
    """Processor time, least of three."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clip", type=Path)
    parser.add_argument("--profile", default="standard")
    options = parser.parse_args()
    x, fs = soundfile.read(options.clip, dtype="float32", always_2d=True)
    if fs != FS:
        parser.error(f"{options.clip}: {fs} Hz, must be {FS}")
    marked = mark(x, options.profile, None)
    encoding = cost_s(partial(encode, x, FS, codec="aac", bit_rate=128_000))
    works: dict[str, Callable[[], object]] = {
        "mark without rehearsal": partial(mark, x, options.profile, "none"),
        "mark as dub does": partial(mark, x, options.profile, None),
        "receive": partial(receive, marked),
        "search unmarked sound": partial(receive, x),
    }
    seconds = len(x) / FS
    print(f"{seconds:.0f} s, one AAC encode: {seconds / encoding:.0f} times real time")
    for name, work in works.items():
        spent = cost_s(work)
        print(f"{name}: {spent / encoding:.2f} encodes, {seconds / spent:.0f} times real time")


if __name__ == "__main__":
    main()
