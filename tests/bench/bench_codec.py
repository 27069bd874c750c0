"""Speed of the codec, as multiples of real time: 60 s of motion per round."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import Superframe
from synth.studio.recital import perform, recital, sentences

SUPERFRAMES = 94
REAL_TIME_S = SUPERFRAMES * 0.64


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice("claire")


@pytest.fixture(scope="module")
def motion(voice: Voice) -> Motion:
    return perform(voice, recital(sentences(held_out=True)[:20]), seed=7)


@pytest.fixture(scope="module")
def frames(voice: Voice, motion: Motion) -> list[Superframe]:
    encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7)
    return [encoder.encode(motion, k) for k in range(SUPERFRAMES)]


def report(benchmark: Any, run: Callable[[], object]) -> None:
    run()  # compiles outside the timing
    benchmark(run)
    benchmark.extra_info["times_real_time"] = REAL_TIME_S / benchmark.stats["mean"]
    print(f"\n{benchmark.name}: {benchmark.extra_info['times_real_time']:.0f} x real time")


def test_encode(benchmark: Any, voice: Voice, motion: Motion) -> None:
    encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7)
    report(benchmark, lambda: [encoder.encode(motion, k) for k in range(SUPERFRAMES)])


def test_encode_with_previews(benchmark: Any, voice: Voice, motion: Motion) -> None:
    encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7, protected=True)
    report(benchmark, lambda: [encoder.encode(motion, k) for k in range(SUPERFRAMES)])


def test_decode(benchmark: Any, voice: Voice, frames: list[Superframe]) -> None:
    def run() -> None:
        decoder = SuperframeDecoder(voice)
        for frame in frames:
            decoder.push(frame.l0, frame.l1, frame.index)

    report(benchmark, run)


def test_decode_and_reconstruct(benchmark: Any, voice: Voice, frames: list[Superframe]) -> None:
    def run() -> None:
        decoder = SuperframeDecoder(voice)
        decoded = [decoder.push(f.l0, f.l1, f.index).params for f in frames]
        voice.reconstruct(np.concatenate(decoded))

    report(benchmark, run)
