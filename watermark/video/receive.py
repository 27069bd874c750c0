"""Find superframes in a picture: frames in, superframes out.

A picture that was scaled keeps its cells. But it may have been cropped, or put between bars: its
place is searched in means over a window of a smaller picture, and followed in the picture itself.
Only small frames are kept.
Specification: spec/video-carrier.md, section 6.
"""

import math
from collections import deque
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link.superframe import ReceivedSuperframe
from watermark.video import _kernels
from watermark.video.grid import WHOLE, Grid, Region
from watermark.video.profile import MIN_HEIGHT, MIN_WIDTH, VideoProfile
from watermark.video.search import SCALE, PlaceCandidate, PlaceSearch, Small, is_near
from watermark.video.timing import Timing
from watermark.video.track import VideoTracker

Luma = NDArray[Any]

ENOUGH_FPS = 25
"""Frames per second that are enough: of more, two, three or four at a time are added up. A coder
gives some frames of a group of pictures hardly any bits, and every second one may be such: of a
film at 60 frames per second through H.264, that left half of the information in 4 superframes of
9."""

DOUBT_FRAMES = 3
"""How long a place that locked waits for one whose pilots agree better."""

TRIALS = 3
"""Places that are tried at the same time."""

BETTER = 1.0
"""Least advantage of a place over the one on trial next to it, in standard deviations of noise,
to take its turn."""

TRIAL_SPANS = 1.5
"""Superframes after which a place that gave none is dropped."""

KEPT_SPANS = 1.5
"""Superframes of small frames that are kept, to be shown to a tracker of a place found later."""

SMALL_DEPTH = 16
"""Bits of a sample of the small frames."""

SMALL_HEIGHT = 360
"""Least height to which a picture is reduced for the search."""


