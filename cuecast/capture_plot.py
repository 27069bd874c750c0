"""A picture of how a capture went: what was seen of each part, and what the models left."""

from typing import Any


def plot_capture(report: dict[str, Any], figure: Any) -> None:
    """Draw a report of `synth.capture` into a figure of matplotlib."""
    errors, hidden = (figure.add_subplot(1, 2, number) for number in (1, 2))
    parts = {name: mm for name, mm in report.get("residual_mm", {}).items() if mm is not None}
    errors.barh(list(parts), list(parts.values()))
    errors.invert_yaxis()
    errors.set_xlabel("distance from the models, mm")
    worst = report.get("gaps", {}).get("most_hidden", {})
    hidden.barh(list(worst), [100 * share for share in worst.values()])
    hidden.invert_yaxis()
    hidden.set_xlabel("hidden, % of the frames (the worst)")
    figure.suptitle(f"{report['input']['file']}, {report['input']['duration_s']:.1f} s")
