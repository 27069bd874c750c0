"""What the sound carrier costs, beside FFmpeg's own AAC encode of the same programme in one run.

In: sound files; out: processor times as multiples of that encode's and how many times faster than
real time that is. Ratios hold on other machines and under load, speeds less so. Unmarked sound is
searched from its start, where rounds of guesses come thick, over several lengths; a file that is
shorter is repeated. Run: ``python tests/bench/sound_cost.py CLIP ...``; with ``--only search``
nothing is marked, which takes a fraction of the time.
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
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import FS, find_profile

BLOCK = 4800

SEARCHED_S = (20.0, 40.0, 160.0)
"""Lengths of unmarked sound, seconds: three rounds of guesses lie in the first 10 s, one in four
minutes later on."""

Sound = NDArray[np.float32]


def mark(x: Sound, profile: str, coder: str | None) -> Sound:
    """Mark a sound as `dub` does; `coder` as in `make_rehearsal`."""
    chosen, rng = find_profile(profile), np.random.default_rng(0)
    superframe = rng.bytes(chosen.l0_bytes), rng.bytes(chosen.l1_bytes)
    embedder = AudioEmbedder(
        FS,
        x.shape[1],
        lambda k: superframe,
        profile=profile,
        rehearsal=make_rehearsal(chosen, 0, coder),
    )
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


def lasting(x: Sound, seconds: float) -> Sound:
    """Return the first seconds of a sound, of a short one repeated."""
    count = round(seconds * FS)
    return np.tile(x, (-(-count // len(x)), 1))[:count]


def report(name: str, x: Sound, works: dict[str, Callable[[], object]]) -> None:
    """Print what works on a sound cost, beside its encode."""
    seconds = len(x) / FS
    encoding = cost_s(partial(encode, x, FS, codec="aac", bit_rate=128_000))
    print(f"{name}, {seconds:.0f} s: one AAC encode {seconds / encoding:.0f} times real time")
    for work_name, work in works.items():
        spent = cost_s(work)
        print(
            f"  {work_name}: {spent / encoding:.2f} encodes, {seconds / spent:.0f} times real time",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="clip")
    parser.add_argument("--profile", default="standard")
    parser.add_argument("--only", choices=["search"], help="leave the rest out")
    parser.add_argument(
        "--search-s",
        type=float,
        nargs="*",
        default=SEARCHED_S,
        metavar="SECONDS",
        help="lengths of unmarked sound, default: %(default)s",
    )
    options = parser.parse_args()
    for path in options.clips:
        x, fs = soundfile.read(path, dtype="float32", always_2d=True)
        if fs != FS:
            parser.error(f"{path}: {fs} Hz, must be {FS}")
        name = f"{path.stem}, {x.shape[1]} channels"
        receive(x[: 8 * FS])  # loops are compiled, tables made
        for seconds in options.search_s:
            part = lasting(x, seconds)
            report(name, part, {"search unmarked sound": partial(receive, part)})
        if options.only == "search":
            continue
        marked = mark(x, options.profile, None)
        works: dict[str, Callable[[], object]] = {
            "mark without rehearsal": partial(mark, x, options.profile, "none"),
            "mark as dub does": partial(mark, x, options.profile, None),
            "receive": partial(receive, marked),
        }
        report(name, x, works)


if __name__ == "__main__":
    main()
