"""Time on a broadcast: time stamps that wrap, jump and leave holes, made one steady clock.

Time stamps of a transport stream have 33 bits at 90 kHz (ISO/IEC 13818-1, section 2.4.3.7). The
local clock starts at `ORIGIN_S`, goes on through wraps and splices, and separates holes worth
filling from breaks, after which reception has to start anew.
"""

from dataclasses import dataclass

STAMP_PERIOD_S = (1 << 33) / 90_000
"""After this long the time stamps of a transport stream start again, about 26.5 hours."""

ORIGIN_S = 1.0
"""Local time of the first time stamp: pieces that are decoded or shown before it have a place,
too."""

MAX_HOLE_S = 12.0
"""A longer step forwards is a splice, not a hole."""

_MAX_OVERLAP_S = 0.5
"""Seconds that time stamps may step back without a splice."""


@dataclass(frozen=True, slots=True)
class LocalTime:
    """Where something lies on the local clock.

    Attributes
    ----------
    time_s : float
    spliced : bool
        Whether the stream's own clock jumped here.
    """

    time_s: float
    spliced: bool


class SteadyClock:
    """The local clock of one broadcast, shared by its streams.

    Examples
    --------
    >>> clock = SteadyClock()
    >>> clock.place("sound", 95443.7).time_s
    1.0
    >>> round(clock.place("sound", 0.3).time_s, 2)
    1.32
    >>> clock.place("sound", 5000.0).spliced
    True
    """

    def __init__(self) -> None:
        self._offset_s: float | None = None
        self._last: dict[str, float] = {}

    def place(self, stream: str, stamp_s: float, duration_s: float = 0.0) -> LocalTime:
        """Return the local time of a time stamp of one of the streams.

        Parameters
        ----------
        stream : str
            Name of the stream; each has to come in order, give or take its own reordering.
        stamp_s : float
            Time stamp, seconds.
        duration_s : float
            Length of the stamped media.
        """
        if self._offset_s is None:
            self._offset_s = ORIGIN_S - stamp_s
        raw_s = stamp_s + self._offset_s
        before_s = self._last.get(stream, max(self._last.values(), default=raw_s))
        time_s = raw_s - STAMP_PERIOD_S * round((raw_s - before_s) / STAMP_PERIOD_S)
        step_s = time_s - before_s
        spliced = not -_MAX_OVERLAP_S <= step_s <= MAX_HOLE_S
        if spliced:
            time_s = max(self._last.values(), default=before_s)
            self._offset_s = time_s - stamp_s
            self._last.clear()
        elif time_s != raw_s:
            self._offset_s += time_s - raw_s
        self._last[stream] = max(time_s + duration_s, self._last.get(stream, time_s))
        return LocalTime(round(time_s, 9), spliced)

    def find(self, stamp_s: float) -> float | None:
        """Return the local time of a time stamp near the present; the clock stays as it is.

        None before the first media, and for a time stamp of another stretch.
        """
        now_s = max(self._last.values(), default=None)
        if self._offset_s is None or now_s is None:
            return None
        time_s = stamp_s + self._offset_s
        time_s -= STAMP_PERIOD_S * round((time_s - now_s) / STAMP_PERIOD_S)
        return time_s if abs(time_s - now_s) <= MAX_HOLE_S else None
