"""A drawing for figures of channels and clips: a line for each channel, a dot for each clip."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cuecast.evaluate.tables import COLUMN_IN

_DOT_IN = 0.085
"""Height of one dot in inches: the letters of the tick labels are as high."""

_LEGEND_IN = 0.13
"""Height in inches of a line of the legend."""

_FRAME_IN = 0.55
"""Height in inches of axes and labels."""


@dataclass(frozen=True, slots=True)
class Dot:
    """One figure of a drawing.

    Attributes
    ----------
    line : str
        What its line is called.
    series : str
        Series of the dot, which sets its colour.
    value : float
        Where it lies, per cent.
    low, high : float, optional
        Ends of its interval, per cent.
    """

    line: str
    series: str
    value: float
    low: float | None = None
    high: float | None = None


def draw_dots(figure: Any, dots: Sequence[Dot], *, xlabel: str) -> None:
    """Draw dots on lines into a matplotlib figure, which grows until nothing overlaps.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    dots : sequence of Dot
    xlabel : str
        Label of the values.
    """
    lines = list(dict.fromkeys(dot.line for dot in dots))
    series = list(dict.fromkeys(dot.series for dot in dots))
    per_line = max(len(series), 2)
    legend = math.ceil(len(series) / 2) if len(series) > 1 else 0
    height = _FRAME_IN + len(lines) * (per_line + 1) * _DOT_IN + legend * _LEGEND_IN
    figure.set_size_inches(COLUMN_IN[0], height)
    axes = figure.subplots()
    for number, name in enumerate(series):
        own = [dot for dot in dots if dot.series == name]
        shift = (number + 1) / (len(series) + 1) - 0.5
        y = [lines.index(dot.line) + shift for dot in own]
        x = [dot.value for dot in own]
        bars = [
            [max(dot.value - (dot.value if dot.low is None else dot.low), 0.0) for dot in own],
            [max((dot.value if dot.high is None else dot.high) - dot.value, 0.0) for dot in own],
        ]
        axes.errorbar(x, y, xerr=bars, fmt="o", capsize=1.5, elinewidth=0.7, label=name)
    for between in range(1, len(lines)):
        axes.axhline(between - 0.5, color="0.85", linewidth=0.5)
    axes.set_yticks(range(len(lines)), lines)
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.set_xlim(left=min(0.0, *(dot.value for dot in dots)) - 0.5)
    axes.set_xlabel(xlabel)
    if legend:
        figure.legend(loc="outside upper center", ncols=2)
