"""Results of an evaluation as CSV, JSON, a table to read, and a picture; intervals of counts."""

import csv
import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from codec.files.whole import whole_file

Results = list[dict[str, Any]] | dict[str, Any]
"""Rows of the same fields, or one record."""

PLOTS = (".png", ".svg", ".pdf")
"""Forms of a plot: for the screen, for pages, for print."""

COLUMN_IN = (3.5, 2.9)
"""Size in inches: a column of a journal, so that letters are as large as those around them."""

PAGE_IN = (7.2, 4.3)
"""Size in inches of a drawing with many parts: the width of two columns."""

STYLE: Any = {
    "font.size": 7, "axes.titlesize": 8, "axes.labelsize": 7, "legend.fontsize": 6,
    "xtick.labelsize": 6, "ytick.labelsize": 6, "lines.linewidth": 1.0, "lines.markersize": 3,
    "legend.frameon": False, "svg.hashsalt": "cuecast", "svg.fonttype": "none",
}  # fmt: skip
"""Letters and lines of all drawings, in points."""


def _metadata(form: str, results: Results) -> dict[str, str | None] | None:
    """Return the metadata of a file of a form: no date, and the digest of its results."""
    undated: dict[str, dict[str, str | None]] = {
        "svg": {"Date": None, "Description": digest(results)},
        "pdf": {"CreationDate": None},
        "png": {"Description": digest(results)},
    }
    return undated.get(form)


def digest(results: Results) -> str:
    """Return the SHA-256 of results, 64 hexadecimal digits: the description in a PNG or SVG."""
    text = json.dumps(results, ensure_ascii=False, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


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


def write_plots(stem: Path, results: Results, plot: Callable[[Any, Any], None]) -> list[Path]:
    """Draw `results` in all forms of `PLOTS`, as wide as a column; return the paths."""
    paths = [stem.parent / f"{stem.name}{suffix}" for suffix in PLOTS]
    for path in paths:
        write_plot(path, results, plot)
    return paths


def write_plot(
    path: Path,
    results: Results,
    plot: Callable[[Any, Any], None],
    *,
    size_in: tuple[float, float] = COLUMN_IN,
) -> None:
    """Let `plot` draw `results` into a figure, and write it; the same results give the same bytes.

    Parameters
    ----------
    path : Path
        Its suffix is one of `PLOTS`.
    results : list of dict, or dict
    plot : callable
        Takes results and a matplotlib figure.
    size_in : tuple of (float, float)
        Width and height in inches.
    """
    import matplotlib
    from matplotlib.figure import Figure

    form = path.suffix[1:]
    with matplotlib.rc_context(STYLE), whole_file(path) as temporary:
        figure = Figure(figsize=size_in, layout="constrained")
        plot(results, figure)
        figure.savefig(temporary, format=form, dpi=200, metadata=_metadata(form, results))


def _text(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def wilson_interval(count: int, total: int, *, deviations: float = 1.96) -> tuple[float, float]:
    """Interval of a probability from `count` cases in `total`.

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
