"""Speed of the video carriers at 720p25, as a multiple of real time."""

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from watermark.a335.carrier import A335Embedder, A335Receiver
from watermark.video.embed import VideoEmbedder
from watermark.video.receive import VideoReceiver

FPS, FRAMES = 25, 50
EMBEDDERS = {"invisible": (VideoEmbedder, "standard", 140), "a335": (A335Embedder, "1x", 39)}
RECEIVERS = {"invisible": VideoReceiver, "a335": A335Receiver}


@pytest.fixture(scope="module")
def frames() -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return [rng.integers(16, 235, (720, 1280)).astype(np.uint8) for _ in range(FRAMES)]


def mark(frames: list[np.ndarray], carrier: str) -> list[np.ndarray]:
    kind, profile, l1_bytes = EMBEDDERS[carrier]
    embedder = kind(1280, 720, FPS, lambda k: (bytes(20), bytes(l1_bytes)), profile=profile)
    marked: list[np.ndarray] = []
    for frame in frames:
        marked += embedder.process(frame)
    return marked


def read(frames: list[np.ndarray], carrier: str) -> None:
    receiver = RECEIVERS[carrier](1280, 720, FPS)
    for frame in frames:
        receiver.process(frame)


@pytest.mark.parametrize("carrier", EMBEDDERS)
def test_embed(benchmark: BenchmarkFixture, frames: list[np.ndarray], carrier: str) -> None:
    benchmark(mark, frames, carrier)
    assert benchmark.stats is not None
    benchmark.extra_info["times_real_time"] = FRAMES / FPS / benchmark.stats.stats.median


@pytest.mark.parametrize("carrier", RECEIVERS)
def test_receive(benchmark: BenchmarkFixture, frames: list[np.ndarray], carrier: str) -> None:
    marked = mark(frames, carrier)
    benchmark(read, marked, carrier)
    assert benchmark.stats is not None
    benchmark.extra_info["times_real_time"] = FRAMES / FPS / benchmark.stats.stats.median
