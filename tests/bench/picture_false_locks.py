"""Unmarked pictures through the search: places tried, superframes accepted, speed.

    python -m tests.bench.picture_false_locks --hours 10 FILM...

Parts of the films, mirrored, shifted in brightness, faster or slower and cut differently, follow
one another, at 640x360 unless told. Then soft values without a message, which is what an unmarked
picture at any place gives, go through the decoders of all profiles (--noise). Exit status 1 if
anything was accepted; --record FILE is for the pages.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cuecast.evaluate.records import make_record
from receiver.media.picture import read_lumas
from watermark.link.link import Link
from watermark.video._place_kernels import resample_into
from watermark.video.places import source_taps
from watermark.video.profile import DATA, LONE, PROFILES
from watermark.video.receive import VideoReceiver

SCENE = 80  # frames of a scene


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--hours", type=float, default=10.0)
    parser.add_argument("--noise", type=int, default=1_000_000, help="superframes of noise")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", default="640x360", help="pixels of what is shown")
    parser.add_argument("--fps", type=int, default=25, help="its frames per second")
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    films = [[luma for _, luma in read_lumas(path)] for path in options.films]
    width, height = map(int, options.size.split("x"))
    fps = options.fps
    receiver = VideoReceiver(width, height, fps)
    accepted, frames, used_s = 0, 0, 0.0
    while frames < options.hours * 3600 * fps:
        for luma in scene(films[rng.integers(len(films))], (height, width), rng):
            began = time.process_time()
            accepted += sum(s.l0 is not None for s in receiver.process(luma))
            used_s += time.process_time() - began
            frames += 1
        if frames % (60 * fps) < SCENE:
            print(
                f"{frames / fps / 3600:.3f} h: {accepted} accepted, "
                f"{frames / fps / used_s:.1f} times real time",
                flush=True,
            )
    wrong = noise(options.noise, rng)
    print(f"{options.noise} superframes of noise: {wrong} accepted")
    if options.record:
        row = {
            "carrier": "picture", "shown": f"{options.size}p{fps}",
            "hours": round(frames / fps / 3600, 3), "accepted": accepted,
            "times_real_time": round(frames / fps / used_s, 1),
            "random": options.noise, "random_accepted": wrong,
        }  # fmt: skip
        folders = [each.parent for each in options.films]
        document = make_record("false_locks", (), [row], seed=options.seed, clips=folders)
        document["command"] = (
            f"python -m tests.bench.picture_false_locks CLIPS --hours {options.hours:g} "
            f"--noise {options.noise} --seed {options.seed} --size {options.size} --fps {fps} "
            "--record FILE"
        )
        options.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return int(accepted + wrong > 0)


def scene(
    film: list[np.ndarray], shape: tuple[int, int], rng: np.random.Generator
) -> list[np.ndarray]:
    """Show a part of a film, at another size, mirrored or not, brighter or darker."""
    rows, columns = film[0].shape
    height = int(rows * rng.uniform(0.5, 1))
    width = int(columns * rng.uniform(0.5, 1))
    top, left = rng.integers(rows - height + 1), rng.integers(columns - width + 1)
    gain, offset = rng.uniform(0.6, 1.1), rng.uniform(-15, 15)
    turn = rng.choice([1, -1], size=2)
    down = source_taps(shape[0], rows, float(top), float(height))
    across = source_taps(shape[1], columns, float(left), float(width))
    place, speed = rng.uniform(0, len(film)), rng.choice([0.0, 0.5, 1.0, 2.0])
    shown: list[NDArray[np.uint8]] = []
    for n in range(SCENE):
        if n and not speed:
            shown.append(shown[0])
            continue
        luma = film[int(place + n * speed) % len(film)][:: turn[0], :: turn[1]]
        picture = np.ascontiguousarray(luma, dtype=np.float32)
        out = np.empty(shape, dtype=np.float32)
        resample_into(picture, *down, *across, 0, out)
        shown.append(np.clip(gain * out + offset, 16, 235).astype(np.uint8))
    return shown


def noise(count: int, rng: np.random.Generator) -> int:
    """Accepted among `count` superframes of Gaussian soft values, shared among the profiles."""
    links = [Link(profile) for profile in (*PROFILES.values(), LONE)]
    decoded = (links[n % len(links)].decode(rng.normal(0, 2, DATA)) for n in range(count))
    return sum(each.l0 is not None for each in decoded)


if __name__ == "__main__":
    sys.exit(main())
