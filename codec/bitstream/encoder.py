"""Encoding of superframes.

The encoder predicts from the scores of a superframe and its two neighbours, as they will be
decoded, and codes what the prediction lacks. Specification: spec/bitstream.md, section 2.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.bits import (
    COMPACT_LEAD,
    HEADER_BYTES,
    PLAIN,
    SCORE,
    SEQUENCES,
    Header,
    voice_digit,
)
from codec.bitstream.coding import coding_for
from codec.bitstream.joining import join
from codec.bitstream.payload import (
    CRC8_BYTES,
    CRC16_BYTES,
    Content,
    coefficient_bits,
    read_l0,
    score_code,
    write_l0,
    write_l0_whole,
    write_l1,
)
from codec.bitstream.preview import AHEAD, CHOICES, Preview, preview_of, thinned
from codec.bitstream.quantise import (
    GAINS,
    N_COURSES,
    NO_RESIDUAL,
    NOTHING_SENT,
    WEIGHT,
    Setting,
    basis_of,
    dequantise,
    quantise_rd,
    width_mm,
)
from codec.bitstream.resynthesis.course import SHIFTS
from codec.bitstream.score_coding import ScorePart, evenly, part_of
from codec.bitstream.superframe import Superframe, resynthesis_of
from codec.bitstream.tables import coefficient_tables
from codec.bitstream.transform import Bases
from codec.bitstream.window import MAX_BYTES, MIN_BYTES
from codec.bitstream.window_writer import WindowWriter
from codec.cuer.layout import MARKERS
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS, to_line
from codec.errors import CueError, VoiceError

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SAYS_LITTLE = 0.5
"""Share of a superframe that score and previews may take for a third preview."""

_FEWEST = 2
"""Starts to which a preview is thinned at most, and a third one always."""

_HISTORY = 8
"""Superframes whose fitted scores are remembered."""


def block_at(motion: Motion, index: int) -> Array:
    """Return the 32 frames of superframe `index` at 50 Hz, shape (32, P).

    Between frames of another rate the motion is interpolated linearly; before its first and
    after its last frame it stands still.
    """
    times = index * SUPERFRAME_S + TICK_S * np.arange(TICKS)
    place = np.clip((times - motion.start_s) * motion.rate_hz, 0, len(motion.params) - 1)
    below = np.minimum(place.astype(np.int64), max(len(motion.params) - 2, 0))
    above = np.minimum(below + 1, len(motion.params) - 1)
    share = (place - below)[:, None]
    return np.asarray((1 - share) * motion.params[below] + share * motion.params[above])


class SuperframeEncoder:
    """Encoder of superframes of constant size.

    Every superframe is a function of the motion and the index alone, so that they can be made
    in any order.

    Parameters
    ----------
    voice : Voice
        Of the motion.
    l0_bytes, l1_bytes : int
        Sizes of the parts, at least 4 and 0; checksums and header count. An L0 of up to 12 bytes
        is compact: it holds the score alone, and L1 has to be 0.
    lead : int
        Superframes by which they will be on air ahead of their time, 0..3; 2 if L0 is compact.
    options : CueingOptions
        Under which the receiver derives keys from phones.
    protected : bool
        Send previews of later superframes, if L0 is not compact.
    first : int
        Number of the first superframe that will be on air; compact ones lean on earlier ones.

    Raises
    ------
    CueError
        If a size or the lead is out of range.
    """

    def __init__(
        self,
        voice: Voice,
        *,
        l0_bytes: int,
        l1_bytes: int,
        lead: int = COMPACT_LEAD,
        options: CueingOptions = DEFAULT_OPTIONS,
        protected: bool = False,
        first: int = 0,
    ) -> None:
        self._compact = l0_bytes <= MAX_BYTES
        if l0_bytes < MIN_BYTES or l1_bytes < 0 or not 0 <= lead <= 3:
            raise CueError(f"superframe of {l0_bytes} + {l1_bytes} bytes, lead {lead}")
        if self._compact and l1_bytes:
            raise CueError(f"an L0 of {l0_bytes} bytes is compact, its L1 has {l1_bytes} bytes")
        self.voice = voice
        self._coding = coding_for(voice)
        self._sizes = l0_bytes, l1_bytes
        self._lead = lead
        self._options = options
        self._protected = protected
        self._first = first
        self._score: Score | None = None
        self._line = to_line(None)
        self._fitted: dict[int, tuple[ScorePart, bool]] = {}
        self._writer: WindowWriter | None = None

    def encode(self, motion: Motion, index: int) -> Superframe:
        """Return superframe `index` of `motion`, of the encoder's size.

        Raises
        ------
        VoiceError
            If the motion was made with another voice.
        CueError
            If L0 is compact and the motion has no score.
        """
        if self._compact:
            self._check_voice(motion)
            return Superframe(index, self._windows(motion.score).l0(index), b"")
        return self._write(self._analyse(motion, index))

    def encode_at(self, motion: Motion, index: int, step: int) -> Superframe:
        """Return superframe `index` with the residual at a given step, in an L0 of any length.

        Parameters
        ----------
        motion : Motion
        index : int
        step : int
            Step number, 0 (finest) to 63 (no residual).
        """
        plan = self._analyse(motion, index)
        l0 = write_l0_whole(plan.content(step), plan.bases)
        return Superframe(index, l0, b"")

    def error_mm(self, motion: Motion, index: int, step: int) -> float:
        """Return the error of superframe `index` at a step: RMS over its markers and frames."""
        plan = self._analyse(motion, index)
        setting, q = plan.quantised(step)
        error = plan.values[setting.gain // 2]
        if setting.step != NO_RESIDUAL:
            basis = basis_of(plan.bases, setting)
            error = error - dequantise(q, setting, basis, coefficient_tables())
        return float(np.sqrt(np.square(error).sum() / (TICKS * len(MARKERS))))

    def _check_voice(self, motion: Motion) -> None:
        if motion.voice != self.voice.identity:
            raise VoiceError(
                f"motion of voice {motion.voice}, the encoder has {self.voice.identity}"
            )

    def _windows(self, score: Score | None) -> WindowWriter:
        if score is None:
            raise CueError(f"an L0 of {self._sizes[0]} bytes holds a score, the motion has none")
        self._take(score)
        if self._writer is None:
            self._writer = WindowWriter(
                self._line, self._options, self._coding.identity, self._sizes[0], first=self._first
            )
        return self._writer

    def _take(self, score: Score) -> None:
        """Put a score on the grid, unless it is there."""
        if self._score is not score:
            self._score, self._line = score, to_line(score, self._options)
            self._fitted.clear()
            self._writer = None

    def _analyse(self, motion: Motion, index: int) -> "_Plan":
        """Return what is to be sent of superframe `index`."""
        self._check_voice(motion)
        block = block_at(motion, index)
        if motion.score is None:
            bases = self._coding.of_motion
            moved = self._coding.plain.forward(block - self._coding.mean)
            header = self._header(PLAIN, index)
            # The second basis is the first one with other scales, in the same order.
            return _Plan(index, header, None, {}, False, bases, (moved, moved), 0, 0)
        around = {k: self._part(motion.score, k) for k in (index - 1, index, index + 1)}
        part, even = around[index]
        resynthesis = resynthesis_of(
            self._coding, join({k: p for k, (p, _) in around.items()}), index
        )
        bases = self._coding.of_score

        def energy(course: int, shift: int) -> float:
            gap = (block - resynthesis.params(course=course, shift=shift)) @ bases[0].matrix
            # The usual form costs least; another one has to explain clearly more.
            return float(np.square(gap).sum()) * (1.0 if course or shift else 0.95)

        course = min(range(N_COURSES), key=lambda c: energy(c, 0))
        shift = min(range(len(SHIFTS)), key=lambda s: energy(course, s))
        lacking = block - resynthesis.params(course=course, shift=shift)
        values = bases[0].forward(lacking), bases[1].forward(lacking)
        header = self._header(SCORE, index)
        previews = self._previews(motion.score, index) if self._protected else {}
        return _Plan(index, header, part, previews, even, bases, values, course, shift)

    def _header(self, mode: int, index: int) -> Header:
        sequence = index % SEQUENCES
        return Header(mode, sequence, self._lead, voice_digit(self._coding.identity, sequence))

    def _previews(self, score: Score, index: int) -> dict[int, Preview]:
        self._take(score)
        return {
            distance: preview_of(part_of(self._line, index + distance, self._options), distance)
            for distance in AHEAD
        }

    def _part(self, score: Score, index: int) -> tuple[ScorePart, bool]:
        """Return the score of a superframe as far as it fits into L0, and whether evenly."""
        self._take(score)
        if index not in self._fitted:
            if len(self._fitted) > _HISTORY:
                self._fitted.clear()
            self._fitted[index] = self._fit(part_of(self._line, index, self._options), index)
        return self._fitted[index]

    def _fit(self, part: ScorePart, index: int) -> tuple[ScorePart, bool]:
        if self._fits(part, index, even=False):
            return part, False
        # Denser than speech can be: first the times go, then the last phones.
        while True:
            part = evenly(part)
            if self._fits(part, index, even=True) or len(part.numbers) == 1:
                return part, True
            part = part.without_last()

    def _fits(self, part: ScorePart, index: int, *, even: bool) -> bool:
        nothing = np.zeros(self._coding.residual.scan_scales.size, dtype=np.int64)
        content = Content(self._header(SCORE, index), NOTHING_SENT, part, nothing)
        return write_l0(content, self._coding.of_score, self._sizes[0], even=even) is not None

    def _write(self, plan: "_Plan") -> Superframe:
        l0_bytes, l1_bytes = self._sizes
        for previews in self._affordable(plan):
            tried = replace(plan, previews=previews)
            content = tried.content(*self._fitting(tried))
            l0 = write_l0(content, plan.bases, l0_bytes, even=plan.even)
            if l0 is not None:
                break
        else:
            content = replace(plan, previews={}).content(NO_RESIDUAL)
            l0 = write_l0(content, plan.bases, l0_bytes, even=plan.even)
            assert l0 is not None, "a fitted score always fits"
        if l1_bytes == 0:
            return Superframe(plan.index, l0, b"")
        _, known = read_l0(l0, plan.bases)
        l1 = write_l1(l0, content.setting, content.q, known, plan.bases, l1_bytes)
        return Superframe(plan.index, l0, l1)

    def _affordable(self, plan: "_Plan") -> Iterator[dict[int, Preview]]:
        """Yield previews that L0 may have room for, as many as possible first.

        The farthest is sparse, and for superframes that say little; where too much is said, the
        farther of two becomes sparse, then goes, then the nearer one.
        """
        l0_bytes, l1_bytes = self._sizes
        room = 8.0 * (l0_bytes - HEADER_BYTES - CRC16_BYTES)
        for choice in reversed(CHOICES) if plan.previews else ():
            previews = {distance: plan.previews[distance] for distance in choice}
            most = room
            if len(choice) == len(AHEAD):
                most = min(room, _SAYS_LITTLE * 8 * (l0_bytes + l1_bytes))
                while len(previews[AHEAD[-1]]) > _FEWEST:
                    previews[AHEAD[-1]] = thinned(previews[AHEAD[-1]])
            while (bits := self._bits(replace(plan, previews=previews))) > most:
                farthest = max(previews, default=0)
                if len(choice) != 2 or len(previews[farthest]) <= _FEWEST:
                    break
                previews[farthest] = thinned(previews[farthest])
            if previews and bits <= most:
                yield previews
        yield {}

    @staticmethod
    def _bits(plan: "_Plan") -> float:
        """Return the bits of what precedes the coefficients."""
        setting = Setting(0, 0, plan.course, plan.shift)
        nothing = np.zeros(0, dtype=np.int64)
        content = Content(plan.header, setting, plan.part, nothing, plan.previews)
        return score_code(content, even=plan.even).bits

    def _fitting(self, plan: "_Plan") -> tuple[int, int]:
        """Return the finest step and its gain at which all coefficients fit."""
        l0_bytes, l1_bytes = self._sizes
        room = 8 * (l0_bytes - HEADER_BYTES - CRC16_BYTES + max(0, l1_bytes - CRC8_BYTES))
        used = self._bits(plan)
        gain, step = 0, self._finest(plan, 0, room - used)
        better = plan.gain(step)
        if better != gain:
            gain, step = better, self._finest(plan, better, room - used - 4)
        return step, gain

    @staticmethod
    def _finest(plan: "_Plan", gain: int, bits: float) -> int:
        low, high = 0, NO_RESIDUAL
        while low < high:
            step = (low + high) // 2
            setting, q = plan.quantised(step, gain)
            if coefficient_bits(q, setting, basis_of(plan.bases, setting)) <= bits:
                high = step
            else:
                low = step + 1
        return low


@dataclass(frozen=True, slots=True)
class _Plan:
    """A superframe between analysis and quantisation."""

    index: int
    header: Header
    part: ScorePart | None
    previews: dict[int, Preview]
    even: bool
    bases: Bases
    values: tuple[Array, Array]
    course: int
    shift: int

    def content(self, step: int, gain: int | None = None) -> Content:
        """Return what is said at a step; without a gain, with the best one."""
        setting, q = self.quantised(step, gain)
        return Content(self.header, setting, self.part, q, self.previews)

    def quantised(self, step: int, gain: int | None = None) -> tuple[Setting, Ints]:
        """Return the setting at a step, and the indices; without a gain, the best one."""
        if step == NO_RESIDUAL:
            return NOTHING_SENT, np.zeros(self.values[0].size, dtype=np.int64)
        chosen = self.gain(step) if gain is None else gain
        setting = Setting(step, chosen, self.course, self.shift)
        basis = basis_of(self.bases, setting)
        values = self.values[chosen // 2]
        return setting, quantise_rd(values, setting, basis, coefficient_tables())

    def gain(self, step: int) -> int:
        """Return the gain at which error and bits weigh least at a step."""
        if step == NO_RESIDUAL:
            return 0
        weights = []
        for gain in range(len(GAINS)):
            setting, q = self.quantised(step, gain)
            basis = basis_of(self.bases, setting)
            error = self.values[gain // 2] - dequantise(q, setting, basis, coefficient_tables())
            bits = coefficient_bits(q, setting, basis) + (3 if gain else 0)
            weights.append(np.square(error / width_mm(step)).sum() + WEIGHT * bits)
        return int(np.argmin(weights))
