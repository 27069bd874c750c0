"""Versions of a take: its superframes with one prediction, at any step, in bits and errors.

A take is a motion as blocks of 32 frames, with its score or without. A version of it uses its
prediction in one way: with learnt corrections, as the voice has it, or not at all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import CueingOptions
from codec.cues.timeline import SUPERFRAME_S, TICKS, ScoreLine, to_line, to_ticks
from codec.streamfile.file_score import FileScore, trimmed, write_common
from codec.streamfile.learning import Gain, Learner
from codec.streamfile.whole_score import WholeResynthesis
from codec.superframe.allocation import BasisChoice, choose, content_at, weigh
from codec.superframe.analysis import Analysis, block_at
from codec.superframe.bits import PLAIN, SCORE, SEQUENCES, Header
from codec.superframe.coding import coding_for
from codec.superframe.decoder import likely_block, residual_of
from codec.superframe.fitting import NOMINAL_MM, fits
from codec.superframe.merging import MergedScore, join_line
from codec.superframe.payload import payload_of
from codec.superframe.plan import SuperframePlan, plan_of
from codec.superframe.quantise import NO_RESIDUAL, NOTHING_SENT, STEPS, WEIGHT, Setting, width_mm
from codec.superframe.score_coding import part_of

Array = NDArray[np.float64]

COARSE = 24
"""Step at which superframes are weighed before the right one is known."""

Progress = Callable[[float], None]


def silent(seconds: float) -> None:
    """Show no progress."""


_GOLDEN = (5**0.5 - 1) / 2
"""Golden section: it orders superframes so that every beginning is spread evenly."""

_CLEAR = 0.85
"""Part of the prediction's error that learning has to leave for it to be taken untried."""


@dataclass(frozen=True, slots=True)
class Spread:
    """A file's content.

    Attributes
    ----------
    common : bytes
        Its common data.
    payloads : list of bytes
        Those of its superframes.
    blocks : ndarray of float64, shape (n, 32, P)
        The parameters that they are decoded to.
    cost : float or None
        How much larger the file would be or is for its score, or how much greater its error, as a
        share; None if there is none or nobody asked.
    """

    common: bytes
    payloads: list[bytes]
    blocks: Array
    cost: float | None = None


@dataclass(frozen=True, slots=True)
class _Part:
    """A superframe, ready to be encoded at any step."""

    plan: SuperframePlan
    choice: BasisChoice

    def setting(self, step: int) -> Setting:
        """Return how it uses its prediction at a step: whole, if it has nothing else."""
        analysis = self.plan.analysis
        if step == NO_RESIDUAL:
            return NOTHING_SENT
        return Setting(step, 0, 0, analysis.course, analysis.shift, analysis.shares)


def line_of(line: ScoreLine, indices: range, options: CueingOptions) -> MergedScore:
    """Return the whole score of a file, joined."""
    around = range(indices.start - 1, indices.stop + 1)
    return join_line(line, {k: part_of(line, k, options) for k in around})


