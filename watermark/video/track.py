"""Follow the superframes of a picture whose place is known: frames in, superframes out.

Pilots are watched at every frame; where their agreement peaks, a superframe's window ends there
and is decoded. Once locked, superframes are also read where they are due. Specification:
spec/video-carrier.md, section 6.
"""

import math
from collections import deque
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.link.link import Decoded
from watermark.link.superframe import ReceivedSuperframe
from watermark.video.borders import TRUST, BorderClock
from watermark.video.demodulate import LAGS, Soft, soft_bits
from watermark.video.grid import Grid
from watermark.video.modes import PilotWatch
from watermark.video.profile import COLUMNS, LONE, ROWS, VideoProfile
from watermark.video.recent_frames import PLAIN, RecentFrames, WindowReading
from watermark.video.timing import Timing

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]

THRESHOLD = 0.16
"""Least agreement of the pilots that is worth decoding: four standard deviations of noise."""

MAX_MISSES = 6
"""Superframes in a row without L0 after which the lock of a lone carrier is given up."""

OTHER_MODE = 0.06
"""Agreement that another mode needs beyond the present one's: about twice the deviation of noise,
since both share three fifths of the pilots' bits."""

ATTEMPTS = 4
"""Windows that are tried for one superframe: weak pilots are often wrong by a frame or two."""

EARLIER = 2
"""Frames beyond the usual reach by which a window may begin earlier where nothing was decoded."""

LATE_BEGINS = 0.0, 0.25, 0.5, 0.75
"""Where in its window a late pattern may begin to be seen: a coder shows it from its next good
picture on, and the one before until then."""

FLAT_BEGINS = 0.5, 0.75
"""Where in a window flat cells are also taken from: coders and cleaners leave them longest as they
were, while textured ones show the new pattern at once, and their whole window is less noisy."""

LAG_ATTEMPTS = 4
"""Readings of a picture with a lag that are tried, those with the best agreement of the pilots."""

LIST, LONG_LIST = 8, 32
"""Paths of a decoder's list, and in these readings: they come last, and there are few."""

REMEMBERED = 8
"""Superframes whose L0 is known again: cleaners leave the pattern of a scene's first picture in
flat cells for seconds, and every second superframe its pilots agree."""

SLACK = 0.7
"""Part of a window's agreement above which one beside it may be the right one instead: where the
picture stands still many are alike, and borders decide."""

LATES = 1
"""Late superframes in a row that are read so; of more, it is rather the picture that is late."""


