"""Where a frame stands in its superframe. Specification: spec/video-carrier.md, section 2."""

from dataclasses import dataclass
from fractions import Fraction

from codec.errors import CueError
from watermark.link.superframe import SUPERFRAME_S
from watermark.video.profile import FADE

MIN_FPS, MAX_FPS = 12, 120
"""Frames per second that are taken: enough to show a cuer, and as many as displays have."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Frame counts at one frame rate.

    Attributes
    ----------
    fps : Fraction
        Frames per second, 12 to 120.
    """

    fps: Fraction

    def __post_init__(self) -> None:
        if not MIN_FPS <= self.fps <= MAX_FPS:
            raise CueError(f"{float(self.fps):g} frames per second: must be {MIN_FPS}..{MAX_FPS}")

    @property
    def span(self) -> float:
        """Frames of a superframe, in general not whole."""
        return float(self.fps) * SUPERFRAME_S

    @property
    def window(self) -> int:
        """Whole frames between two fades: those that a receiver averages."""
        return max(1, round(self.span * (1 - FADE)))

    def phase(self, frame: int) -> tuple[int, float]:
        """Superframe of a frame and the middle of the frame in it, 0 to 1."""
        place = (frame + 0.5) / self.span
        return int(place), place - int(place)

    def window_start(self, superframe: int) -> int:
        """First frame of the window of a superframe."""
        return round(superframe * self.span + (self.span - self.window) / 2)

    def position_s(self, window_start: float) -> float:
        """Start in seconds of the superframe whose window starts at a frame."""
        return (window_start - (self.span - self.window) / 2) / float(self.fps)

    def on_a_frame_s(self, position_s: float) -> float:
        """Round a superframe's start to that of a frame where all superframes start with one.

        At 25 and 50 frames per second a superframe has 16 and 32 frames; how late a coder shows a
        pattern is less than half a frame more often than not. A picture that was marked at another
        rate may be half a frame off.

        Examples
        --------
        >>> Timing(Fraction(25)).on_a_frame_s(1.294), Timing(Fraction(24)).on_a_frame_s(1.294)
        (1.28, 1.294)
        """
        if (self.fps * Fraction(SUPERFRAME_S).limit_denominator(1000)).denominator > 1:
            return position_s
        return round(position_s * self.fps) / float(self.fps)
