"""Each way in takes its seeds, some hundred mutated inputs, and what once broke it."""

import numpy as np
import pytest

from tests.fuzz.archive import inputs
from tests.fuzz.mutate import mutated
from tests.fuzz.night import attempt
from tests.fuzz.targets import TARGETS

REGRESSIONS = {
    f"{target}-{name}": (target, data)
    for target in TARGETS
    for name, data in inputs(target, "regressions").items()
}
SLOW = {"live": 3, "media": 10, "command": 15, "superframes": 20, "tracker": 10, "proofs": 20}


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_and_some_mutants(name: str) -> None:
    rng = np.random.default_rng(list(TARGETS).index(name))
    target = TARGETS[name]
    seeds = target.seeds()
    assert seeds
    count = SLOW.get(name, 100)
    inputs = [*seeds[:20], *(mutated(seeds, rng, text=target.text) for _ in range(count))]
    for data in inputs:
        assert attempt(name, data) == ""


@pytest.mark.parametrize("name", REGRESSIONS)
def test_what_once_broke_a_target(name: str) -> None:
    assert attempt(*REGRESSIONS[name]) == ""