class SpreadMotion:
    """A motion that is to be spread, with its score or without.

    Parameters
    ----------
    motion : Motion
    voice : Voice
    indices : range
    options : CueingOptions
    progress : callable
        Called with the seconds of motion of each superframe, in each round.
    """

    def __init__(
        self,
        motion: Motion,
        voice: Voice,
        indices: range,
        options: CueingOptions,
        progress: Progress = silent,
    ) -> None:
        self.progress = progress
        self.indices, self.voice, self.coding = indices, voice, coding_for(voice)
        self.blocks = np.empty((len(indices), TICKS, motion.params.shape[1]))
        for block, index in zip(self.blocks, indices, strict=True):
            block[:] = block_at(motion, index)
            progress(SUPERFRAME_S)
        begin = to_ticks(motion.start_s) - TICKS * indices.start
        self._covered = slice(begin, begin + to_ticks(motion.duration_s))
        options = options.in_language(self.coding.language)
        self._score = FileScore(None, options, learning=False)
        self._joined: MergedScore | None = None
        self._moved: WholeResynthesis | None = None
        self._bare: dict[int, list[_Part]] = {}
        self._markers: dict[int, NDArray[np.float32]] = {}
        if motion.score is not None:
            line = trimmed(to_line(motion.score, options), indices, options.language)
            self._score = replace(self._score, line=line)
            self._joined = line_of(line, indices, options)

    @property
    def has_score(self) -> bool:
        """Whether there is a score to encode."""
        return self._joined is not None

    def plain(self) -> "Version":
        """Return the motion without its score."""
        return Version(self, replace(self._score, line=None), None)

    def scored(self, *, learning: bool) -> "Version":
        """Return the motion with its score, if it has one."""
        if self._joined is None:
            return self.plain()
        if self._moved is None:
            self._moved = WholeResynthesis(self._joined, self.coding.targets)
        return Version(self, replace(self._score, learning=learning), self._moved)

    def bare(self, step: int) -> list[_Part]:
        """Return the superframes without any prediction, encoded as is best at a step."""
        if step not in self._bare:
            mean = self.coding.mean
            analyses = (
                Analysis(k, Header(PLAIN, k % SEQUENCES, 0), None, False, {}, (), block - mean)
                for k, block in zip(self.indices, self.blocks, strict=True)
            )
            self._bare[step] = []
            for bare in analyses:
                part = _Part(plan_of(bare, {}), choose(bare, self.coding.bases, step))
                self._bare[step].append(part)
                self.progress(SUPERFRAME_S)
        return self._bare[step]

    def error_of(self, blocks: Array, every: int = 1) -> float:
        """Return the RMS over all markers of decoded superframes, mm.

        Parameters
        ----------
        blocks : ndarray of float64, shape (n, 32, P)
        every : int
            Use one in `every` of the motion's frames.
        """
        if every not in self._markers:
            self._markers[every] = self._reconstruct(self.blocks, every)
        gap = self._reconstruct(blocks, every) - self._markers[every]
        return float(np.sqrt(np.square(gap).sum(axis=-1).mean()))

    def _reconstruct(self, blocks: Array, every: int) -> NDArray[np.float32]:
        return self.voice.reconstruct(np.concatenate(blocks)[self._covered][::every])


