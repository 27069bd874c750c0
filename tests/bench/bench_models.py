"""Speed of the models, as multiples of real time: reconstruct at 50 Hz, invert at 120 Hz."""

from typing import Any

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.drills import drill
from synth.studio.take import record

RATE_HZ = 120.0


def test_reconstruct(benchmark: Any) -> None:
    voice = load_voice()
    params = np.random.default_rng(0).normal(size=(1000, len(voice.layout)))
    benchmark.group = "models: reconstruct 20 s at 50 Hz"
    benchmark(voice.reconstruct, params)
    benchmark.extra_info["times_real_time"] = 20.0 / benchmark.stats["min"]


@pytest.mark.parametrize("hidden", [False, True])
def test_invert(benchmark: Any, hidden: bool) -> None:
    voice = load_voice()
    take = record(GestureSynthesiser(rate_hz=RATE_HZ), drill(2))
    markers = take.observed if hidden else take.truth
    benchmark.group = f"models: invert at 120 Hz, {'some markers hidden' if hidden else 'all seen'}"
    benchmark(voice.invert, markers, rate_hz=RATE_HZ)
    benchmark.extra_info["times_real_time"] = len(markers) / RATE_HZ / benchmark.stats["min"]
