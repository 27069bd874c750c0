"""Units near their own durations, on the clock of the score."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from synth.units.concatenation.durations import near_own_durations
from synth.units.concatenation.sounds import PlacedUnit
from synth.units.concatenation.units import Unit

parts = st.lists(st.tuples(st.floats(0.01, 0.4), st.floats(0.005, 0.4)), min_size=2, max_size=40)


def placed(pairs: list[tuple[float, float]], start_s: float = 1.0) -> list[PlacedUnit]:
    """Return units of two parts, (recorded, wanted) seconds each, without a gap."""
    units, time = [], start_s
    for (a, x), (b, y) in zip(pairs[::2], pairs[1::2], strict=False):
        target = Unit(("a", "b"), (time, time + x, time + x + y))
        units.append(PlacedUnit(0, Unit(("a", "b"), (0.0, a, a + b)), target))
        time = target.edges_s[-1]
    return units


def edges(units: list[PlacedUnit]) -> NDArray[np.float64]:
    return np.concatenate([unit.target.edges_s for unit in units])


def change(units: list[PlacedUnit]) -> NDArray[np.float64]:
    pairs = [(u.target.parts_s, u.source.parts_s) for u in units]
    wanted, own = (np.concatenate(line) for line in zip(*pairs, strict=True))
    return np.asarray(np.log(wanted / own))


@settings(max_examples=60)
@given(parts)
def test_a_stretch_keeps_its_clock(pairs: list[tuple[float, float]]) -> None:
    units = placed(pairs)
    moved = near_own_durations(units)
    before, after = edges(units), edges(moved)
    assert (after[[0, -1]] == before[[0, -1]]).all()
    assert np.abs(after - before).max() <= 0.05 + 1e-9
    for unit, was in zip(moved, units, strict=True):
        assert unit.source is was.source
        assert (np.array(unit.target.parts_s) >= 0.25 * np.array(was.target.parts_s) - 1e-9).all()


def test_parts_are_changed_more_evenly() -> None:
    random = np.random.default_rng(5)
    own = random.uniform(0.03, 0.08, 60)
    wanted = own * random.uniform(0.6, 1.4, 60)
    units = placed(list(zip(own.tolist(), wanted.tolist(), strict=True)))
    # Measured: 0.24 before, 0.14 after.
    assert change(near_own_durations(units)).std() < 0.7 * change(units).std()


@pytest.mark.parametrize("rate", [0.7, 1.0, 1.5])
def test_own_durations_at_any_rate_stay(rate: float) -> None:
    units = placed([(a, a * rate) for a in (0.05, 0.1, 0.03, 0.2)])
    np.testing.assert_allclose(edges(near_own_durations(units)), edges(units), atol=1e-9)


def test_silence_divides() -> None:
    first = placed([(0.1, 0.05), (0.1, 0.15)])
    later = placed([(0.1, 0.15), (0.1, 0.05)], start_s=3.0)
    together = near_own_durations([*first, *later])
    assert together == [*near_own_durations(first), *near_own_durations(later)]
    assert near_own_durations([]) == []
