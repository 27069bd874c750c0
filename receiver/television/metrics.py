"""What a receiver measures about itself, as JSON and as Prometheus text."""

import threading
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
}  # fmt: skip


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

    def add(self, name: str, amount: float = 1.0) -> None:
        """Raise a counter."""
        with self._lock:
            self._values[name] += amount

    def set(self, name: str, value: float) -> None:
        """Set a gauge or a counter that is kept elsewhere."""
        with self._lock:
            self._values[name] = float(value)

    def document(self) -> dict[str, Any]:
        """Return all values by name."""
        with self._lock:
            return dict(self._values)

    def prometheus(self) -> str:
        """Return the text exposition format, version 0.0.4."""
        lines = []
        for name, value in self.document().items():
            kind, text = _HELP[name]
            lines += [f"# HELP cuecast_{name} {text}", f"# TYPE cuecast_{name} {kind}"]
            lines.append(f"cuecast_{name} {value!r}")
        return "\n".join(lines) + "\n"
