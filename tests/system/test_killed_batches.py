"""Batches whose processes are killed at random, on this machine and on a Dask cluster."""

from pathlib import Path

import pytest

from tests.bench.batches import cluster, killed

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc"),
]

RIGHT = {"status": 0, "missing_or_other": [], "made_twice": [], "left_over": []}


def test_killed_batches_lose_nothing(tmp_path: Path) -> None:
    found = killed(tmp_path, 24, 12, seed=3)
    assert {name: found[name] for name in RIGHT} == RIGHT
    assert sum(found["killed"].values()) == 12


def test_killed_workers_and_schedulers_lose_nothing(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    found = cluster(tmp_path, 12, 6, seed=3)
    assert {name: found[name] for name in RIGHT} == RIGHT
    assert found["killed"]["scheduler"] >= 1
    assert found["killed"]["worker"] >= 2
