"""Speed of the audio carrier: one second of stereo at 48 kHz per second is real time."""

from typing import Any

import numpy as np
import pytest

from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import PROFILES
from watermark.link.polar import make_code

FS, SECONDS = 48000, 10


def programme() -> np.ndarray:
    spectrum = np.fft.rfft(np.random.default_rng(0).standard_normal((SECONDS * FS, 2)), axis=0)
    spectrum /= np.sqrt(np.maximum(np.arange(len(spectrum)), 200.0))[:, np.newaxis]
    x = np.fft.irfft(spectrum, axis=0)
    return np.asarray(0.07 * x / x.std(), dtype=np.float32)


def embed(x: np.ndarray, profile: str) -> np.ndarray:
    p = PROFILES[profile]
    source = bytes(p.l0_bytes), bytes(p.l1_bytes)
    embedder = AudioEmbedder(FS, 2, lambda k: source, profile=profile)
    return np.concatenate([embedder.process(x), embedder.flush()])


def receive(x: np.ndarray) -> int:
    receiver = AudioReceiver(FS, 2)
    return len(receiver.process(x)) + len(receiver.flush())


def state(benchmark: Any) -> None:
    benchmark.extra_info["times_real_time"] = SECONDS / benchmark.stats["mean"]


@pytest.mark.parametrize("profile", PROFILES)
def test_embed(benchmark: Any, profile: str) -> None:
    benchmark.pedantic(embed, (programme(), profile), rounds=3, warmup_rounds=1)
    state(benchmark)


@pytest.mark.parametrize("profile", PROFILES)
def test_receive(benchmark: Any, profile: str) -> None:
    benchmark.pedantic(receive, (embed(programme(), profile),), rounds=3, warmup_rounds=1)
    state(benchmark)


def test_search_unmarked(benchmark: Any) -> None:
    benchmark.pedantic(receive, (programme(),), rounds=3, warmup_rounds=1)
    state(benchmark)


def test_list_decoder(benchmark: Any) -> None:
    code, rng = make_code(184, 1536), np.random.default_rng(0)
    benchmark(code.decode, rng.standard_normal(1536), accept=lambda message: False)
