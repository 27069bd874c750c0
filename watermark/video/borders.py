"""Where superframes begin, to a fraction of a frame, from the pilots in single frames.

In: amplitudes of the pilots in each frame; out: a correction of a superframe's position. Pilots are
inverted from one superframe to the next, so that their agreement, with its sign, alternates. The
fade and motion make it a symmetric wave, which is fitted to the last superframes. Windows alone
leave a position undecided where the picture is still or a receiver tuned in within a superframe.
Coders copy a cell from frame to frame as long as that is good enough, and a copy shows the pattern
of the frame that it was coded in: only cells that change from one frame to the next date it.
Specification: spec/video-carrier.md, sections 2 and 6.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from watermark.video.lattices import pilot_waves
from watermark.video.layout import common_pilots
from watermark.video.modes import PilotWatch
from watermark.video.profile import FADE
from watermark.video.timing import Timing

FloatArray = NDArray[np.float64]

REMEMBERED = 12
"""Superframes whose frames count."""

REACH, STEP = 4.0, 0.05
"""Largest correction and distance of those that are tried, in frames at 25 frames per second."""

WIDTHS = (8.0, 0.4, 0.2, 0.12)
"""Widths in superframes of the waves that are tried: where the picture moves, frames far from the
middle of a window are far from its mean, and from the lattices."""

CLEAR = 16.0
"""Least difference between the best and the worst correction, in squared standard deviations, for
taking any: a picture with no border in view has none."""

TRUST = 4.0
"""Squared standard deviations of noise that a correction by one frame at 25 per second costs; twice
as many frames cost four times as much. The position so far rests on windows and on earlier
borders, and a border may be seen late: coders show a weak new pattern from their next good picture
on."""

CHANGED = 0.03
"""Least change of an amplitude from one frame to the next, in steps, of a cell that is no copy. Of
0 to .1 the best on four films through H.264, HEVC, AV1, MPEG-2 and `hqdn3d`; with more, positions
are early, for then nearly all cells that count are in the middle of a fade."""

ALIKE = 4
"""Frames that all pilots together count in the weight of each: few frames say little of one."""

UNMARKED = 0.2
"""Agreement of a window, as a part of the other one's at a border, below which it has no mark."""

NOISE = 0.5
"""Variance of the agreement of a pilot that noise alone decides."""


