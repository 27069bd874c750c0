"""The running passage: what the last 20 to 41 s of a marked programme grade, stretch by stretch.

In: stretches as they would sound, and the one that was chosen; out: their own grades, and that of
the passage with each. One meter runs on, and its averages begin anew half a passage apart, so that
memory is constant. Source: ITU-R BS.1387 by `watermark.quality`.
"""

import copy
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.profile import FS
from watermark.quality import PeaqMeter
from watermark.quality.peaq import WHOLE

PASSAGE = 16
"""Stretches of a passage: 41 s."""

HALVES, OWN = ("even", "odd"), "own"
"""Names of the meter's averages: two that begin half a passage apart, and a stretch's own."""

RIPE = 0.25
"""Least maturity at which a stretch can be told to spoil a passage: a quarter of one."""


class Attempt(Protocol):
    """A stretch as it would sound."""

    @property
    def clean(self) -> NDArray[np.float64]:
        """The programme's front, shape (n, 1 or 2)."""

    @property
    def marked(self) -> NDArray[np.float64]:
        """The same with its mark."""


class GradedPassage:
    """Running grade and mean base of the last half to whole passage, by one meter that runs on."""

    def __init__(self, channels: int) -> None:
        self._meter = PeaqMeter(FS, channels)
        for name in HALVES:
            self._meter.begin(name)
        self._bases: dict[str, list[float]] = {name: [] for name in HALVES}
        self._count = 0
        self.last: float | None = None
        self.maturity = 0.0

    @property
    def _older(self) -> str:
        return HALVES[(self._count // (PASSAGE // 2)) % 2]

    @property
    def whole(self) -> float | None:
        """Grade of all that was heard so far, None for silence."""
        return _odg(self._meter, WHOLE)

    @property
    def count(self) -> int:
        """Stretches in it with the next one."""
        return len(self._bases[self._older]) + 1

    def grade(self, meter: PeaqMeter) -> float | None:
        """Grade with a meter's last stretch, None for silence."""
        return _odg(meter, self._older)

    def loss(self, meter: PeaqMeter) -> float:
        """Grade that a meter's last stretch has cost a passage, 0 where that is not known yet."""
        grade = _odg(meter, self._older)
        if self.maturity < RIPE or self.last is None or grade is None:
            return 0.0
        return self.last - grade

    def tried(self, attempt: Attempt) -> tuple[PeaqMeter, float | None]:
        """Let a copy of the meter hear an attempt; give it and the attempt's own grade."""
        meter = copy.deepcopy(self._meter)
        meter.begin(OWN)
        meter.process(attempt.clean, attempt.marked)
        return meter, _odg(meter, OWN)

    def add(self, meter: PeaqMeter, base: float) -> float | None:
        """Go on from the attempt that was chosen; return the passage's grade, None for silence."""
        self._meter = meter
        for bases in self._bases.values():
            bases.append(base)
        older = self._older
        self.mean_base = float(np.mean(self._bases[older]))
        # Squared: a young passage tells little of a programme.
        self.maturity = min(1.0, len(self._bases[older]) / (PASSAGE // 2)) ** 2
        self.last = grade = _odg(meter, older)
        self._count += 1
        if self._count % (PASSAGE // 2) == 0:
            meter.begin(older)
            self._bases[older] = []
            self.last = _odg(meter, self._older)
        return grade


def _odg(meter: PeaqMeter, name: str) -> float | None:
    result = meter.grade(name)
    return None if result is None else float(result.odg)
