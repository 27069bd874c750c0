"""Pictures for the tests of the video carrier, and its two ends."""

from functools import lru_cache
from typing import Any

import numpy as np

from tests.watermark.payloads import payloads
from watermark.link.superframe import ReceivedSuperframe
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import PROFILES
from watermark.video.receive import VideoReceiver

WIDTH, HEIGHT = 640, 360


def source(name: str = "standard") -> Any:
    profile = PROFILES[name]
    return payloads(profile.l0_bytes, profile.l1_bytes)


@lru_cache(maxsize=256)
def picture(
    n: int, width: int = WIDTH, height: int = HEIGHT, depth: int = 8, fps: float = 25
) -> np.ndarray:
    """Frame n of a moving scene with edges, grain and a cut after 2 s."""
    y, x = np.mgrid[:height, :width] / height
    t = n / fps
    scene = 120 + 60 * np.sin(9 * x + 2 * t) * np.cos(7 * y - t) + 30 * (x + y > 1 + 0.2 * t)
    if t > 2:
        scene = 255 - scene[::-1]
    grain = np.random.default_rng(n).normal(0, 2, scene.shape)
    top = 2**depth - 1
    luma = np.clip((scene + grain) * 2 ** (depth - 8), 0, top)
    return np.asarray(np.round(luma), dtype=np.uint8 if depth == 8 else np.uint16)


def mark(frames: list[np.ndarray], embedder: VideoEmbedder) -> list[np.ndarray]:
    marked = [out for frame in frames for out in embedder.process(frame)]
    return marked + embedder.flush()


def receive(frames: list[np.ndarray], receiver: VideoReceiver) -> list[ReceivedSuperframe]:
    found = [s for frame in frames for s in receiver.process(frame)]
    return found + receiver.flush()