class BorderClock:
    """Fit the borders of superframes to the signed agreement of the pilots.

    Parameters
    ----------
    timing : Timing
        Frame rate.
    watch : PilotWatch
        The pilots; those of all modes count.

    Examples
    --------
    >>> from fractions import Fraction
    >>> watch, timing = PilotWatch(), Timing(Fraction(25))
    >>> layout, step = watch.modes[0].layout, watch.modes[0].pilot_step
    >>> dither = layout.dither[watch.positions]
    >>> even, odd = (step * (dither + (layout.pilot_bits ^ parity) / 2) for parity in (0, 1))
    >>> weights = np.clip((np.arange(6, 32) + 0.5 - 18) / 4 + 0.5, 0, 1)[:, None]
    >>> clock = BorderClock(timing, watch)
    >>> clock.add(6, (1 - weights) * even + weights * odd, np.zeros(even.size))
    >>> round(clock.correction(1.0), 1)
    1.0
    """

    def __init__(self, timing: Timing, watch: PilotWatch) -> None:
        self._span = timing.span
        self._common = common_pilots()
        mode = watch.modes[0]
        self._signs = 1.0 - 2.0 * mode.layout.pilot_bits[self._common]
        self._dither = mode.layout.dither[watch.positions[self._common]]
        self._step = mode.pilot_step
        unit = timing.span / 16
        self._tried = np.arange(-REACH, REACH + STEP / 2, STEP) * unit
        kept = round(REMEMBERED * timing.span)
        self._times: deque[float] = deque(maxlen=kept)
        self._waves: deque[FloatArray] = deque(maxlen=kept)
        self._changed: deque[NDArray[np.bool_]] = deque(maxlen=kept)
        self._newest: FloatArray | None = None

    def clear(self) -> None:
        """Forget all frames."""
        for frames in (self._times, self._waves, self._changed):
            frames.clear()
        self._newest = None

    def add(self, first: int, values: FloatArray, texture: FloatArray) -> None:
        """Take frames in order.

        Parameters
        ----------
        first : int
            Number of the first frame.
        values : ndarray of float64, shape (frames, PILOTS)
            Amplitudes of the pilots in luma of 8 bits.
        texture : ndarray of float64, shape (PILOTS,)
            Textures of their cells.
        """
        places = values[:, self._common] / self._step - self._dither
        before = places[0] if self._newest is None else self._newest
        changes = np.abs(np.diff(places, axis=0, prepend=before[None]))
        self._newest = places[-1]
        self._times.extend(first + 0.5 + np.arange(len(places)))
        self._waves.extend(
            self._signs * pilot_waves(each, texture[self._common]) for each in places
        )
        self._changed.extend(changes > CHANGED)

    def correction(self, position: float, *, trust: float = TRUST) -> float:
        """Return the delay in frames of a superframe that starts at frame `position`.

        Parameters
        ----------
        position : float
        trust : float
            In place of `TRUST`; 0 for a position that rests on nothing yet.
        """
        if len(self._times) < self._span / 2:
            return 0.0
        times = np.array(self._times)
        agreement, weights, whole = self._agreement((times - position) / self._span)
        if trust and not whole:
            return 0.0
        place = (times[:, None] - position - self._tried) / self._span
        number = np.floor(place)
        inside = place - number
        depth = np.minimum(np.minimum(inside, 1 - inside), FADE / 2)
        # Amplitudes fade linearly, and a wave is the cosine of the amplitude.
        still = np.sin(np.pi / FADE * depth) * (1 - 2 * (number % 2))
        explained = np.zeros(self._tried.size)
        for width in WIDTHS:
            waves = still * np.exp(-(((inside - 0.5) / width) ** 2))
            power = np.maximum(weights @ waves**2, 1e-9)
            fitted = (agreement @ waves) ** 2 / power
            if fitted.max() > explained.max():
                explained = fitted
        dated = weights > 0
        left = float(np.sum(agreement[dated] ** 2 / weights[dated])) - explained.max()
        noise = max(left / max(1, dated.sum()), NOISE / 4)
        if explained.max() - explained.min() < CLEAR * noise:
            return 0.0
        explained -= trust * noise * (16 / self._span * self._tried) ** 2
        return float(self._tried[int(explained.argmax())])

    def _agreement(self, place: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
        """Return the weighted sum of the pilots that changed, and of their squared weights.

        At a border, a pilot's weight is its agreement with the windows beside it: pilots that
        change in the fade alone are clean, those that change before are not, and unweighted they
        would not meet in its middle. As long as no border is seen from both sides, all pilots
        count alike.

        Parameters
        ----------
        place : ndarray of float64, shape (frames,)
            Superframes from the assumed start of one to the middle of each frame.

        Returns
        -------
        sums, squares : ndarray of float64, shape (frames,)
        whole : bool
            Whether a border is seen from both sides.
        """
        waves, changed = np.array(self._waves), np.array(self._changed)
        signed = waves * (1 - 2 * (np.floor(place) % 2))[:, None]
        border = np.round(place)
        away = place - border
        if signed[abs(away) > FADE / 2].sum() < 0:
            signed = -signed
        weights, alike, whole = np.zeros_like(waves), np.ones_like(waves), False
        for each in np.unique(border):
            there = border == each
            windows = [there & (sign * away > FADE / 2) for sign in (-1, 1)]
            known = [window.sum() > 1 for window in windows]
            levels = [float(signed[window].mean()) for window in windows if window.sum() > 1]
            marked = [
                has and float(signed[window].mean()) > UNMARKED * max(levels)
                for has, window in zip(known, windows, strict=True)
            ]
            bare = [has and not shown for has, shown in zip(known, marked, strict=True)]
            alike[there] = 1.0 - np.where(away[there, None] < 0, *bare)
            whole |= all(marked)
            # Without the frame itself, whose noise would agree with its own weight.
            means = [
                (signed[window].sum(axis=0) - window[there, None] * signed[there])
                / (window.sum() - window[there, None])
                for window, shown in zip(windows, marked, strict=True)
                if shown
            ]
            if means:
                few = ALIKE / (sum(window.sum() for window in windows) + ALIKE)
                weight = (1 - few) * np.mean(means, axis=0) + few * np.mean(means)
                weights[there] = np.maximum(weight, 0.0) * changed[there] * alike[there]
        if not whole:
            weights = alike
        return np.sum(weights * waves, axis=1), np.sum(weights**2, axis=1), whole
