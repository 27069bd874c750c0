"""Results of an evaluation as CSV, JSON, a table to read, and a picture; intervals of counts."""

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cuecast.command.files import whole_file

Results = list[dict[str, Any]] | dict[str, Any]
"""Rows of the same fields, or one record."""


def rows_of(results: Results) -> list[dict[str, Any]]:
    """Return results as rows."""
    return [results] if isinstance(results, dict) else results


def columns_of(results: Results) -> list[str]:
    """Return the names of all fields, in order of appearance."""
    return list(dict.fromkeys(name for row in rows_of(results) for name in row))


def as_table(results: Results) -> str:
    """Return results in aligned columns.

    Examples
    --------
    >>> print(as_table([{"clip": "a", "odg": -0.25}, {"clip": "bc", "odg": None}]))
    clip    odg
    a     -0.25
    bc        -
    """
    names = columns_of(results)
    cells = [names] + [[_text(row.get(name)) for name in names] for row in rows_of(results)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(names))]
    texts = [any(isinstance(row.get(name), str) for row in rows_of(results)) for name in names]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if text else cell.rjust(width)
            for cell, width, text in zip(row, widths, texts, strict=True)
        ).rstrip()
        for row in cells
    )


def write_results(folder: Path, name: str, results: Results) -> list[Path]:
    """Write ``name.csv`` and ``name.json`` into `folder`; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    table, document = folder / f"{name}.csv", folder / f"{name}.json"
    with whole_file(table) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns_of(results))
        writer.writeheader()
        writer.writerows(rows_of(results))
    with whole_file(document) as temporary:
        text = json.dumps(results, ensure_ascii=False, indent=1, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    return [table, document]


def write_plot(path: Path, results: Results, plot: Callable[[Any, Any], None]) -> None:
    """Let `plot` draw `results` into a figure, and write it as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6), layout="constrained")
    plot(results, figure)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=120)


def _text(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


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
