"""Spreading: the bytes of a file over its superframes, where they lower the error most.

Superframes of a file need not have one size. They take one step, and for as many as the limit
allows the next wider one, so that a bit is worth the same everywhere. A score is sent where it
costs no more than it saves: what is coded with a score is never worse than without.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.allocation import Choice, choose, content_at, weigh
from codec.bitstream.analysis import Analysis
from codec.bitstream.coding import coding_for
from codec.bitstream.encoder import SuperframeEncoder
from codec.bitstream.payload import write_l0_whole
from codec.bitstream.plan import Plan, plan_of
from codec.bitstream.quantise import NO_RESIDUAL, STEPS, WEIGHT, width_mm
from codec.bitstream.superframe import Superframe
from codec.cuer.layout import MARKERS
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import CueingOptions
from codec.cues.timeline import TICKS
from codec.errors import CueError

Array = NDArray[np.float64]
Frames = list[Superframe]
Size = Callable[[Superframe], int]

_OPEN_BYTES = 4000
"""Bytes of a superframe whose length is not bound yet: more than any needs."""

_GOLDEN = (5**0.5 - 1) / 2
"""Golden section: it orders superframes so that every beginning is spread evenly."""

_NEAR = 1.01
"""Factor by which the error, or the size, may be greater if the score travels for it."""

_ROUNDS = 2
"""Times that superframes are asked again whether their score pays, after others went without."""

_COARSE = 20
"""Step at which scores are weighed before the right one is known."""


@dataclass(frozen=True, slots=True)
class _Part:
    """A superframe, ready to be told at any step."""

    plan: Plan
    choice: Choice

    @property
    def index(self) -> int:
        return self.plan.analysis.index


class _Take:
    """A motion that is to be spread.

    Parameters
    ----------
    motion : Motion
    voice : Voice
    indices : sequence of int
    options : CueingOptions
    """

    def __init__(
        self, motion: Motion, voice: Voice, indices: Sequence[int], options: CueingOptions
    ) -> None:
        self._motion, self._indices = motion, indices
        self._encoder = SuperframeEncoder(
            voice, l0_bytes=_OPEN_BYTES, l1_bytes=0, lead=0, options=options
        )
        self._coding = coding_for(voice)
        self.bases = self._coding.bases
        self._plans: dict[tuple[int, frozenset[int]], Plan] = {}
        self._parts: dict[tuple[int, frozenset[int], int], _Part] = {}

    def parts(self, step: int, untold: frozenset[int]) -> list[_Part]:
        """Return the superframes, their bases chosen at a step."""
        return [self._part(index, step, untold) for index in self._indices]

    def _part(self, index: int, step: int, untold: frozenset[int]) -> _Part:
        silent = frozenset({index}) if index in untold else untold & {index - 1, index + 1}
        if (index, silent) not in self._plans:
            analysis = self._encoder.analyse(self._motion, index, silent)
            self._plans[index, silent] = plan_of(analysis, {})
        plan = self._plans[index, silent]
        if (index, silent, step) not in self._parts:
            choice = choose(plan.analysis, self.bases, step)
            self._parts[index, silent, step] = _Part(plan, choice)
        return self._parts[index, silent, step]

    def plain(self, step: int) -> list[_Part]:
        """Return the superframes without any score."""
        return self.parts(step, frozenset(range(self._indices[0] - 1, self._indices[-1] + 2)))

    def paying(self, step: int, plain: Sequence[_Part]) -> list[_Part]:
        """Return the superframes, those without their score that are better off so."""
        untold = frozenset[int]()
        parts = self.parts(step, untold)
        for _ in range(_ROUNDS):
            worse = {
                one.index for one, other in zip(parts, plain, strict=True)
                if one.plan.analysis.part is not None
                and self._weight(one, step) > self._weight(other, step)
            }  # fmt: skip
            if not worse:
                break
            untold |= worse
            parts = self.parts(step, untold)
        return parts

    def _weight(self, part: _Part, step: int) -> float:
        bits, squares = self.weigh(part, step)
        return squares / width_mm(step) ** 2 + WEIGHT * bits

    def weigh(self, part: _Part, step: int) -> tuple[float, float]:
        """Return bits and squared error of a superframe at a step."""
        analysis: Analysis = part.plan.analysis
        bits, squares = weigh(analysis, part.choice, self.bases, step)
        return bits + part.plan.bits, squares

    def frames(self, parts: Sequence[_Part], steps: NDArray[np.int64]) -> Frames:
        """Return the superframes at steps of their own."""
        identity = self._coding.identity
        return [
            Superframe(
                part.index,
                write_l0_whole(
                    content_at(part.plan, self.bases, part.choice, int(step)), self.bases, identity
                ),
                b"",
            )
            for part, step in zip(parts, steps, strict=True)
        ]


class _Costs:
    """Bits and squared errors of superframes at any step, found when they are asked for."""

    def __init__(self, take: _Take, parts: Sequence[_Part]) -> None:
        self._take, self._parts = take, parts
        self._known: dict[int, tuple[Array, Array]] = {}

    def at(self, step: int) -> tuple[Array, Array]:
        """Return bits and squared errors at a step, shape (n,) each."""
        if step not in self._known:
            rows = [self._take.weigh(part, step) for part in self._parts]
            bits, squares = np.array(rows).T
            self._known[step] = bits, squares
        return self._known[step]

    def steps(self, within: Callable[[Array, Array], bool], *, finest: bool) -> NDArray[np.int64]:
        """Return the finest steps that keep a size, or the widest that keep an error.

        Parameters
        ----------
        within : callable
            Says of bits and squared errors whether they keep the limit.
        finest : bool
            Whether finer steps break the limit, else wider ones.
        """
        low, high = 0, NO_RESIDUAL
        while low < high:
            middle = (low + high + (not finest)) // 2
            if within(*self.at(middle)) == finest:
                low, high = (low, middle) if finest else (low, middle - 1)
            else:
                low, high = (middle + 1, high) if finest else (middle, high)
        steps = np.full(len(self._parts), low)
        other = low - 1 if finest else low + 1
        if not 0 <= other < STEPS:
            return steps
        # Spread evenly by the golden section, in whatever number.
        order = np.argsort(np.arange(len(steps)) * _GOLDEN % 1.0)
        few, many = 0, len(steps)
        while few < many:
            middle = (few + many + 1) // 2
            if within(*self._mixed(low, other, order[:middle])):
                few = middle
            else:
                many = middle - 1
        steps[order[:few]] = other
        return steps

    def _mixed(self, step: int, other: int, where: NDArray[np.int64]) -> tuple[Array, Array]:
        bits, squares = (values.copy() for values in self.at(step))
        for values, more in zip((bits, squares), self.at(other), strict=True):
            values[where] = more[where]
        return bits, squares

    def squares(self, steps: NDArray[np.int64]) -> float:
        """Return the squared error of superframes at steps of their own."""
        return float(sum(self.at(int(s))[1][i] for i, s in enumerate(steps)))


def spread_by_error(
    motion: Motion,
    voice: Voice,
    indices: Sequence[int],
    error_mm: float,
    size: Size,
    *,
    keep: bool,
    options: CueingOptions,
) -> Frames:
    """Return the smallest superframes that keep an error together.

    Parameters
    ----------
    motion : Motion
    voice : Voice
    indices : sequence of int
        Superframes that cover it.
    error_mm : float
        RMS over all markers and frames.
    size : callable
        Bytes that a superframe takes.
    keep : bool
        Send the score everywhere.
    options : CueingOptions
    """
    take = _Take(motion, voice, indices, options)
    most = error_mm**2 * len(indices) * TICKS * len(MARKERS)

    def within(_: Array, squares: Array) -> bool:
        return float(squares.sum()) <= most

    def told(parts: Sequence[_Part]) -> tuple[Frames, int]:
        steps = _Costs(take, parts).steps(within, finest=False)
        return take.frames(parts, steps), int(np.median(steps))

    if motion.score is None or keep:
        return told(take.parts(told(take.parts(_COARSE, frozenset()))[1], frozenset()))[0]
    _, step = told(take.plain(_COARSE))
    plain = take.plain(step)
    without, _ = told(plain)
    with_score, _ = told(take.paying(step, plain))
    better = sum(map(size, with_score)) <= _NEAR * sum(map(size, without))
    return with_score if better else without


def spread_by_size(
    motion: Motion,
    voice: Voice,
    indices: Sequence[int],
    room: int,
    size: Size,
    *,
    keep: bool,
    options: CueingOptions,
) -> Frames:
    """Return the superframes of least error that fit into a number of bytes together.

    Parameters
    ----------
    motion : Motion
    voice : Voice
    indices : sequence of int
        Superframes that cover it.
    room : int
        Bytes.
    size : callable
        Bytes that a superframe takes.
    keep : bool
        Send the score everywhere.
    options : CueingOptions

    Raises
    ------
    CueError
        If they do not fit even without coefficients.
    """
    take = _Take(motion, voice, indices, options)

    def told(parts: Sequence[_Part]) -> tuple[Frames, float, int]:
        costs, spare = _Costs(take, parts), _record_bits(len(parts))
        while True:
            left = 8.0 * room - spare
            steps = costs.steps(lambda bits, _, left=left: float(bits.sum()) <= left, finest=True)  # type: ignore[misc]
            frames = take.frames(parts, steps)
            over = sum(map(size, frames)) - room
            if over <= 0:
                return frames, costs.squares(steps), int(np.median(steps))
            if (steps == NO_RESIDUAL).all():
                raise CueError(f"{room} bytes do not hold {len(parts)} superframes")
            spare += 8.0 * over

    if motion.score is None or keep:
        _, _, step = told(take.parts(_COARSE, frozenset()))
        return told(take.parts(step, frozenset()))[0]
    _, _, step = told(take.plain(_COARSE))
    plain = take.plain(step)
    without, bare, _ = told(plain)
    try:
        with_score, error, _ = told(take.paying(step, plain))
    except CueError:
        return without
    return with_score if error <= _NEAR**2 * bare else without


def _record_bits(count: int) -> float:
    """Return the bits that records take beside their payload's ideal length, about."""
    return 12.0 * count