class Version:
    """A take with one prediction: bits and squared errors of its superframes at any step."""

    def __init__(
        self, take: SpreadMotion, score: FileScore, moved: WholeResynthesis | None
    ) -> None:
        self._take, self._moved, self._learning = take, moved, score.learning
        self.common = write_common(score, take.indices)
        self._parts: list[_Part] = []
        self._known: dict[int, tuple[Array, Array]] = {}
        self._made: dict[tuple[int, int], tuple[bytes, Array]] = {}
        self._gain = Gain()
        self.prepared = COARSE

    def _learner(self, gain: Gain | None = None) -> Learner | None:
        return None if self._moved is None else Learner(self._moved, self._take.coding, gain)

    def prepare(self, step: int, width: float = NOMINAL_MM) -> None:
        """Choose how each superframe is encoded, for a step and near ones.

        Corrections are learnt from the superframes as they are at that step.
        """
        take, self._gain = self._take, Gain()
        learner = self._learner(self._gain)
        self.prepared = step
        self._known.clear()
        self._made.clear()
        self._parts = take.bare(step)
        if learner is None:
            return
        chosen = []
        for block, bare in zip(take.blocks, self._parts, strict=True):
            ways = self._ways(block, bare, step, width, learner)
            chosen.append(min(ways, key=lambda part: self._weight(part, step)))
            take.progress(SUPERFRAME_S)
            if self._learning:
                learner.take(bare.plan.analysis.index, self._done(chosen[-1], block, step))
        self._parts = chosen

    def _done(self, part: _Part, block: Array, step: int) -> Array:
        """Return the decoded superframe at a step."""
        coding = self._take.coding
        content = content_at(part.plan, coding.bases, part.choice, step)
        likely = block - part.plan.analysis.lacking
        return likely + residual_of(content.setting, content.q, coding)

    @property
    def clearly_gains(self) -> bool:
        """Whether there is no doubt that learning pays."""
        return self._learning and self._gain.learnt < _CLEAR * self._gain.bare

    def _weight(self, part: _Part, step: int) -> float:
        bits, squares = weigh(part.plan.analysis, part.choice, self._take.coding.bases, step)
        return squares / width_mm(step) ** 2 + WEIGHT * (bits + part.plan.bits)

    def _ways(
        self, block: Array, bare: _Part, step: int, width: float, learner: Learner
    ) -> list[_Part]:
        """Return the possible uses of a superframe's prediction."""
        coding, analysis = self._take.coding, bare.plan.analysis
        header = replace(analysis.header, mode=SCORE)
        ways = []
        predict = partial(learner.params, analysis.index)
        for fitted in fits(block, predict, coding, width):
            way = replace(
                analysis,
                header=header,
                lacking=fitted.lacking,
                course=fitted.course,
                shift=fitted.shift,
                shares=fitted.shares,
            )
            choice = bare.choice if way.unpredicted else choose(way, coding.bases, step)
            ways.append(_Part(plan_of(way, {}), choice))
        return ways

    def at(self, step: int) -> tuple[Array, Array]:
        """Return bits and squared errors at a step, shape (n,) each."""
        if step not in self._known:
            bases = self._take.coding.bases
            rows = [weigh(p.plan.analysis, p.choice, bases, step) for p in self._parts]
            bits, squares = np.array(rows).T
            self._known[step] = bits + [p.plan.bits for p in self._parts], squares
        return self._known[step]

    def at_own(self, steps: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return bits and squared errors, shape (n,) each, of superframes at steps of their own."""
        bits, squares = np.zeros(len(steps)), np.zeros(len(steps))
        for step in np.unique(steps):
            here, found = steps == step, self.at(int(step))
            bits[here], squares[here] = found[0][here], found[1][here]
        return bits, squares

    def at_each(self, steps: NDArray[np.int64]) -> tuple[float, float]:
        """Return bits and squared errors of all, each at a step of its own."""
        bits, squares = self.at_own(steps)
        return float(bits.sum()), float(squares.sum())

    def worth(self, step: int) -> float:
        """Return what all costs at a step: squared errors in steps, and bits."""
        bits, squares = self.at(step)
        whole = float(bits.sum()) + 8 * len(self.common)
        return float(squares.sum()) / width_mm(step) ** 2 + WEIGHT * whole

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

    def written(self, steps: NDArray[np.int64]) -> Spread:
        """Return the superframes at steps of their own."""
        learner = self._learner()
        payloads, blocks = [], np.empty_like(self._take.blocks)
        for k, step in enumerate(steps):
            # What is not learnt does not depend on what was before.
            if self._learning or (k, step) not in self._made:
                self._made[k, step] = self._written(k, int(step), learner)
            payload, blocks[k] = self._made[k, step]
            payloads.append(payload)
            self._take.progress(SUPERFRAME_S)
            if self._learning and learner is not None:
                learner.take(self._take.indices[k], blocks[k])
        return Spread(self.common, payloads, blocks)

    def _written(self, k: int, step: int, learner: Learner | None) -> tuple[bytes, Array]:
        """Return a superframe's payload, and its decoded parameters."""
        coding, part, block = self._take.coding, self._parts[k], self._take.blocks[k]
        predict = None if learner is None else partial(learner.params, self._take.indices[k])
        likely = likely_block(part.setting(step), predict, coding)
        choice = part.choice
        if self._learning:
            choice = replace(choice, values=coding.bases[choice.basis].forward(block - likely))
        content = content_at(part.plan, coding.bases, choice, step)
        done = likely + residual_of(content.setting, content.q, coding)
        return payload_of(content, coding.bases), done

    def squares(self, spread: Spread) -> float:
        """Return the squared error of superframes in the markers' metric."""
        gap = (spread.blocks - self._take.blocks) @ self._take.coding.residual.matrix
        return float(np.square(gap).sum())

    def error_of(self, spread: Spread) -> float:
        """Return the RMS over all markers of the motion's frames, mm."""
        return self._take.error_of(spread.blocks)
