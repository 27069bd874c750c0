"""Where superframes begin, to a fraction of a frame, from the pilots in single frames.

In: amplitudes of the pilots in each frame; out: a correction of a superframe's position. Pilots are
inverted from one superframe to the next, so that their agreement, with its sign, alternates. The
fade and motion make it a symmetric wave, which is fitted to the last superframes. Windows alone
leave a position undecided where the picture is still or a receiver tuned in within a superframe. A
delay by a cleaner's temporal filter passes for one of the superframes: their fades look alike.
Specification: spec/video-carrier.md, sections 2 and 6.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from watermark.video.lattices import pilot_waves
from watermark.video.layout import common_pilots
from watermark.video.modes import PilotWatch
from watermark.video.profile import FADE, TEXTURE
from watermark.video.timing import Timing

FloatArray = NDArray[np.float64]

REMEMBERED = 12
"""Superframes whose frames count: at an agreement of .1 they leave an error of 8 ms."""

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


LEADERS, FLAT_WEIGHT = 12, 0.1
"""Pilots in textured cells from which on those in flat ones count so little: coders and cleaners
show a new pattern in flat cells late. Of .1 to 1 the best on two films through H.264, HEVC, AV1
and `hqdn3d`; three others agreed, and two with four pilots in texture were better without."""


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
        self._samples: deque[tuple[float, float]] = deque(maxlen=round(REMEMBERED * timing.span))

    def clear(self) -> None:
        """Forget all frames."""
        self._samples.clear()

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
        texture = texture[self._common]
        textured = texture > TEXTURE
        weights = np.where(textured | (textured.sum() < LEADERS), 1.0, FLAT_WEIGHT)
        signs = self._signs * weights / weights.sum()
        for n, place in enumerate(places):
            waves = pilot_waves(place, texture)
            self._samples.append((first + n + 0.5, float(signs @ waves)))

    def correction(self, position: float, *, trust: float = TRUST) -> float:
        """Return the delay in frames of a superframe that starts at frame `position`.

        Parameters
        ----------
        position : float
        trust : float
            In place of `TRUST`; 0 for a position that rests on nothing yet.
        """
        if len(self._samples) < self._span / 2:
            return 0.0
        times, agreement = np.array(self._samples).T
        place = (times[:, None] - position - self._tried) / self._span
        number = np.floor(place)
        inside = place - number
        depth = np.minimum(np.minimum(inside, 1 - inside), FADE / 2)
        # Amplitudes fade linearly, and a wave is the cosine of the amplitude.
        still = np.sin(np.pi / FADE * depth) * (1 - 2 * (number % 2))
        explained = np.zeros(self._tried.size)
        for width in WIDTHS:
            waves = still * np.exp(-(((inside - 0.5) / width) ** 2))
            fitted = (agreement @ waves) ** 2 / np.sum(waves**2, axis=0)
            if fitted.max() > explained.max():
                explained = fitted
        left = float(agreement @ agreement) - explained.max()
        noise = max(left / len(times), 0.5 / self._signs.size / 4)
        if explained.max() - explained.min() < CLEAR * noise:
            return 0.0
        explained -= trust * noise * (16 / self._span * self._tried) ** 2
        return float(self._tried[int(explained.argmax())])
