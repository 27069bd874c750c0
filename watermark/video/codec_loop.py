"""Codec in the loop: each superframe is tried on the broadcaster's own coder before it is marked.

In: the picture and the designs of its superframes; out: for each one its strength, that of L0 and
that of L1 apart. First a trial: a copy of the picture has a random strength in every value, and the
decoded copy shows how much information each of them leaves, so that one run of the coder tries them
all. Then a rehearsal: the chosen mark goes through another such coder, for strong values change how
a coder treats the weak ones beside them, and a trial errs by up to twice either way. The coders run
on as one stream, for their rate control has a long memory. Source: the copy of the receiver inside
the emitter of Baras, Moreau and Dymarski, IEEE TASLP 14(5), 2006.
"""

import os
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from watermark.video.coder_trial import ODDS, TRIED, find_left, measure_left
from watermark.video.coder_windows import CoderWindow, CoderWindows, PictureCoder
from watermark.video.design import Design, Strength, Way, fixed_strength
from watermark.video.fading import PatternWriter
from watermark.video.modes import Mode
from watermark.video.painting import Painter
from watermark.video.profile import POSITIONS, VideoProfile
from watermark.video.strength_choice import StrengthChoice, TrialResult, TriedChannel
from watermark.video.timing import Timing

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Note = TypeVar("Note")
Windows = Sequence[CoderWindow | None]


class PictureLoop:
    """Choose the strength of each superframe.

    Parameters
    ----------
    profile : VideoProfile
        Of the mark.
    modes : sequence of Mode
        The profile's, one for each step, then those of `LONE`.
    painter : Painter
        Of patterns for the picture.
    depth : int
        Bits per sample.
    timing : Timing
        Frame rate.
    channels : sequence of TriedChannel
        All have to be survived.
    """

    def __init__(
        self,
        profile: VideoProfile,
        modes: Sequence[Mode],
        painter: Painter,
        depth: int,
        timing: Timing,
        channels: Sequence[TriedChannel],
    ) -> None:
        self._modes, self._shape = modes, painter.shape
        self._choice = StrengthChoice(profile, modes, painter.shape, channels)
        coders = [channel.coder for channel in channels]
        again = [channel.again for channel in channels]
        self._trial: _CoderRun[IntArray] = _CoderRun(painter, depth, timing, coders)
        self._rehearsal: _CoderRun[tuple[Strength, TrialResult | None]]
        self._rehearsal = _CoderRun(painter, depth, timing, again)

    def process(self, luma: Luma, design: Design | None) -> list[Strength]:
        """Take the next frame, and the design that it completed, if any.

        Returns
        -------
        list of Strength
            Those of the next superframes.
        """
        self._trial.add_frame(luma)
        self._rehearsal.add_frame(luma)
        if design is not None:
            choice = np.random.default_rng(design.place).choice(len(TRIED), POSITIONS, p=ODDS)
            ways = [(rung, Way(share, share)) for rung, share in TRIED]
            tried = [Strength(rung, way, way) for rung, way in ways]
            self._trial.add(design, design.mixed(self._modes, tried, choice), choice)
        self._rehearse(self._trial.ready())
        return [self._corrected(*each) for each in self._rehearsal.ready()]

    def flush(self) -> list[Strength]:
        """Return the strengths of the superframes still on trial."""
        self._rehearse(self._trial.end())
        return [self._corrected(*each) for each in self._rehearsal.end()]

    def _rehearse(self, tried: list[tuple[Design, IntArray, Windows]]) -> None:
        """Choose strengths after their trial and send them on to their rehearsal."""
        for design, choice, windows in tried:
            strength, result = fixed_strength(design.place, self._shape), None
            there = [window for window in windows if window is not None]
            if len(there) == len(windows):
                findings = [find_left(each, design, choice, self._modes) for each in there]
                result = self._choice.result(design, findings)
                strength = self._choice.least_visible(result)
            moves = design.moves(self._modes, strength)
            self._rehearsal.add(design, moves, (strength, result))

    def _corrected(
        self, design: Design, note: tuple[Strength, TrialResult | None], windows: Windows
    ) -> Strength:
        """Return the strength after a rehearsal."""
        strength, result = note
        if result is None:
            return strength
        mode = self._modes[strength.mode]
        measured = [None if each is None else measure_left(each, design, mode) for each in windows]
        result.correct(strength, measured)
        return self._choice.least_visible(result)


class _CoderRun(Generic[Note]):
    """A picture with one pattern for each superframe on its way through coders, if there are any.

    A note goes with each superframe.
    """

    def __init__(
        self, painter: Painter, depth: int, timing: Timing, coders: Sequence[PictureCoder | None]
    ) -> None:
        self._painter = painter
        self._writer = PatternWriter(painter.shape, depth, timing)
        self._coders = [None if coder is None else CoderWindows(coder, timing) for coder in coders]
        self._windows: list[deque[CoderWindow | None]] = [deque() for _ in coders]
        self._waiting: deque[tuple[Design, Note]] = deque()
        # Coders give other threads their turn while they work.
        self._threads = ThreadPoolExecutor(min(len(coders), os.cpu_count() or 1))

    def add_frame(self, luma: Luma) -> None:
        """Take the next frame."""
        self._writer.add_frame(luma)

    def add(self, design: Design, moves: FloatArray, note: Note) -> None:
        """Take the next superframe and by how much its amplitudes move."""
        self._writer.add_pattern(self._painter.paint(moves, design.smooth))
        self._waiting.append((design, note))
        for coder, windows in zip(self._coders, self._windows, strict=True):
            if coder is None:
                windows.append(None)
            else:
                coder.expect(design.place)

    def ready(self) -> list[tuple[Design, Note, Windows]]:
        """Return the superframes that all coders gave back, with their windows."""
        self._send(self._writer.ready())
        return self._done()

    def end(self) -> list[tuple[Design, Note, Windows]]:
        """Return those still in the coders."""
        self._send(self._writer.end())
        for coder, windows in zip(self._coders, self._windows, strict=True):
            windows.extend([] if coder is None else coder.flush())
        self._threads.shutdown()
        return self._done()

    def _send(self, frames: list[Luma]) -> None:
        if not frames:
            return
        pairs = zip(self._coders, self._windows, strict=True)
        there = [(coder, windows) for coder, windows in pairs if coder is not None]
        sent = self._threads.map(lambda each: each[0].process(frames), there)
        for (_, windows), new in zip(there, sent, strict=True):
            windows.extend(new)

    def _done(self) -> list[tuple[Design, Note, Windows]]:
        return [
            (*self._waiting.popleft(), [windows.popleft() for windows in self._windows])
            for _ in range(min(len(windows) for windows in self._windows))
        ]
