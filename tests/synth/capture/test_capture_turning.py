"""The turn of the palm tells placements apart, where the take has shown that the cuer turns it."""

import numpy as np
import pytest

from codec.cues.score import PLACEMENT_NUMBER
from synth.capture.cues.turning import turn_of, turned

SIDE, MOUTH, THROAT = (PLACEMENT_NUMBER[name] for name in ("side", "mouth", "throat"))
PLACES = [SIDE, MOUTH, SIDE, THROAT] * 5
NARROW = {SIDE: 1.04, MOUTH: 0.94, THROAT: 0.91}


def widths(turn: float) -> np.ndarray:
    """Return the palm's width at each key of a cuer who turns her hand so much."""
    noise = 0.03 * np.random.default_rng(1).normal(size=len(PLACES))
    return 1.0 + turn * np.array([NARROW[place] - 1.0 for place in PLACES]) + noise


def test_a_hand_that_turns_counts() -> None:
    assert turn_of(widths(1.0), PLACES) == pytest.approx(1.0)


@pytest.mark.parametrize("turn", [0.0, -1.0])
def test_a_hand_that_does_not_or_the_other_way_counts_nothing(turn: float) -> None:
    assert turn_of(widths(turn), PLACES) == 0.0


def test_without_keys_nothing_is_told() -> None:
    assert turn_of(np.array([]), []) == 0.0


def test_a_narrow_palm_is_not_at_the_side() -> None:
    likely = turned(np.array([0.92, 1.03]), [MOUTH, THROAT], SIDE)
    assert likely.shape == (2, 8)
    assert likely[0, THROAT] > likely[0, SIDE] + 1.0
    assert likely[1, SIDE] > likely[1, THROAT] + 1.0
    # Half way to the side the palm is half turned.
    assert likely[0, THROAT] > likely[0, 7] > likely[0, SIDE]


def test_no_width_rules_a_placement_out() -> None:
    assert np.abs(turned(np.array([0.1, 3.0]), [MOUTH], SIDE)).max() < 12.0
