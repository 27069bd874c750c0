"""Find superframes in a picture: frames in, superframes out.

A picture that was scaled keeps its cells. But it may have been cropped, or put between bars: such
places are watched too, in a smaller picture, until one locks. Specification:
spec/video-carrier.md, section 6.
"""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link.superframe import ReceivedSuperframe
from watermark.video import _kernels
from watermark.video.grid import WHOLE, Grid, Region
from watermark.video.profile import MIN_HEIGHT, MIN_WIDTH, VideoProfile
from watermark.video.timing import Timing
from watermark.video.track import VideoTracker

Luma = NDArray[Any]

DOUBT_FRAMES = 3
"""How long a place that locked waits for one whose pilots agree better."""

SMALL_HEIGHT = 360
"""Least height to which a picture is reduced for watching other places than the whole."""


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
        self._factor = max(1, min(height // SMALL_HEIGHT, width // MIN_WIDTH, height // MIN_HEIGHT))
        self._small = np.zeros((height // self._factor, width // self._factor), dtype=np.float32)
        self._timing = Timing(Fraction(fps))
        self._options: dict[str, Any] = {"key": key, "strength": strength}
        self._frames = 0
        self._errors = self._known = 0
        self._trackers: dict[Region, VideoTracker] = {}
        self._starts: dict[Region, int] = {}
        self._locked: dict[Region, list[ReceivedSuperframe]] = {}
        self._doubt = 0
        self.region: Region | None = None
        self.profile: VideoProfile | None = None
        self.first_lock_s: float | None = None
        self._look_at([WHOLE, *PLACES])

    @property
    def locked(self) -> bool:
        """Whether superframes are being received."""
        return self.region is not None

    @property
    def ber_estimate(self) -> float:
        """Share of wrong coded bits before correction, of all superframes decoded."""
        errors, known = self._errors, self._known
        if self.region is not None:
            tracker = self._trackers[self.region]
            errors, known = errors + tracker.errors, known + tracker.known
        return errors / max(1, known)

    def process(self, luma: Luma) -> list[ReceivedSuperframe]:
        """Take the next frame; return the superframes found, about 0.2 s after their last frame.

        While locked, a superframe that could not be decoded is given with l0 = None.

        Parameters
        ----------
        luma : ndarray of uint8 or uint16, shape (height, width)
            Samples of the picture.

        Returns
        -------
        list of ReceivedSuperframe

        Raises
        ------
        CueError
            If the frame has another size than announced.
        """
        if luma.shape != self._size[1::-1]:
            raise CueError(f"frame of shape {luma.shape}: expected {self._size[1::-1]}")
        self._frames += 1
        if any(region != WHOLE for region in self._trackers):
            _kernels.reduce_into(luma, self._factor, self._small)
        found = {
            region: self._placed(tracker.process(luma if region == WHOLE else self._small), region)
            for region, tracker in self._trackers.items()
        }
        if self.region is None:
            return self._choose(found)
        if not self._trackers[self.region].locked:
            self._restart()
        return [superframe for each in found.values() for superframe in each]

    def wait(self, misses: int) -> None:
        """Tell when to give up the lock.

        Parameters
        ----------
        misses : int
            Superframes in a row that failed.
        """
        for tracker in self._trackers.values():
            tracker.patience = misses

    def flush(self) -> list[ReceivedSuperframe]:
        """Return the superframes in the last frames.

        Returns
        -------
        list of ReceivedSuperframe
        """
        last = {region: self._placed(t.flush(), region) for region, t in self._trackers.items()}
        if self.region is None:
            self._doubt = DOUBT_FRAMES
            return self._choose(last)
        return last[self.region]

    def _placed(self, found: list[ReceivedSuperframe], region: Region) -> list[ReceivedSuperframe]:
        """Count positions from the receiver's first frame, not from the tracker's."""
        if found:
            self.profile = self._trackers[region].profile
        shift_s = self._starts[region] / float(self._timing.fps)
        return [replace(s, position_s=s.position_s + shift_s) for s in found]

    def _choose(self, found: dict[Region, list[ReceivedSuperframe]]) -> list[ReceivedSuperframe]:
        """Lock to the place whose pilots agree best, a moment after the first one was found."""
        for region, superframes in found.items():
            if superframes:
                self._locked.setdefault(region, []).extend(superframes)
        if not self._locked or self._doubt < DOUBT_FRAMES:
            self._doubt += bool(self._locked)
            return []
        best = max(self._locked, key=lambda region: self._locked[region][-1].confidence)
        told, self._locked, self._doubt = self._locked[best], {}, 0
        self.region = best
        self._look_at([best])
        if self.first_lock_s is None:
            self.first_lock_s = self._frames / float(self._timing.fps)
        return told

    def _restart(self) -> None:
        """Look again, here and everywhere."""
        assert self.region is not None
        tracker = self._trackers[self.region]
        self._errors += tracker.errors
        self._known += tracker.known
        tracker.errors = tracker.known = 0
        self.region = None
        self._look_at([WHOLE, *PLACES])

    def _look_at(self, regions: list[Region]) -> None:
        """Track these regions; those that are tracked already go on."""
        for region in regions:
            if region not in self._trackers:
                grid = self._grid(region)
                self._trackers[region] = VideoTracker(grid, self._timing, **self._options)
                self._starts[region] = self._frames
        self._trackers = {r: t for r, t in self._trackers.items() if r in regions}

    def _grid(self, region: Region) -> Grid:
        """Cells of a place; those of the whole at full size, the others in the reduced picture."""
        width, height, depth = self._size
        if region == WHOLE:
            return Grid(width, height, depth)
        rows, columns = self._small.shape
        factor = self._factor
        # What a whole number of squares does not cover is cut off at the right and the bottom.
        across, down = width / (columns * factor), height / (rows * factor)
        moved = Region(
            region.left * across, region.top * down, region.width * across, region.height * down
        )
        return Grid(columns, rows, depth, region=moved)
