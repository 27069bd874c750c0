"""Find superframes in a picture: frames in, superframes out.

A picture that was scaled keeps its cells. If nothing is found in it as it stands, it may have been
cropped or put between bars: some such places are tried a few at a time, until one locks.
Specification: spec/video-carrier.md, section 6.
"""

from dataclasses import replace
from fractions import Fraction
from typing import Any

from numpy.typing import NDArray

from codec.errors import CueError
from watermark.received import ReceivedSuperframe
from watermark.video.grid import WHOLE, Grid, Region
from watermark.video.profile import VideoProfile
from watermark.video.timing import Timing
from watermark.video.track import Tracker

Luma = NDArray[Any]

PATIENCE_S = 2.0
"""How long places are tried before others."""

AT_ONCE = 4
"""Places tried beside the whole picture."""


def _cropped(part: float) -> Region:
    """Region of a picture that lost `part` of its size on each side and was enlarged again."""
    rest = 1 - 2 * part
    return Region(-part / rest, -part / rest, 1 / rest, 1 / rest)


PLACES = (
    _cropped(0.01),
    _cropped(0.02),
    _cropped(0.005),
    _cropped(0.015),
    Region(0, 0.125, 1, 0.75),  # between bars above and below: 16:9 in 4:3
    Region(0.125, 0, 0.75, 1),  # 4:3 between bars in 16:9
    Region(-1 / 6, 0, 4 / 3, 1),  # the middle of 16:9 in 4:3
    _cropped(0.025),
    _cropped(0.03),
    _cropped(0.035),
    _cropped(0.04),
    _cropped(0.05),
)
"""Where a marked picture is looked for if not in the whole."""


class VideoReceiver:
    """Read superframes from luma.

    Parameters
    ----------
    width, height : int
        Pixels of the picture.
    fps : Fraction, int or float
        Frames per second; need not be the embedder's.
    key : int
        Secret seed.
    depth : int
        Bits per sample.
    strength : float
        As the embedder's.

    Attributes
    ----------
    region : Region or None
        Where the marked picture lies, once found.
    first_lock_s : float or None
        When the first superframe had been received.

    Raises
    ------
    CueError
        If size, rate, depth or key are out of range.
    """

    def __init__(
        self,
        width: int,
        height: int,
        fps: Fraction | float,
        *,
        key: int = 0,
        depth: int = 8,
        strength: float = 1.0,
    ) -> None:
        self._size = width, height, depth
        self._timing = Timing(Fraction(fps))
        self._options: dict[str, Any] = {"key": key, "strength": strength}
        self._frames = 0
        self._errors = self._known = 0
        self._trackers: dict[Region, Tracker] = {}
        self._starts: dict[Region, int] = {}
        self._tried = 0
        self.region: Region | None = None
        self.profile: VideoProfile | None = None
        self.first_lock_s: float | None = None
        self._look_at([WHOLE])

    @property
    def locked(self) -> bool:
        """Whether superframes are being received."""
        return self.region is not None

    @property
    def ber_estimate(self) -> float:
        """Share of wrong coded bits before correction, of all superframes decoded."""
        known = self._known + sum(t.known for t in self._trackers.values())
        return (self._errors + sum(t.errors for t in self._trackers.values())) / max(1, known)

    def process(self, luma: Luma) -> list[ReceivedSuperframe]:
        """Take the next frame; return the superframes found, about 0.2 s after their last frame.

        While locked, a superframe that could not be decoded is given with l0 = None.

        Raises
        ------
        CueError
            If the frame has another size than announced.
        """
        if luma.shape != self._size[1::-1]:
            raise CueError(f"frame of shape {luma.shape}: expected {self._size[1::-1]}")
        self._frames += 1
        found = {
            region: self._placed(tracker.process(luma), region)
            for region, tracker in self._trackers.items()
        }
        if self.region is None:
            return self._choose(found)
        if not self._trackers[self.region].locked:
            self._restart()
        return [superframe for each in found.values() for superframe in each]

    def flush(self) -> list[ReceivedSuperframe]:
        """Return what the last frames still hold."""
        found = []
        for region, tracker in self._trackers.items():
            found += self._placed(tracker.flush(), region)
            if found:
                break
        return found

    def _placed(self, found: list[ReceivedSuperframe], region: Region) -> list[ReceivedSuperframe]:
        """Count positions from the receiver's first frame, not from the tracker's."""
        if found:
            self.profile = self._trackers[region].profile
        shift_s = self._starts[region] / float(self._timing.fps)
        return [replace(s, position_s=s.position_s + shift_s) for s in found]

    def _choose(self, found: dict[Region, list[ReceivedSuperframe]]) -> list[ReceivedSuperframe]:
        """Lock to the place whose pilots agree best, if any superframe was found."""
        locked = {region: each for region, each in found.items() if each}
        if not locked:
            if self._frames - self._since >= PATIENCE_S * self._timing.fps:
                self._look_elsewhere()
            return []
        best = max(locked, key=lambda region: locked[region][0].confidence)
        self.region = best
        self._look_at([best])
        if self.first_lock_s is None:
            self.first_lock_s = self._frames / float(self._timing.fps)
        return locked[best]

    def _restart(self) -> None:
        """Look again, first where the picture was."""
        assert self.region is not None
        regions = [self.region, WHOLE]
        self._tried, self.region = 0, None
        self._look_at(regions)

    def _look_elsewhere(self) -> None:
        chosen = [PLACES[(self._tried + i) % len(PLACES)] for i in range(AT_ONCE)]
        self._tried += AT_ONCE
        self._look_at([WHOLE, *chosen])

    def _look_at(self, regions: list[Region]) -> None:
        """Track these regions; those that are tracked already go on."""
        gone = [t for region, t in self._trackers.items() if region not in regions]
        self._errors += sum(t.errors for t in gone)
        self._known += sum(t.known for t in gone)
        self._since = self._frames
        for region in regions:
            if region not in self._trackers:
                grid = Grid(*self._size, region=region)
                self._trackers[region] = Tracker(grid, self._timing, **self._options)
                self._starts[region] = self._frames
        self._trackers = {r: t for r, t in self._trackers.items() if r in regions}
