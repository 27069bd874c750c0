"""Intervals for counted losses."""

import math


def wilson_interval(count: int, total: int, *, deviations: float = 1.96) -> tuple[float, float]:
    """Interval of a probability of which `count` cases in `total` were seen.

    Parameters
    ----------
    count, total : int
        Cases and trials; no trials give the whole interval 0 to 1.
    deviations : float
        Half width in standard deviations; 1.96 for 95 %.

    Returns
    -------
    tuple of (float, float)
        Source: Wilson, J. Am. Stat. Assoc. 22 (1927).

    Examples
    --------
    >>> low, high = wilson_interval(0, 300)
    >>> round(low, 4), round(high, 4)
    (0.0, 0.0126)
    """
    if total == 0:
        return 0.0, 1.0
    z2 = deviations**2
    share = count / total
    centre = (share + z2 / (2 * total)) / (1 + z2 / total)
    half = deviations / (1 + z2 / total)
    half *= math.sqrt(share * (1 - share) / total + z2 / (4 * total**2))
    return max(0.0, centre - half), min(1.0, centre + half)
