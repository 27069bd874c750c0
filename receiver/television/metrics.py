"""A receiver's measurements of itself, as JSON and as Prometheus text."""

import threading
from collections import Counter
from typing import Any

_HELP = {
    "superframes_received_total": ("counter", "Superframes whose base layer arrived."),
    "superframes_lost_total": ("counter", "Superframes that did not arrive."),
    "sound_seconds_total": ("counter", "Programme sound taken in."),
    "holes_total": ("counter", "Holes in the sound that were filled with silence."),
    "splices_total": ("counter", "Jumps of the stream's clock."),
    "connections_total": ("counter", "Times that the programme was opened."),
    "damaged_packets_total": ("counter", "Packets that could not be decoded."),
    "locked": ("gauge", "1 while the carrier is followed."),
    "bit_error_rate": ("gauge", "Wrong bits on the carrier before correction."),
    "motion_margin_seconds": ("gauge", "How long before it is due the last motion was ready."),
    "viewers": ("gauge", "Pages that are watching."),
}

_FAILURES = "Failures of reception after which it went on, by cause."

_MOST_CAUSES = 32
"""Causes of failure that are counted one by one."""

_LONGEST_CAUSE = 300
"""Characters of a cause that are kept."""


class Metrics:
    """Counters and gauges, safe to use from several threads.

    Examples
    --------
    >>> metrics = Metrics()
    >>> metrics.add("holes_total")
    >>> metrics.document()["holes_total"]
    1.0
    >>> [line for line in metrics.prometheus().splitlines() if line.startswith("cuecast_holes")]
    ['cuecast_holes_total 1.0']
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._values = dict.fromkeys(_HELP, 0.0)
        self._failures: Counter[str] = Counter()
        self._last_failure = ""

    def add(self, name: str, amount: float = 1.0) -> None:
        """Raise a counter."""
        with self._lock:
            self._values[name] += amount

    def set(self, name: str, value: float) -> None:
        """Set a gauge or a counter that is kept elsewhere."""
        with self._lock:
            self._values[name] = float(value)

    def fail(self, error: Exception) -> None:
        """Count a failure by its cause, after which reception goes on."""
        name = type(error).__name__
        with self._lock:
            self._failures[name if len(self._failures) < _MOST_CAUSES else "other"] += 1
            self._last_failure = f"{name}: {error}"[:_LONGEST_CAUSE]

    def document(self) -> dict[str, Any]:
        """Return all values by name, and what failed: how often by cause, and the last one."""
        with self._lock:
            failures = {"failures": dict(self._failures), "last_failure": self._last_failure}
            return self._values | failures

    def prometheus(self) -> str:
        """Return the text exposition format, version 0.0.4."""
        values = self.document()
        lines = []
        for name, (kind, text) in _HELP.items():
            lines += [f"# HELP cuecast_{name} {text}", f"# TYPE cuecast_{name} {kind}"]
            lines.append(f"cuecast_{name} {values[name]!r}")
        lines += [f"# HELP cuecast_failures_total {_FAILURES}"]
        lines += ["# TYPE cuecast_failures_total counter"]
        for cause, count in values["failures"].items():
            lines.append(f'cuecast_failures_total{{cause="{cause}"}} {float(count)!r}')
        return "\n".join(lines) + "\n"
