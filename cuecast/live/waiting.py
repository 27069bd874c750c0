"""Where the sound of a running programme waits for a live interpreter's motion."""

from collections import deque
from typing import Any

from cuecast.live.interpreter import SETTLED_S, InterpretedMotion

_AHEAD_S = 2.0
"""Seconds of lines that are read ahead where they come from a file."""

_PIECE_S = 0.2
"""Longest piece of sound that comes at once, about."""


class WaitingRoom:
    """Messages of the playout that wait until the interpreter's motion is known.

    Parameters
    ----------
    motion : InterpretedMotion
    ahead_s : float
        How far ahead of the sound the embedder asks for motion.
    hold_s : float, optional
        How long a message waits at most; None: as long as it takes.
    seen_s : float
        How much later than the playout she sees the programme.

    Attributes
    ----------
    ended : bool
        Whether no more lines come.
    """

    def __init__(
        self,
        motion: InterpretedMotion,
        *,
        ahead_s: float,
        hold_s: float | None,
        seen_s: float = 0.0,
    ) -> None:
        self._motion, self._hold_s, self._seen_s = motion, hold_s, seen_s
        self._needed_s = ahead_s + SETTLED_S
        self._messages: deque[tuple[float, Any]] = deque()
        self._heard: tuple[float, float] | None = None
        self.ended = False

    @property
    def hungry(self) -> bool:
        """Whether there is use for further lines now."""
        heard_s = self._heard[0] if self._heard else 0.0
        ahead_s = self._motion.known_s - heard_s - self._needed_s
        return not self.ended and (self._hold_s is not None or ahead_s < _AHEAD_S)

    def line(self, came_s: float, line: bytes) -> None:
        """Take a line that came at this time of `time.monotonic`.

        Raises
        ------
        CueError
            If it is not one of an interpreter.
        """
        if self._hold_s is None:
            self._motion.add(line, None)
        elif self._heard is not None:
            heard_s, at_s = self._heard
            self._motion.add(line, heard_s + came_s - at_s - self._seen_s)

    def enter(self, sent_s: float, message: Any) -> None:
        """Let a message wait that was sent at this time of `time.monotonic`."""
        self._messages.append((sent_s, message))

    def leave(self, now_s: float, heard_s: float) -> Any | None:
        """Return the next message that has waited enough, None if there is none.

        `heard_s` is the end of the sound so far on the programme's clock.
        """
        if not self._messages:
            return None
        sent_s, message = self._messages[0]
        known = self.ended or self._motion.known_s >= heard_s + self._needed_s + _PIECE_S
        if not known and (self._hold_s is None or now_s - sent_s < self._hold_s):
            return None
        self._messages.popleft()
        return message

    def heard(self, heard_s: float, sent_s: float) -> None:
        """Note up to where the sound was heard with a message."""
        self._heard = heard_s, sent_s
