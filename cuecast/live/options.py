"""Options of a playout, and the values that it exchanges with the process that marks.

The playout imports them without the marking itself.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cuecast.dubbing.coder_stream import is_rehearsed
from cuecast.live.packets import TICKS_HZ, step
from watermark.link.superframe import SUPERFRAME_S

if TYPE_CHECKING:
    from cuecast.live.signing import LiveSigning

STRETCH, LOW_STRETCH = 4, 2
"""Superframes graded together, as a rule and for a low delay; half where the mark is rehearsed."""


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a running programme is marked.

    Attributes
    ----------
    profile : str
        Of the audio carrier.
    key : int
    grade : float
    through : str, optional
        Coder to rehearse the mark on.
    low_delay : bool
    seen_s : float
        How much later than the playout a live interpreter sees the programme.
    sign : str
        File of the key that signs, if any.
    on_air_s : float, optional
        When the motion's clock is at zero, seconds since 1970 (UTC); None: as the clock has it.
    delay_s : float
        From in to out.
    """

    profile: str
    key: int
    grade: float
    through: str | None = None
    low_delay: bool = False
    seen_s: float = 0.0
    sign: str = ""
    on_air_s: float | None = None
    delay_s: float = 0.0

    @property
    def stretch(self) -> int:
        """Superframes that the embedder grades together."""
        stretch = LOW_STRETCH if self.low_delay else STRETCH
        return stretch // 2 if self.rehearsed else stretch

    @property
    def embedder_s(self) -> float:
        """Longest time from a sample to its marked one, without the time to compute."""
        return SUPERFRAME_S * self.stretch * (1 + self.rehearsed) + 0.1

    def signing(self) -> "LiveSigning | None":
        """Return what signs runs of sound, if they are to be signed."""
        if not self.sign:
            return None
        # Its cryptography takes long to import.
        from cuecast.live.signing import LiveSigning

        return LiveSigning(self.sign, self.on_air_s, self.delay_s)

    @property
    def ahead_s(self) -> float:
        """How far ahead of the sound that came in the motion has to be known, at most.

        That of a superframe is coded with the keys of the next one.
        """
        # The marking takes long to import; only who waits for an interpreter asks here.
        from cuecast.dubbing.payloads import LEAD

        return SUPERFRAME_S * max(0, LEAD + 1 - self.stretch * self.rehearsed)

    @property
    def rehearsed(self) -> bool:
        """Whether superframes are tried on a coder first."""
        return is_rehearsed(self.profile, self.through)


@dataclass(frozen=True, slots=True)
class MarkedPes:
    """A PES packet with marked sound: its time and that of its end in ticks, its bytes."""

    pts: int
    end: int
    data: bytes


@dataclass(frozen=True, slots=True)
class RunClock:
    """Clock of the sound under way, for a process that goes on with it.

    Attributes
    ----------
    stamp : int
        A time stamp, ticks.
    time_s : float
        The same moment on the motion's clock.
    grid_s : float
        When superframe 0 begins on that clock; each later one `SUPERFRAME_S` after the one before.
    """

    stamp: int
    time_s: float
    grid_s: float

    def at(self, stamp: int) -> float:
        """Return the time of another stamp on the motion's clock."""
        return self.time_s + step(stamp, self.stamp) / TICKS_HZ
