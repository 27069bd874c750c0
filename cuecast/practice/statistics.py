"""Sensitivity of an observer: d' of two-alternative answers, its interval, and power.

A trial shows one item and offers two words, one on each side; the side is drawn at random. The
observer is a detector of "the left word was cued": hits are answers "left" to items of the left
word, false alarms are answers "left" to items of the right one. With equal normal distributions
d' = z(hits) - z(false alarms), free of a preference for a side (Green and Swets 1966; Macmillan
and Creelman 2005, chapters 1 and 2). d' of 0 is guessing; an observer without a preference is
right in a share of Phi(d' / 2): .84 at d' = 2.
"""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats
from scipy.optimize import brentq

from codec.errors import CueError

LEVEL = 0.95
"""Confidence of intervals unless stated otherwise."""

_JEFFREYS = 0.5
"""Both parameters of the prior of a share (Jeffreys)."""

_NODES = 200
"""Quantiles of the shares that stand for their distributions."""

_FARTHEST = 8.0
"""Largest d' that an interval can reach: far beyond what any number of trials can show."""


@dataclass(frozen=True, slots=True)
class Counts:
    """Answers of an observer in one condition.

    Attributes
    ----------
    hits, left : int
        Answers "left" where the left word was right, and how often it was.
    false_alarms, right : int
        Answers "left" where the right word was right, and how often it was.
    """

    hits: int
    left: int
    false_alarms: int
    right: int

    def __post_init__(self) -> None:
        for name, found, total in (
            ("hits", self.hits, self.left),
            ("false alarms", self.false_alarms, self.right),
        ):
            if not 0 <= found <= total:
                raise CueError(f"{found} {name} of {total} trials")

    @property
    def trials(self) -> int:
        """Trials of both sides."""
        return self.left + self.right

    @property
    def correct(self) -> int:
        """Right answers."""
        return self.hits + self.right - self.false_alarms


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its interval.

    Attributes
    ----------
    value, low, high : float
    """

    value: float
    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        """Return whether the interval holds a value."""
        return self.low <= value <= self.high


def d_prime(counts: Counts, *, level: float = LEVEL) -> Estimate:
    """Return d' of one observer in one condition, with its credible interval.

    The shares of hits and of false alarms have independent beta distributions given the counts
    (Jeffreys' prior, Brown, Cai and DasGupta 2001 for its coverage); the interval holds the middle
    `level` of the distribution of z(hits) - z(false alarms), found by integration. The value is
    that of the shares (count + 0.5) / (trials + 1) (Hautus 1995), finite where no answer was wrong.

    Raises
    ------
    CueError
        If a side was never right: nothing is known of its answers.

    Examples
    --------
    >>> found = d_prime(Counts(hits=17, left=20, false_alarms=3, right=20))
    >>> round(found.value, 2), found.low < 1 < found.high, found.low > 0
    (1.93, False, True)
    """
    if min(counts.left, counts.right) < 1:
        raise CueError("d' needs at least one trial of each side")
    hits = stats.norm.ppf((counts.hits + 0.5) / (counts.left + 1))
    false_alarms = stats.norm.ppf((counts.false_alarms + 0.5) / (counts.right + 1))
    low, high = _interval(counts, level)
    return Estimate(float(hits - false_alarms), low, high)


@functools.lru_cache(maxsize=4096)
def _interval(counts: Counts, level: float) -> tuple[float, float]:
    shares = (np.arange(_NODES) + 0.5) / _NODES
    a, b = counts.false_alarms + _JEFFREYS, counts.right - counts.false_alarms + _JEFFREYS
    false_alarms = special.ndtri(special.betaincinv(a, b, shares))
    a, b = counts.hits + _JEFFREYS, counts.left - counts.hits + _JEFFREYS

    def below(d: float) -> float:
        return float(np.mean(special.betainc(a, b, special.ndtr(false_alarms + d))))

    tail = (1 - level) / 2
    low, high = (
        float(brentq(lambda d, share=share: below(d) - share, -_FARTHEST, _FARTHEST, xtol=1e-4))
        for share in (tail, 1 - tail)
    )
    return low, high


def share_right(right: int, trials: int, *, level: float = LEVEL) -> Estimate:
    """Return the share of right answers with its Wilson interval (Wilson 1927).

    Examples
    --------
    >>> share_right(8, 10).value
    0.8
    """
    if not 0 <= right <= trials or trials < 1:
        raise CueError(f"{right} right answers of {trials}")
    interval = stats.binomtest(right, trials).proportion_ci(level, method="wilson")
    return Estimate(right / trials, float(interval.low), float(interval.high))


def mean_of(values: Sequence[float], *, level: float = LEVEL) -> Estimate:
    """Return the mean over observers with Student's interval; infinite for a single observer.

    Raises
    ------
    CueError
        If there are no values.

    Examples
    --------
    >>> mean_of([1.0, 2.0, 3.0]).value
    2.0
    """
    x = np.asarray(values, dtype=np.float64)
    if x.size == 0:
        raise CueError("a mean needs at least one observer")
    mean = float(x.mean())
    if x.size == 1:
        return Estimate(mean, -math.inf, math.inf)
    half = float(stats.t.ppf((1 + level) / 2, x.size - 1) * stats.sem(x))
    return Estimate(mean, mean - half, mean + half)


def variance_of(d: float, trials: int) -> float:
    """Return the variance of the d' that `d_prime` finds in one condition.

    Exact for an observer without a preference: every pair of counts, with its probability.

    Parameters
    ----------
    d : float
        The observer's d'.
    trials : int
        Half of them of each side; an even number, at least 2.
    """
    if trials < 2 or trials % 2:
        raise CueError(f"{trials} trials a condition: an even number of at least 2 is needed")
    half = trials // 2
    count = np.arange(half + 1)
    z: NDArray[np.float64] = stats.norm.ppf((count + 0.5) / (half + 1))
    share = stats.binom.pmf(count, half, stats.norm.cdf(d / 2))
    mean = float(share @ z)
    return 2 * float(share @ (z - mean) ** 2)


def power(
    d: float, other: float, *, trials: int, observers: int, spread: float, level: float = LEVEL
) -> float:
    """Return how likely a paired t-test over observers finds a difference of two conditions.

    Parameters
    ----------
    d, other : float
        Mean d' of the observers in the two conditions.
    trials : int
        Trials of each condition for each observer, even.
    observers : int
        At least 2.
    spread : float
        Standard deviation over observers of the difference of their true d'.
    level : float
        1 - the risk of finding a difference where there is none; two-sided.

    Returns
    -------
    float
        By the noncentral t distribution.

    Examples
    --------
    >>> round(power(0.1, 1.5, trials=10, observers=8, spread=0.5), 2)
    0.75
    """
    if observers < 2:
        raise CueError(f"{observers} observers: at least 2 are needed")
    if spread < 0:
        raise CueError(f"a standard deviation of {spread:g} is negative")
    difference = _expected(d, trials) - _expected(other, trials)
    variance = spread**2 + variance_of(d, trials) + variance_of(other, trials)
    shift = difference / math.sqrt(variance / observers)
    bound = float(stats.t.ppf((1 + level) / 2, observers - 1))
    t = stats.nct(observers - 1, shift)
    return float(t.sf(bound) + t.cdf(-bound))


def _expected(d: float, trials: int) -> float:
    """Return the mean of the estimates, which few trials draw towards 0."""
    half = trials // 2
    count = np.arange(half + 1)
    z = stats.norm.ppf((count + 0.5) / (half + 1))
    return 2 * float(stats.binom.pmf(count, half, stats.norm.cdf(d / 2)) @ z)
