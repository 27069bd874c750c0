"""Follow the superframes of a picture whose place is known: frames in, superframes out.

Pilots are watched at every frame; where their agreement peaks, a superframe's window ends there
and is decoded. Once locked, superframes are also read where they are due. Specification:
spec/video-carrier.md, section 6.
"""

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.link import Decoded, Link
from watermark.received import ReceivedSuperframe
from watermark.video.demodulate import Soft, coarse_share, pilot_metric, soft_bits
from watermark.video.embed import TEXTURE_EVERY
from watermark.video.grid import Grid
from watermark.video.layout import make_layout
from watermark.video.profile import COLUMNS, PROFILES, ROWS, TEMPLATES, VideoProfile
from watermark.video.timing import Timing

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]

THRESHOLD = 0.16
"""Least agreement of the pilots that is worth decoding: four standard deviations of noise."""

MAX_MISSES = 6
"""Superframes in a row without L0 after which the lock of a lone carrier is given up."""

TRACKING = 2.0
"""Frames that the clock moves for a full difference between the flanks of a peak."""


class Tracker:
    """Read superframes from luma.

    Parameters
    ----------
    grid : Grid
        Cells of the picture.
    timing : Timing
        Its frame rate.
    key : int
        Secret seed.
    strength : float
        As the embedder's.

    Attributes
    ----------
    profile : VideoProfile or None
        Profile of the last superframe found.
    errors, known : int
        Wrong and all coded bits of the superframes decoded.
    patience : int
        Superframes in a row without L0 after which the lock is given up.
    """

    def __init__(self, grid: Grid, timing: Timing, *, key: int = 0, strength: float = 1.0) -> None:
        self._grid, self._timing = grid, timing
        self._seen = grid.seen.reshape(-1)
        self._strength = strength
        self._choices = [(Link(p), make_layout(p, key), p) for p in PROFILES.values()]
        self._guard = max(1, round(self._timing.span / 6))
        self._kept = self._timing.window + 2 * self._guard + math.ceil(self._timing.span)
        self._frames: deque[FloatArray] = deque(maxlen=self._kept)
        self._textures: deque[tuple[int, FloatArray]] = deque(
            maxlen=self._kept // TEXTURE_EVERY + 1
        )
        self._agreement: deque[FloatArray] = deque(maxlen=2 * self._guard + 1)
        self._nowhere = np.zeros(TEMPLATES * ROWS * COLUMNS)
        self._count = 0
        self._due: float | None = None
        self._last = -math.inf
        self._misses = 0
        self._choice = 0
        self.errors = self.known = 0
        self.patience = MAX_MISSES
        self.profile: VideoProfile | None = None

    @property
    def locked(self) -> bool:
        """Whether superframes are being received."""
        return self._due is not None

    def process(self, luma: Luma) -> list[ReceivedSuperframe]:
        """Take the next frame; return the superframes found, about 0.2 s after their last frame.

        While locked, a superframe that could not be decoded is given with l0 = None.
        """
        if self._count % TEXTURE_EVERY == 0:
            self._textures.append((self._count, self._grid.texture(luma)))
        return self._advance(self._grid.project(luma).reshape(-1))

    def flush(self) -> list[ReceivedSuperframe]:
        """Return what the last frames still hold."""
        found = []
        for _ in range(self._guard if self._frames else 0):
            found += self._advance(self._frames[-1])
        return found

    def _advance(self, values: FloatArray) -> list[ReceivedSuperframe]:
        self._frames.append(values)
        self._count += 1
        self._agreement.append(self._watch())
        # The window in question ended `guard` frames ago, so that its neighbours are known too.
        start = self._count - self._guard - self._timing.window
        if start < 0:
            return []
        if self._due is not None and start == round(self._due):
            return [self._follow(start)]
        if self._is_peak() and (self._due is None or self._misses > 0):
            return self._search(start)
        return []

    def _search(self, start: int) -> list[ReceivedSuperframe]:
        """Try to decode where the pilots agree; lock on success."""
        best = int(self._agreement[-1 - self._guard].argmax())
        soft, decoded = self._decode(start, best)
        if decoded.l0 is None:
            return []
        self.profile = self._choices[best][2]
        self._choice = best
        before = self._before(start) if self._due is None else []
        return [*before, self._deliver(float(start), soft, decoded)]

    def _before(self, start: int) -> list[ReceivedSuperframe]:
        """Decode the superframe before the first one: its pilots alone may have been too weak."""
        place = start - self._timing.span
        if place < max(self._count - len(self._frames), self._last + self._timing.span / 2):
            return []
        soft, decoded = self._decode(round(place), self._choice)
        return [] if decoded.l0 is None else [self._deliver(place, soft, decoded)]

    def _follow(self, start: int) -> ReceivedSuperframe:
        """Decode the superframe that is due, a few frames off if its pilots say so."""
        nearby = [float(agreement[self._choice]) for agreement in self._agreement]
        centre = nearby[self._guard]
        offset = int(np.argmax(nearby)) - self._guard
        jump = max(nearby) > max(THRESHOLD, 1.1 * centre)
        soft, decoded = self._decode(start + (offset if jump else 0), self._choice)
        assert self._due is not None
        # A peak may be flat (a still picture); its flanks then tell where its middle is.
        nudge = TRACKING * (nearby[-1] - nearby[0]) / max(centre, THRESHOLD)
        return self._deliver(self._due + (offset if jump else nudge), soft, decoded)

    def _decode(self, start: int, choice: int) -> tuple[Soft, Decoded]:
        link, layout, profile = self._choices[choice]
        first = start - (self._count - len(self._frames))
        values = np.array([self._frames[first + i] for i in range(self._timing.window)])
        step = self._strength * profile.step
        mean, variance = values.mean(axis=0) / step, values.var(axis=0) / step**2
        coarse = self._coarse(start) if profile.textured else self._nowhere
        soft = soft_bits(mean, variance, layout, coarse)
        soft.ratios[~self._seen[layout.data]] = 0.0
        return soft, link.decode(soft.ratios)

    def _deliver(self, place: float, soft: Soft, decoded: Decoded) -> ReceivedSuperframe:
        """Hand a superframe out and note when the next one is due."""
        known = decoded.coded >= 0
        wrong = (soft.ratios < 0) != (decoded.coded == 1)
        self.errors += int(wrong[known].sum())
        self.known += int(known.sum())
        self._misses = 0 if decoded.l0 is not None else self._misses + 1
        self._last = place
        self._due = place + self._timing.span if self._misses <= self.patience else None
        return ReceivedSuperframe(
            decoded.l0,
            decoded.l1,
            self._timing.position_s(place),
            soft.agreement,
            float(wrong[known].mean()) if known.any() else 0.5,
            soft.ratios,
        )

    def _watch(self) -> FloatArray:
        """Agreement of each profile's pilots over the newest window."""
        window = self._timing.window
        if len(self._frames) < window:
            return np.zeros(len(self._choices))
        pilots = self._choices[0][1].pilots
        coarse = {False: self._nowhere, True: self._coarse(self._count - window)}
        newest = [self._frames[-1 - i][pilots] for i in range(window)]
        mean = np.mean(newest, axis=0) / self._strength
        return np.array(
            [
                abs(pilot_metric(mean / profile.step, layout, coarse[profile.textured][pilots]))
                for _, layout, profile in self._choices
            ]
        )

    def _coarse(self, start: int) -> FloatArray:
        """Probability of the coarse step for all positions, from the textures in a window."""
        window = range(start, start + self._timing.window)
        seen = [texture for count, texture in self._textures if count in window]
        if not seen:
            return np.zeros(TEMPLATES * ROWS * COLUMNS)
        return np.tile(coarse_share(np.mean(seen, axis=0)).reshape(-1), TEMPLATES)

    def _is_peak(self) -> bool:
        if len(self._agreement) < 2 * self._guard + 1:
            return False
        best = np.array([a.max() for a in self._agreement])
        return bool(best[self._guard] >= THRESHOLD and best.argmax() == self._guard)
