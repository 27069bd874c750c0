"""States of a playout: what `/health`, `/metrics` and the log say about it.

::

    starting --> ready <--> marked
                   ^          |
                   +-- bypass <+        any --> stopping

*starting*: the marking process loads, and the programme passes unmarked. *ready*: it can mark, and
no sound is due yet. *marked*: the sound that leaves carries the mark. *bypass*: sound leaves
unmarked although it should carry the mark. *stopping*: no more input is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from cuecast.live.guard import RateLimit

State = Literal["starting", "ready", "marked", "bypass", "stopping"]
STATES: tuple[State, ...] = ("starting", "ready", "marked", "bypass", "stopping")

_LINES_PER_S, _LINES_AT_ONCE = 0.1, 4
"""Lines of the log about changes of state: an overloaded machine changes several times a second.
Every change is counted."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A state and its reason in words."""

    state: State
    reason: str

    @property
    def can_mark(self) -> bool:
        """Whether sound that comes in now leaves marked."""
        return self.state in ("ready", "marked")

    def __str__(self) -> str:
        return f"{self.state}: {self.reason}" if self.reason else self.state


@dataclass(frozen=True, slots=True)
class Observation:
    """Facts about a playout at one moment.

    Attributes
    ----------
    stopping, input_silent : bool
    loaded : bool
        Whether the marking process can take sound.
    was_loaded : bool
        Whether one could, ever.
    marking : bool
        Whether the sound that left last was marked.
    sound : bool
        Whether the programme has a sound that can be marked, as far as is known.
    waited_s : float
        Seconds since sound could first be marked: since the process loaded or sound came.
    delay_s : float
        From input to output.
    """

    stopping: bool
    input_silent: bool
    loaded: bool
    was_loaded: bool
    marking: bool
    sound: bool
    waited_s: float
    delay_s: float


def condition_of(seen: Observation) -> Condition:
    """Return the state that observed facts amount to.

    Examples
    --------
    >>> seen = Observation(False, False, False, False, False, True, 0.0, 5.0)
    >>> str(condition_of(seen))
    'starting: the marking process is loading'
    """
    if seen.stopping:
        return Condition("stopping", "no more input is taken")
    if not seen.loaded:
        if seen.was_loaded:
            return Condition("bypass", "the marking process ended and is started again")
        return Condition("starting", "the marking process is loading")
    if seen.input_silent:
        return Condition("ready", "no input")
    if seen.marking:
        return Condition("marked", "")
    if not seen.sound:
        return Condition("bypass", "the programme has no sound that can be marked")
    if seen.waited_s < seen.delay_s:
        return Condition("ready", f"first marked sound within {seen.delay_s:g} s")
    return Condition("bypass", "the marking process is too slow for this machine's load")


class Announcer:
    """Logs changes of state, the fast ones summed up.

    Parameters
    ----------
    tell : callable
        Takes a line of the log.
    clock : callable
        Returns seconds that never run backwards.

    Attributes
    ----------
    condition : Condition
        The last one observed.
    changes_total : int
    """

    def __init__(self, tell: Callable[[str], None], clock: Callable[[], float]) -> None:
        self._tell = tell
        self._limit = RateLimit(_LINES_PER_S, _LINES_AT_ONCE, clock)
        self.condition = Condition("starting", "the playout is set up")
        self._announced: State | None = None
        self._unsaid = 0
        self.changes_total = 0

    def observe(self, condition: Condition) -> None:
        """Take the state as it is now."""
        if condition.state != self.condition.state:
            self._unsaid += 1
            self.changes_total += 1
        self.condition = condition
        if condition.state == self._announced:
            return
        if condition.state != "stopping" and not self._limit.allows():
            return
        more = f" ({self._unsaid} changes since the last line)" if self._unsaid > 1 else ""
        self._tell(f"state {condition}{more}")
        self._announced, self._unsaid = condition.state, 0