@dataclass(slots=True)
class _PlaceTrial:
    """A place under trial: its tracker, when it began, and the superframes that it gave."""

    tracker: VideoTracker
    score: float
    start: int
    end: int
    found: list[ReceivedSuperframe] = field(default_factory=list)


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
    crops : bool
        Whether the marked picture is searched in crops of this one, too.

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

    Examples
    --------
    >>> receiver = VideoReceiver(320, 180, 25)
    >>> picture = np.random.default_rng(1).integers(90, 160, (180, 320), dtype=np.uint8)
    >>> [found for _ in range(3) for found in receiver.process(picture)], receiver.locked
    ([], False)
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
        crops: bool = True,
    ) -> None:
        self._size, self._crops = (width, height, depth), crops
        self._fps = Fraction(fps)
        Timing(self._fps)
        self._every = max(1, int(self._fps / ENOUGH_FPS))
        self._timing = Timing(self._fps / self._every)
        self._factor = max(1, min(height // SMALL_HEIGHT, width // MIN_WIDTH, height // MIN_HEIGHT))
        self._shape = height // self._factor, width // self._factor
        # What a whole number of squares does not cover is cut off at the right and the bottom.
        rows, columns = self._shape
        self._kept = columns * self._factor / width, rows * self._factor / height
        self._line = np.empty(columns * self._factor, dtype=np.uint16 if depth == 8 else np.int32)
        self._sum = _FrameSum(self._every, (height, width), np.uint16 if depth <= 14 else np.uint32)
        self._small_sum = _FrameSum(self._every, self._shape, np.uint16)
        self._options: dict[str, Any] = {"key": key, "strength": strength}
        self._frames = self._looked = 0
        self._errors = self._known = 0
        self._patience: int | None = None
        self._tracker: VideoTracker | None = None
        self._start = 0
        self._trials: dict[Region, _PlaceTrial] = {}
        self._newest: deque[Small] = deque(maxlen=math.ceil(KEPT_SPANS * self._timing.span))
        self._doubt = 0
        self.region: Region | None = None
        self.profile: VideoProfile | None = None
        self.first_lock_s: float | None = None
        self._grid(WHOLE)
        self._search = self._new_search()

    @property
    def locked(self) -> bool:
        """Whether superframes are being received."""
        return self._tracker is not None

    @property
    def ber_estimate(self) -> float:
        """Share of wrong coded bits before correction, of all superframes decoded."""
        errors, known = self._errors, self._known
        if self._tracker is not None:
            errors, known = errors + self._tracker.errors, known + self._tracker.known
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
        if self._tracker is None:
            return self._hunt(luma)
        whole = self._sum.add(luma)
        if whole is None:
            return []
        self._looked += 1
        found = self._placed(self._tracker, self._tracker.process(whole), self._start)
        if not self._tracker.locked:
            self._errors += self._tracker.errors
            self._known += self._tracker.known
            self._tracker = self.region = None
            self._search = self._new_search()
        return found

    def wait(self, misses: int) -> None:
        """Tell when to give up the lock.

        Parameters
        ----------
        misses : int
            Superframes in a row that failed.
        """
        self._patience = misses
        for tracker in [trial.tracker for trial in self._trials.values()]:
            tracker.patience = misses
        if self._tracker is not None:
            self._tracker.patience = misses

    def flush(self) -> list[ReceivedSuperframe]:
        """Return the superframes in the last frames.

        Returns
        -------
        list of ReceivedSuperframe
        """
        if self._tracker is not None:
            return self._placed(self._tracker, self._tracker.flush(), self._start)
        for trial in self._trials.values():
            trial.found += trial.tracker.flush()
        self._doubt = DOUBT_FRAMES
        return self._choose()

    def _hunt(self, luma: Luma) -> list[ReceivedSuperframe]:
        """Search the places in the small picture and try those that look marked."""
        reduced = np.empty(self._shape, dtype=np.uint16)
        scale = SCALE / 2 ** (self._size[2] - 8) / self._every
        _kernels.reduce_into(luma, self._factor, scale, self._line, reduced)
        whole = self._sum.add(luma) if self._trials else None
        small = self._small_sum.add(reduced)
        if small is None:
            return []
        self._looked += 1
        small = small.copy()  # it is kept, here and by the search
        self._newest.append(small)
        if whole is not None:
            for trial in self._trials.values():
                trial.found += trial.tracker.process(whole)
        self._trials = {
            region: trial
            for region, trial in self._trials.items()
            if trial.found or self._looked < trial.end
        }
        for candidate in self._search.process(small):
            self._try(candidate)
        return self._choose()

    def _try(self, candidate: PlaceCandidate) -> None:
        """Show the newest frames to a tracker of this place in the small picture, unless one is."""
        place = _scaled(candidate.region, *self._kept)
        # One trial per place: a much better score replaces it.
        for other in [other for other in self._trials if is_near(place, other)]:
            trial = self._trials[other]
            if trial.found or candidate.score < trial.score + BETTER:
                return
            del self._trials[other]
        if len(self._trials) >= TRIALS:
            return
        rows, columns = self._shape
        grid = Grid(columns, rows, SMALL_DEPTH, region=candidate.region, reduced=self._factor)
        # The tracker starts with the frames that are kept, then goes on at full size from the next.
        tracker = VideoTracker(grid, self._timing, **self._options)
        if self._patience is not None:
            tracker.patience = self._patience
        frames = self._newest
        end = self._looked + round(TRIAL_SPANS * self._timing.span)
        start = self._looked - len(frames)
        trial = self._trials[place] = _PlaceTrial(tracker, candidate.score, start, end)
        for frame in frames:
            trial.found += tracker.process(frame)
        tracker.go_on(self._grid(place))

    def _placed(
        self, tracker: VideoTracker, found: list[ReceivedSuperframe], start: int
    ) -> list[ReceivedSuperframe]:
        """Count positions from the receiver's first frame, not from the tracker's."""
        if found:
            self.profile = tracker.profile
        shift_s = start / float(self._timing.fps)
        timing = Timing(self._fps)
        return [replace(s, position_s=timing.on_a_frame_s(s.position_s + shift_s)) for s in found]

    def _choose(self) -> list[ReceivedSuperframe]:
        """Lock to the place whose pilots agree best, a moment after the first one was found."""
        locked = {region: trial for region, trial in self._trials.items() if trial.found}
        if not locked or self._doubt < DOUBT_FRAMES:
            self._doubt += bool(locked)
            return []
        best = max(locked, key=lambda region: locked[region].found[-1].confidence)
        trial = locked[best]
        self._trials, self._doubt = {}, 0
        self._newest.clear()
        self.region, self._tracker, self._start = best, trial.tracker, trial.start
        if self.first_lock_s is None:
            self.first_lock_s = self._frames / float(self._fps)
        return self._placed(trial.tracker, trial.found, trial.start)

    def _new_search(self) -> PlaceSearch:
        whole = _scaled(WHOLE, 1 / self._kept[0], 1 / self._kept[1])
        return PlaceSearch(
            self._shape, self._timing, whole=whole, crops=self._crops, **self._options
        )

    def _grid(self, region: Region) -> Grid:
        width, height, depth = self._size
        return Grid(width, height, depth, region=region, frames=self._every)


class _FrameSum:
    """Add up frames, so many at a time."""

    def __init__(self, frames: int, shape: tuple[int, int], dtype: type) -> None:
        self._frames, self._count = frames, 0
        self._sum: Luma | None = np.zeros(shape, dtype=dtype) if frames > 1 else None

    def add(self, frame: Luma) -> Luma | None:
        """Take a frame; return the sum, valid until the next one; None if more are to come."""
        if self._sum is None:
            return frame
        if self._count == 0:
            self._sum[:] = frame
        else:
            self._sum += frame
        self._count = (self._count + 1) % self._frames
        return None if self._count else self._sum


def _scaled(region: Region, across: float, down: float) -> Region:
    """Return a region in parts of another width and height."""
    return Region(
        region.left * across, region.top * down, region.width * across, region.height * down
    )
