"""d' and its interval against an observer of known sensitivity."""

import itertools

import numpy as np
import pytest
from scipy import stats

from codec.errors import CueError
from cuecast.practice.pairs import PairsPlan
from cuecast.practice.results import counts_of, figures
from cuecast.practice.session import read_answers
from cuecast.practice.statistics import Counts, d_prime, mean_of, power, share_right
from cuecast.practice.trial import ANSWERS, ITEMS, Trial
from tests.cuecast.practice.observer import Observer

SENSITIVITIES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)


@pytest.mark.parametrize("half", [5, 10])
@pytest.mark.parametrize("preference", [0.0, 0.5])
def test_intervals_cover_at_their_rate(half: int, preference: float) -> None:
    # Exact: every outcome of `half` trials a side, with its probability. Measured .919 to .985.
    found = {
        (h, f): d_prime(Counts(h, half, f, half))
        for h, f in itertools.product(range(half + 1), repeat=2)
    }
    covered = []
    for d in SENSITIVITIES:
        hits = stats.binom.pmf(np.arange(half + 1), half, stats.norm.cdf(d / 2 - preference))
        alarms = stats.binom.pmf(np.arange(half + 1), half, stats.norm.cdf(-d / 2 - preference))
        covered.append(sum(hits[h] * alarms[f] for (h, f), one in found.items() if d in one))
    assert min(covered) > 0.91
    assert 0.94 < np.mean(covered) < 0.985


def test_a_narrower_level_covers_less() -> None:
    counts = Counts(15, 20, 6, 20)
    wide, narrow = d_prime(counts), d_prime(counts, level=0.5)
    assert wide.low < narrow.low < narrow.value < narrow.high < wide.high


def test_extreme_counts_stay_finite() -> None:
    perfect = d_prime(Counts(20, 20, 0, 20))
    assert 3 < perfect.value < perfect.high < 8
    assert perfect.low > 2
    with pytest.raises(CueError, match="at least one trial of each side"):
        d_prime(Counts(0, 0, 1, 5))
    with pytest.raises(CueError, match="6 hits of 5 trials"):
        Counts(6, 5, 0, 5)


def test_power_is_the_share_of_significant_trials() -> None:
    rng = np.random.default_rng(3)
    people, half, runs, spread = 8, 5, 1500, 0.5
    second = 1.5 + spread * rng.standard_normal((runs, people))
    difference = np.zeros((runs, people))
    for sign, d in ((-1, np.full((runs, people), 0.2)), (1, second)):
        hits = rng.binomial(half, stats.norm.cdf(d / 2))
        alarms = rng.binomial(half, stats.norm.cdf(-d / 2))
        shares = [(x + 0.5) / (half + 1) for x in (hits, alarms)]
        difference += sign * (stats.norm.ppf(shares[0]) - stats.norm.ppf(shares[1]))
    seen = np.mean(stats.ttest_1samp(difference, 0, axis=1).pvalue < 0.05)
    told = power(0.2, 1.5, trials=2 * half, observers=people, spread=spread)
    assert told == pytest.approx(seen, abs=0.05)
    with pytest.raises(CueError, match="an even number"):
        power(0, 1, trials=5, observers=4, spread=0)
    with pytest.raises(CueError, match="1 observers"):
        power(0, 1, trials=4, observers=1, spread=0)


def test_means_and_shares() -> None:
    assert mean_of([2.0]).high == np.inf
    assert 1.0 in mean_of([0.5, 1.0, 1.6])
    half = share_right(10, 20)
    assert half.low < 0.5 < half.high
    with pytest.raises(CueError, match="at least one observer"):
        mean_of([])
    with pytest.raises(CueError, match="3 right answers of 2"):
        share_right(3, 2)


@pytest.fixture
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    """A test of two conditions with 40 trials each; its motions are never looked at."""
    folder = tmp_path_factory.mktemp("trial")
    for name in (ITEMS, ANSWERS):
        (folder / name).mkdir()
    plan = PairsPlan(displays=("points",), channels=("clear",), trials=40)
    pool = [
        {"words": [f"a{i}", f"b{i}"], "motions": {"clear": ["none", "none"]}} for i in range(30)
    ]
    settings = {
        "hands": plan.hands,
        "displays": plan.displays,
        "channels": plan.channels,
        "trials": plan.trials,
    }
    return Trial(folder, "pairs", "claire", 5, settings, pool)


def test_forty_trials_give_the_sensitivity_of_the_observer(trial: Trial) -> None:
    rng = np.random.default_rng(11)
    inside = {"hand": 0, "lips": 0}
    people = 20
    for _ in range(people):
        session = Observer(2.0, 0.0, rng, preference=0.3).take(trial)
        rows = read_answers(session.path)
        assert len(rows) == 80
        for hand, d in (("hand", 2.0), ("lips", 0.0)):
            counts = counts_of([row for row in rows if row["hand"] == hand])
            assert counts.left == counts.right == 20
            inside[hand] += d in d_prime(counts)
    # 20 intervals of 95 %: fewer than 16 inside has a probability below .003.
    assert min(inside.values()) >= 16
    found = figures(trial)
    by_hand = {row["hand"]: row for row in found["conditions"]}
    assert by_hand["hand"]["d_prime_pooled"][1] < 2.0 < by_hand["hand"]["d_prime_pooled"][2]
    assert by_hand["lips"]["d_prime_pooled"][1] < 0.0 < by_hand["lips"]["d_prime_pooled"][2]
    (compared,) = found["comparisons"]
    assert compared["participants"] == people
    assert compared["difference"][1] > 1.5
    assert compared["p"] < 1e-9
