"""Speed of the virtual cuer and of her studio, as a ratio to real time."""

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.drills import drill
from synth.studio.take import record

SCORE = drill(10, seed=1)
SECONDS = 20.0


@pytest.mark.parametrize("rate_hz", [50.0, 120.0])
def test_markers(benchmark: BenchmarkFixture, rate_hz: float) -> None:
    cuer = GestureSynthesiser(rate_hz=rate_hz)
    markers = benchmark(cuer.markers, SCORE, 0.0, round(SECONDS * rate_hz))
    assert len(markers)
    assert benchmark.stats is not None
    benchmark.extra_info["times_real_time"] = SECONDS / benchmark.stats.stats.median


def test_superframe_by_superframe(benchmark: BenchmarkFixture) -> None:
    cuer = GestureSynthesiser()

    def windows() -> None:
        for number in range(31):
            cuer.markers(SCORE, number * 0.64, 32)

    benchmark(windows)
    assert benchmark.stats is not None
    benchmark.extra_info["times_real_time"] = 31 * 0.64 / benchmark.stats.stats.median


def test_studio_at_120_hz(benchmark: BenchmarkFixture) -> None:
    cuer = GestureSynthesiser(rate_hz=120.0)
    take = benchmark(record, cuer, SCORE)
    assert benchmark.stats is not None
    benchmark.extra_info["times_real_time"] = len(take.truth) / 120.0 / benchmark.stats.stats.median
