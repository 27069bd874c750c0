"""Speed of the quality meter, as a multiple of real time."""

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from watermark.quality import grade

SECONDS = 5


def test_peaq_stereo(benchmark: BenchmarkFixture) -> None:
    reference = 0.1 * np.random.default_rng(1).standard_normal((SECONDS * 48_000, 2))
    grade(reference, reference, 48_000)
    benchmark(grade, reference, reference + 1e-3, 48_000)
    assert benchmark.stats is not None
    benchmark.extra_info["times_real_time"] = SECONDS / benchmark.stats.stats.median