class VideoTracker:
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
        The programme's, once a superframe has shown it: never `LONE`. The ratios of superframes
        that failed are of this one.
    errors, known : int
        Wrong and all coded bits of the superframes decoded.
    patience : int
        Superframes in a row without L0 after which the lock is given up.
    """

    def __init__(self, grid: Grid, timing: Timing, *, key: int = 0, strength: float = 1.0) -> None:
        self._timing = timing
        self._watch = PilotWatch(key, strength)
        self._guard = max(1, round(self._timing.span / 6))
        kept = self._timing.window + 2 * self._guard + math.ceil(self._timing.span)
        self._frames = RecentFrames(grid, self._timing.window, kept)
        self._agreement: deque[FloatArray] = deque(maxlen=2 * self._guard + 1)
        self._pilots = np.zeros((self._timing.window, len(self._watch.positions)))
        self._pilot_textures: tuple[tuple[int, ...] | None, FloatArray] = None, np.zeros(0)
        self._pilot_cells = self._watch.positions % (ROWS * COLUMNS)
        self._clock = BorderClock(timing, self._watch)
        self._clocked = 0  # frames that the clock has seen
        self._due: float | None = None
        self._last = -math.inf
        self._newest: tuple[int, bytes] | None = None
        self._newest_place = 0.0
        self._read: deque[bytes] = deque(maxlen=REMEMBERED)
        self._lates = 0
        window = self._timing.window
        ends = window, window + self._guard
        parts = [(round(begin * window), end) for begin in FLAT_BEGINS for end in ends]
        self._lagged = [WindowReading(lag=lag) for lag in LAGS]
        self._lagged += [
            WindowReading(flat=part, lag=lag) for part in parts for lag in (0.0, *LAGS)
        ]
        self._misses = 0
        self._mode = 0
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
        self._frames.take(luma)
        return self._advance()

    def go_on(self, grid: Grid) -> None:
        """Take the next frames at another size; their place is that of the ones before."""
        self._frames.go_on(grid)

    def flush(self) -> list[ReceivedSuperframe]:
        """Return the superframes in the last frames."""
        found = []
        # Twice: a position that is late has its window that much later.
        for _ in range(2 * self._guard if self._frames.count else 0):
            self._frames.repeat()
            found += self._advance()
        return found

    def _advance(self) -> list[ReceivedSuperframe]:
        count = self._frames.count
        self._pilots[count % len(self._pilots)] = self._frames.newest[self._watch.positions]
        self._agreement.append(self._newest_agreement())
        # The window in question ended `guard` frames ago, so that its neighbours are known too.
        start = count - self._guard - self._timing.window
        if start < 0:
            return []
        if self._due is not None and start == round(self._due):
            return [self._follow(start)]
        if self._is_peak() and (self._due is None or self._misses > 0):
            return self._search(start)
        return []

    def _search(self, start: int) -> list[ReceivedSuperframe]:
        """Try to decode where the pilots agree; lock on success."""
        mode = int(self._agreement[-1 - self._guard].argmax())
        offset, soft, decoded, _ = self._attempt(start, mode)
        if decoded.l0 is None:
            return []
        self._mode = mode
        place = float(start + offset)
        if self._due is None:
            # Of the frames before, those of the window before show the border, if they are marked.
            self._clock.clear()
            self._clocked = start + offset - round(self._timing.span / 2)
        place += float(np.clip(self._on_time(place) - place, *self._slack(mode, offset)))
        before = self._before(place) if self._due is None else []
        return [*before, self._deliver(place, soft, decoded)]

    def _slack(self, mode: int, offset: int) -> tuple[float, float]:
        """How many frames a window that was decoded may be off, by the pilots around it."""
        agreement = np.array([each[mode] for each in self._agreement])
        here, bounds = max(0, self._guard + offset), []
        for side in (-1, 1):
            beside = agreement[here::side][: 2 * self._guard]
            least = SLACK * beside[0]
            below = np.flatnonzero(beside < least)
            # Before a picture's first window nothing is known.
            if not below.size or beside[below[0]] == 0:
                bounds.append(side * math.inf)
                continue
            n = int(below[0])
            part = (beside[n - 1] - least) / (beside[n - 1] - beside[n])
            bounds.append(side * float(n - 1 + part))
        return bounds[0], bounds[1]

    def _on_time(self, place: float) -> float:
        """Correct the place of a window by the borders of the frames so far."""
        first, count = max(self._clocked, self._frames.oldest), self._frames.count
        if first < count:
            values = self._frames.values(first, (0, count - first), self._watch.positions)
            texture = self._frames.texture(round(place))[self._pilot_cells]
            self._clock.add(first, values, texture)
        self._clocked = count
        lead = (self._timing.span - self._timing.window) / 2
        trust = TRUST if self._due is not None else 0.0
        return place + self._clock.correction(place - lead, trust=trust)

    def _before(self, start: float) -> list[ReceivedSuperframe]:
        """Decode the superframe before the first one: its pilots alone may have been too weak."""
        place = start - self._timing.span
        if place < max(self._frames.oldest, self._last + self._timing.span / 2):
            return []
        modes = [self._mode, *self._instead_of(self._mode)]
        tries = [self._decode(round(place), mode) for mode in modes]
        soft, decoded = max(tries, key=lambda each: (each[1].l0 is not None, each[0].agreement))
        return [] if decoded.l0 is None else [self._deliver(place, soft, decoded)]

    def _follow(self, start: int) -> ReceivedSuperframe:
        """Decode the superframe that is due, a few frames off if its pilots say so."""
        agreement = np.array(self._agreement)
        other = int(agreement[self._guard].argmax())
        sure = agreement[self._guard, other] > max(
            THRESHOLD, agreement[self._guard, self._mode] + OTHER_MODE
        )
        first = other if sure else self._mode
        failed: Soft | None = None
        for mode in (first, *self._instead_of(first)):
            # Pilots that are too weak to show the mode may leave enough of the data.
            offset, soft, decoded, late = self._attempt(start, mode)
            if decoded.l0 is not None:
                break
            if failed is None and self._watch.modes[mode].profile is self.profile:
                failed = soft
        assert self._due is not None
        if decoded.l0 is None:
            return self._deliver(self._due, failed or soft, decoded)
        self._mode = mode
        if offset:
            self._clock.clear()
        if late:
            # Its border was not seen where it is.
            self._clocked = self._frames.count
            self._lates += 1
            return self._deliver(self._due, soft, decoded)
        self._lates = 0
        return self._deliver(self._on_time(self._due + offset), soft, decoded)

    def _instead_of(self, mode: int) -> list[int]:
        """Modes to try after this one: its profile's other steps, then L0 alone or the usual."""
        profile = self._watch.modes[mode].profile
        other = self.profile if profile is LONE else LONE
        same, others = (
            [n for n, each in enumerate(self._watch.modes) if each.profile is wanted]
            for wanted in (profile, other)
        )
        return [n for n in same if n != mode] + others

    def _attempt(self, start: int, mode: int) -> tuple[int, Soft, Decoded, bool]:
        """Decode the window that starts here, or if that fails one close by.

        Returns
        -------
        int
            By how many frames the window is off.
        Soft
        Decoded
            With l0 = None if no window would do.
        bool
            Whether only a part of the window shows the pattern.
        """
        nearby = np.array([agreement[mode] for agreement in self._agreement])
        nearby[self._guard] = np.inf
        found: list[tuple[int, Soft, Decoded, bool]] = []
        for place in np.argsort(-nearby, kind="stable")[:ATTEMPTS]:
            offset = int(place) - self._guard
            found.append((offset, *self._decode(start + offset, mode), False))
            parity = self._parity(start)
            if offset == 0 and found[0][2].l0 is None and parity not in (None, found[0][1].parity):
                # Weak pilots may show the wrong one, and then too much noise.
                found.append((0, *self._decode(start, mode, parity=parity), False))
            if offset == 0 and found[0][2].l1 is None and self._lates < LATES:
                found += self._late(start, mode)
            if found[-1][2].l1 is not None:
                return found[-1]
        if self._due is not None and all(each[2].l0 is None for each in found):
            # Borders that a coder showed late may have made the position late.
            tried = {each[0] for each in found}
            earlier = [n for n in range(-1, -self._guard - EARLIER - 1, -1) if n not in tried]
            found += [(n, *self._decode(start + n, mode), False) for n in earlier]
        if all(each[2].l0 is None for each in found):
            found += self._lagging(start, mode)
        return max(found, key=lambda each: (each[2].l1 is not None, each[2].l0 is not None))

    def _late(self, start: int, number: int) -> list[tuple[int, Soft, Decoded, bool]]:
        """Decode the end of a window in which the pilots speak best for the parity that is due."""
        parity = self._parity(start)
        if parity is None:
            return []
        window, texture = self._timing.window, self._frames.texture(start)[self._pilot_cells]
        pilots = self._frames.values(start, (0, window + self._guard), self._watch.positions)
        parts = list(product(LATE_BEGINS, (window, window + self._guard)))
        agreement = []
        for begin, end in parts:
            mean = pilots[round(begin * window) : end].mean(axis=0)
            signed = self._watch.signed_agreement(mean, texture)[number]
            agreement.append(signed * (1 - 2 * parity))
        begin, end = parts[int(np.argmax(agreement))]
        soft, decoded = self._decode(start, number, WindowReading((round(begin * window), end)))
        return [(0, soft, decoded, True)] if soft.parity == parity else []

    def _parity(self, start: int) -> int | None:
        """Parity that is due in a window, if that is known."""
        if self._due is None or self._newest is None:
            return None
        away = round((start - self._newest_place) / self._timing.span)
        return (self._newest[0] + away) % 2

    def _lagging(self, start: int, number: int) -> list[tuple[int, Soft, Decoded, bool]]:
        """Decode a window close by as if pictures, or flat cells alone, lagged behind."""
        positions, cells = self._watch.positions, self._pilot_cells
        plain, parity = self._agreement[self._guard][number], self._parity(start)
        ranked = []
        for offset, (n, reading) in product((0, -1, 1), enumerate(self._lagged)):
            mean, _, texture = self._frames.mean(start + offset, reading)
            signed = self._watch.signed_agreement(mean[positions], texture[cells])[number]
            agreement = abs(signed) if parity is None else signed * (1 - 2 * parity)
            ranked.append((agreement, offset, n))
        best = [each for each in sorted(ranked, reverse=True) if each[0] > plain][:LAG_ATTEMPTS]
        return [
            (offset, *self._decode(start + offset, number, self._lagged[n], parity=parity), False)
            for _, offset, n in best
        ]

    def _decode(
        self, start: int, number: int, reading: WindowReading = PLAIN, *, parity: int | None = None
    ) -> tuple[Soft, Decoded]:
        """Decode a window, read in one way or another."""
        mode = self._watch.modes[number]
        mean, variance, texture = self._frames.mean(start, reading)
        hidden = ~self._frames.seen[mode.layout.data]
        soft = soft_bits(mean, variance, mode, texture, parity)
        soft.ratios[hidden] = 0.0
        size = LONG_LIST if reading in self._lagged else LIST
        decoded = mode.link.decode(soft.ratios, list_size=size)
        if decoded.l0 is not None and decoded.l1 is None:
            # Known values of L0 show the noise better than the pilots alone.
            first = decoded.coded[: mode.profile.l0_coded]
            soft = soft_bits(mean, variance, mode, texture, soft.parity, first=first)
            soft.ratios[hidden] = 0.0
            l1 = mode.link.second(soft.ratios, list_size=size)
            if l1 is not None:
                decoded = mode.link.complete(decoded, l1)
        shown = None if parity is not None or soft.agreement < THRESHOLD else soft.parity
        if self._is_old(start, decoded.l0, shown):
            # Coders, cleaners and frozen pictures show a pattern on.
            decoded = replace(decoded, l0=None, l1=None)
        return soft, decoded

    def _is_old(self, start: int, l0: bytes | None, parity: int | None) -> bool:
        """Whether a window shows a superframe from before: one that is due differs or alternates.

        Parameters
        ----------
        start : int
        l0 : bytes or None
        parity : int or None
            None where the pilots do not show it.
        """
        if self._newest is None or start <= self._newest_place + self._guard:
            return False
        if l0 == self._newest[1]:
            return parity in (None, self._newest[0])
        return l0 in self._read

    def _deliver(self, place: float, soft: Soft, decoded: Decoded) -> ReceivedSuperframe:
        """Hand a superframe out and note when the next one is due."""
        known = decoded.coded >= 0
        wrong = (soft.ratios < 0) != (decoded.coded == 1)
        self.errors += int(wrong[known].sum())
        self.known += int(known.sum())
        profile = self._watch.modes[self._mode].profile
        if profile is not LONE:
            self.profile = profile
        self._misses = 0 if decoded.l0 is not None else self._misses + 1
        if decoded.l0 is not None:
            due = self._parity(round(place))
            # Pilots that are too weak to show it would let this superframe pass for the next, too.
            parity = soft.parity if due is None or soft.agreement >= THRESHOLD else due
            self._newest, self._newest_place = (parity, decoded.l0), place
            self._read.append(decoded.l0)
        self._last = place
        self._due = place + self._timing.span if self._misses <= self.patience else None
        return ReceivedSuperframe(
            decoded.l0,
            decoded.l1 or None,
            self._timing.position_s(place),
            soft.agreement,
            float(wrong[known].mean()) if known.any() else 0.5,
            soft.ratios if self.profile is not None else None,
        )

    def _newest_agreement(self) -> FloatArray:
        """Agreement of each mode's pilots over the newest window."""
        if self._frames.count < self._timing.window:
            return np.zeros(len(self._watch.modes))
        return self._watch.agreement(self._pilots.mean(axis=0), self._newest_texture())

    def _newest_texture(self) -> FloatArray:
        """Texture of each pilot's cell in the newest window."""
        start = self._frames.count - self._timing.window
        there = self._frames.textured(start)
        if there != self._pilot_textures[0]:
            self._pilot_textures = there, self._frames.texture(start)[self._pilot_cells]
        return self._pilot_textures[1]

    def _is_peak(self) -> bool:
        if len(self._agreement) < 2 * self._guard + 1:
            return False
        best = np.array([a.max() for a in self._agreement])
        return bool(best[self._guard] >= THRESHOLD and best.argmax() == self._guard)
