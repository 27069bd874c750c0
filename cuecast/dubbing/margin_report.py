"""The margin of a rehearsed sound: figures for the report, warnings, and what would help.

In: the margin of each superframe, see `AudioEmbedder.margins`; out: the object ``margin`` of the
report of ``dub``, and its lines of text. A margin of 1 is as much information as the bits of the
message and its checks: of 287 superframes of seven programmes through the named coder, with other
payloads, 47 of 49 below 1 were lost, 2 of 18 from 1 to 1.3, none above.
"""

import math
import statistics
from collections.abc import Sequence
from typing import Any

from watermark.audio.embed.level_control import GRADES_PER_LEVEL
from watermark.audio.embed.levels import LEVELS_PER_DOUBLING
from watermark.audio.embed.report import SuperframeMargin
from watermark.link.superframe import SUPERFRAME_S

LOW = 1.5
"""Margin below which the report warns."""

JOINED_S = 2.0
"""Low passages that are closer than this are reported as one."""

LONGEST_WARNING = 6
"""Low passages that are warned of one by one, the lowest ones."""

LOWEST_GRADE = -1.0
"""Grades below are not advised."""

ROBUST_GAIN = 2.0
"""Margin of `robust` over that of `standard` at one grade: 1.5 to 2.3 in the median of four clips
through AAC at 128 kbit/s, 1.3 to 2.8 at their lowest."""

NOT_REHEARSED: dict[str, Any] = {"low": [], "helps": []}
"""Figures of a mark without a rehearsal, for `in_words`."""


def margin_figures(
    margins: Sequence[SuperframeMargin], begin_s: float, *, through: str, profile: str, grade: float
) -> dict[str, Any]:
    """Return the object ``margin`` of the report.

    Parameters
    ----------
    margins : sequence of SuperframeMargin
        Not empty.
    begin_s : float
        Start of superframe 0 on the programme's clock.
    through : str
        Coders of the rehearsal.
    profile : str
        Of the mark.
    grade : float
        Lowest grade that the embedder aimed at.

    Returns
    -------
    dict
        ``through``, ``limit``, ``least``, ``median``; ``superframes``, pairs of start in seconds
        and margin; ``low``, passages below the limit, each with ``start_s``, ``end_s``, ``least``
        and the ``coder`` that leaves least; ``helps``, remedies in words.
    """
    least = min(margins, key=lambda one: one.margin)
    low = _low_passages(margins, begin_s)
    return {
        "through": through,
        "limit": LOW,
        "least": round(least.margin, 2),
        "median": round(statistics.median(one.margin for one in margins), 2),
        "superframes": [
            [round(begin_s + one.number * SUPERFRAME_S, 3), round(one.margin, 2)] for one in margins
        ],
        "low": low,
        "helps": _helps(least, profile, grade) if low else [],
    }


def in_words(figures: dict[str, Any]) -> list[str]:
    """Return the warnings of `margin_figures` for a user, a line each.

    Examples
    --------
    >>> low = [{"start_s": 12.0, "end_s": 19.2, "least": 1.31, "coder": "aac:64k"}]
    >>> figures = {"limit": 1.5, "low": low, "helps": ["a higher bit rate than aac:64k"]}
    >>> for line in in_words(figures):
    ...     print(line)
    margin below 1.5 from 00:12 to 00:20: 1.31 through aac:64k
    would help: a higher bit rate than aac:64k
    """
    low = figures["low"]
    worst = sorted(low, key=lambda one: float(one["least"]))[:LONGEST_WARNING]
    lines = [
        f"margin below {figures['limit']} from {_clock(math.floor(one['start_s']))} to "
        f"{_clock(math.ceil(one['end_s']))}: {one['least']:.2f} through {one['coder']}"
        for one in sorted(worst, key=lambda one: float(one["start_s"]))
    ]
    if len(low) > len(worst):
        lines.append(f"margin below {figures['limit']} in {len(low) - len(worst)} more passages")
    if figures["helps"]:
        lines.append("would help: " + "; or ".join(figures["helps"]))
    return lines


def _low_passages(margins: Sequence[SuperframeMargin], begin_s: float) -> list[dict[str, Any]]:
    passages: list[dict[str, Any]] = []
    for one in margins:
        if one.margin >= LOW:
            continue
        start_s = begin_s + one.number * SUPERFRAME_S
        end_s, least = round(start_s + SUPERFRAME_S, 3), round(one.margin, 2)
        if passages and start_s - passages[-1]["end_s"] < JOINED_S:
            passages[-1]["end_s"] = end_s
            if least < passages[-1]["least"]:
                passages[-1] |= {"least": least, "coder": one.coder}
        else:
            passage = {"start_s": round(start_s, 3), "end_s": end_s, "least": least}
            passages.append(passage | {"coder": one.coder})
    return passages


def _helps(least: SuperframeMargin, profile: str, grade: float) -> list[str]:
    """Remedies for the lowest margin, the mildest first."""
    helps = []
    missing = LEVELS_PER_DOUBLING * math.log2(LOW / least.margin)
    needed = grade - GRADES_PER_LEVEL * missing
    if needed >= LOWEST_GRADE and not least.loudest:
        helps.append(f"--grade {math.floor(100 * needed) / 100:.2f}, a louder mark")
    gain = f"about {ROBUST_GAIN * least.margin:.1f} with a coarser motion"
    if profile in ("standard", "high"):
        helps.append(f"--profile audio=robust, {gain}")
    helps.append(f"a higher bit rate than {least.coder}")
    return helps


def _clock(seconds: int) -> str:
    """Minutes and seconds, hours where there are any."""
    minutes, rest = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes:02d}:{rest:02d}"
