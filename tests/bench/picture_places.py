"""Marked films at places drawn at random: how soon the search finds each of them.

    python tests/bench/picture_places.py --places 24 FILM...

Each side loses 0 to 5 %; every second picture is then scaled to .6 to 1 in each direction and put
anywhere into a black one. Coded by x264 (veryfast, 2 Mbit/s) at 1280x720, tuned in anywhere in a
superframe. A place is found where L0 of a superframe has arrived.
"""

import argparse
import sys
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from receiver.media.picture import read_lumas
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import PROFILES
from watermark.video.receive import VideoReceiver

WIDTH, HEIGHT, FPS = 1280, 720, 25
FRAMES = 88


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("films", type=Path, nargs="+")
    parser.add_argument("--places", type=int, default=24)
    parser.add_argument("--seed", type=int, default=35)
    options = parser.parse_args()
    late = 0
    for path in options.films:
        rng = np.random.default_rng(options.seed)
        frames = mark(path)
        times = [place(frames, rng, boxed=bool(n % 2)) for n in range(options.places)]
        for boxed in (0, 1):
            mine = np.array(times[boxed::2])
            print(
                f"{path.stem} {'in bars' if boxed else 'cropped'}: {np.sum(mine <= 2)} of "
                f"{mine.size} within 2 s, median {np.median(mine):.2f} s, "
                f"lost {np.isinf(mine).sum()}",
                flush=True,
            )
            late += int(np.sum(mine > 2))
    return int(late > 0)


def payload(k: int) -> tuple[bytes, bytes]:
    """Random classes of superframe k."""
    rng, profile = np.random.default_rng(k), PROFILES["standard"]
    return rng.bytes(profile.l0_bytes), rng.bytes(profile.l1_bytes)


def mark(path: Path) -> list[np.ndarray]:
    """Return the first frames of a film, marked."""
    frames = [luma for (_, luma), _ in zip(read_lumas(path), range(FRAMES), strict=False)]
    embedder = VideoEmbedder(frames[0].shape[1], frames[0].shape[0], FPS, payload)
    marked = [ready for luma in frames for ready in embedder.process(luma)]
    return marked + embedder.flush()


def place(frames: list[np.ndarray], rng: np.random.Generator, *, boxed: bool) -> float:
    """Seconds of coded picture until the first superframe, infinite if none came."""
    rows, columns = frames[0].shape
    lost = rng.uniform(0, 0.05, 4) * [columns, columns, rows, rows]
    left, right, top, bottom = lost.astype(int)
    scale = rng.uniform(0.6, 1, 2) if boxed else np.ones(2)
    width, height = (scale * [WIDTH, HEIGHT]).astype(int)
    x, y = rng.integers(WIDTH - width + 1), rng.integers(HEIGHT - height + 1)
    start = int(rng.integers(16))
    shown = []
    for frame in frames[start:]:
        cut = np.ascontiguousarray(frame[top : rows - bottom, left : columns - right])
        scaled = av.VideoFrame.from_ndarray(cut, format="gray").reformat(
            width=int(width), height=int(height), interpolation="BICUBIC"
        )
        picture = np.full((HEIGHT, WIDTH), 16, dtype=np.uint8)
        picture[y : y + height, x : x + width] = scaled.to_ndarray()
        shown.append(picture)
    receiver = VideoReceiver(WIDTH, HEIGHT, FPS)
    for n, luma in enumerate(code(shown)):
        for superframe in receiver.process(luma):
            k = round(superframe.position_s / 0.64 + start / (0.64 * FPS))
            if superframe.l0 == payload(k)[0]:
                return (n + 1) / FPS
    return float("inf")


def code(frames: list[np.ndarray]) -> list[np.ndarray]:
    """Send luma through x264."""
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = WIDTH, HEIGHT, "yuv420p"
    encoder.framerate, encoder.bit_rate = Fraction(FPS), 2_000_000
    encoder.options = {"preset": "veryfast"}
    decoder = av.CodecContext.create("h264", "r")
    packets = []
    for luma in frames:
        grey = np.concatenate([luma, np.full((HEIGHT // 2, WIDTH), 128, dtype=np.uint8)])
        packets += encoder.encode(av.VideoFrame.from_ndarray(grey, format="yuv420p"))
    packets += encoder.encode(None)
    decoded = [frame for packet in packets for frame in decoder.decode(packet)]
    decoded += decoder.decode(None)
    return [frame.to_ndarray()[:HEIGHT].copy() for frame in decoded]


if __name__ == "__main__":
    sys.exit(main())
