"""Superframes: 0.64 s of motion in two parts, encoded and decoded.

The encoder predicts from the scores of a superframe and its two neighbours, as they will be
decoded, and codes what the prediction lacks. The decoder takes parts in any order, predicts from
the neighbours that it knows, and conceals what is missing: without L1 the coarse residual stays,
without L0 the hand finishes its key and goes to rest. Specification: spec/bitstream.md, section 2.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.bits import HEADER_BYTES, SEQUENCES, Header, read_header, voice_digit
from codec.coding import Coding, coding_for
from codec.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.errors import BitstreamError, CueError, VoiceError
from codec.joining import join, score_of
from codec.layout import MARKERS
from codec.motion import Motion
from codec.payload import (
    CRC8_BYTES,
    CRC16_BYTES,
    MIN_L0_BYTES,
    PLAIN,
    SCORE,
    SCORE_ONLY,
    Content,
    coefficient_bits,
    is_intact,
    read_l0,
    read_l1,
    score_code,
    write_l0,
    write_l0_whole,
    write_l1,
)
from codec.quantise import (
    GAINS,
    N_COURSES,
    NO_RESIDUAL,
    NOTHING_SENT,
    WEIGHT,
    Setting,
    dequantise,
    quantise_rd,
    width_mm,
)
from codec.resynthesis import resynthesise
from codec.score import Key, Phone, Score
from codec.score_coding import ScorePart, evenly, part_of
from codec.tables import coefficient_tables
from codec.timeline import SUPERFRAME_S, TICK_S, TICKS, Line, to_line
from codec.transform import Basis
from codec.voice import Voice

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_HISTORY = 8
_FADE_FRAMES = 8.0


@dataclass(frozen=True, slots=True)
class Superframe:
    """The two parts of superframe `index`, whose media time is ``index * 0.64`` s."""

    index: int
    l0: bytes
    l1: bytes


@dataclass(frozen=True, slots=True)
class DecodedSuperframe:
    """What a receiver knows about 0.64 s of motion.

    Attributes
    ----------
    index : int
        Number of the superframe.
    start_s : float
        ``index * 0.64``.
    params : ndarray of float32, shape (32, P)
        Parameters at 50 Hz.
    phones : tuple of Phone
        Phones that start within the superframe.
    keys : tuple of Key
        Keys that start within it; the end of the last one may be a guess (`merge_scores`).
    layers : tuple of str
        The parts that arrived: ``L0``, ``L1``.
    concealed : bool
        Whether L0 is missing and the motion invented.
    part : ScorePart or None
        The score as sent; None if it is missing.
    lead : int
        Superframes by which it was on air ahead of its time, -1 if L0 is missing.
    sequence : int
        `index` modulo 64.
    """

    index: int
    start_s: float
    params: NDArray[np.float32]
    phones: tuple[Phone, ...]
    keys: tuple[Key, ...]
    layers: tuple[str, ...]
    concealed: bool
    part: ScorePart | None
    lead: int
    sequence: int


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


def predict(coding: Coding, parts: Mapping[int, ScorePart], index: int, course: int = 0) -> Array:
    """Return what the scores of superframes `parts` say about superframe `index` (section 5)."""
    near = {k: parts[k] for k in (index - 1, index, index + 1) if k in parts}
    return resynthesise(join(near), near, coding.targets, index * TICKS, TICKS, course=course)


class SuperframeEncoder:
    """Encoder of superframes of constant size.

    Every superframe is a function of the motion and the index alone, so that they can be made
    in any order.

    Parameters
    ----------
    voice : Voice
        Of the motion.
    l0_bytes, l1_bytes : int
        Sizes of the parts, at least 10 and 0; checksums and header count.
    lead : int
        Superframes by which they will be on air ahead of their time, 0..3.
    options : CueingOptions
        Under which the receiver derives keys from phones.
    score_only : bool
        Send no residual.

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
        lead: int = 2,
        options: CueingOptions = DEFAULT_OPTIONS,
        score_only: bool = False,
    ) -> None:
        if l0_bytes < MIN_L0_BYTES + 5 or l1_bytes < 0 or not 0 <= lead <= 3:
            raise CueError(f"superframe of {l0_bytes} + {l1_bytes} bytes, lead {lead}")
        self.voice = voice
        self._coding = coding_for(voice)
        self._sizes = l0_bytes, l1_bytes
        self._lead = lead
        self._options = options
        self._score_only = score_only
        self._line: tuple[Score | None, Line] = (None, to_line(None))
        self._fitted: dict[int, tuple[ScorePart, bool]] = {}

    def encode(self, motion: Motion, index: int) -> Superframe:
        """Return superframe `index` of `motion`, of the encoder's size.

        Raises
        ------
        VoiceError
            If the motion was made with another voice.
        """
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
        setting, q = plan.quantised(step)
        l0 = write_l0_whole(plan.header, setting, plan.part, q, plan.basis)
        return Superframe(index, l0, b"")

    def error_mm(self, motion: Motion, index: int, step: int) -> float:
        """Return the error of superframe `index` at a step: RMS over its markers and frames."""
        plan = self._analyse(motion, index)
        setting, q = plan.quantised(step)
        error = plan.values
        if setting.step != NO_RESIDUAL:
            error = error - dequantise(q, setting, plan.basis, coefficient_tables())
        return float(np.sqrt(np.square(error).sum() / (TICKS * len(MARKERS))))

    def _analyse(self, motion: Motion, index: int) -> "_Plan":
        """Return what is to be sent of superframe `index`."""
        if motion.voice != self.voice.identity:
            raise VoiceError(
                f"motion of voice {motion.voice}, the encoder has {self.voice.identity}"
            )
        block = block_at(motion, index)
        if motion.score is None:
            values = self._coding.plain.forward(block - self._coding.mean)
            header = self._header(PLAIN, index)
            return _Plan(index, header, None, False, self._coding.plain, values, 0)
        mode = SCORE_ONLY if self._score_only else SCORE
        around = {k: self._part(motion.score, k) for k in (index - 1, index, index + 1)}
        part, even = around[index]
        known = {k: p for k, (p, _) in around.items()}
        basis = self._coding.residual
        tried = [
            basis.forward(block - predict(self._coding, known, index, course))
            for course in range(N_COURSES if mode == SCORE else 1)
        ]
        # The usual course costs least; another one has to explain clearly more.
        energy = np.square(tried).sum(axis=1) * np.where(np.arange(len(tried)) == 0, 0.95, 1.0)
        course = int(np.argmin(energy))
        header = self._header(mode, index)
        return _Plan(index, header, part, even, basis, tried[course], course)

    def _header(self, mode: int, index: int) -> Header:
        sequence = index % SEQUENCES
        return Header(mode, sequence, self._lead, voice_digit(self.voice.identity, sequence))

    def _part(self, score: Score, index: int) -> tuple[ScorePart, bool]:
        """Return the score of a superframe as far as it fits into L0, and whether evenly."""
        if self._line[0] is not score:
            self._line = (score, to_line(score, self._options))
            self._fitted.clear()
        if index not in self._fitted:
            if len(self._fitted) > _HISTORY:
                self._fitted.clear()
            self._fitted[index] = self._fit(part_of(self._line[1], index, self._options), index)
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
        mode = SCORE_ONLY if self._score_only else SCORE
        header = self._header(mode, index)
        basis = self._coding.residual
        nothing = np.zeros(basis.scan_scales.size, dtype=np.int64)
        return (
            write_l0(header, NOTHING_SENT, part, nothing, basis, self._sizes[0], even=even)
            is not None
        )

    def _write(self, plan: "_Plan") -> Superframe:
        l0_bytes, l1_bytes = self._sizes
        setting, q = self._fitting(plan)
        l0 = write_l0(plan.header, setting, plan.part, q, plan.basis, l0_bytes, even=plan.even)
        if l0 is None:
            setting = NOTHING_SENT
            l0 = write_l0(plan.header, setting, plan.part, q, plan.basis, l0_bytes, even=plan.even)
            assert l0 is not None, "a fitted score always fits"
        if l1_bytes == 0:
            return Superframe(plan.index, l0, b"")
        _, known = read_l0(l0, plan.basis)
        return Superframe(plan.index, l0, write_l1(l0, setting, q, known, plan.basis, l1_bytes))

    def _fitting(self, plan: "_Plan") -> tuple[Setting, Ints]:
        """Return the finest setting at which all coefficients fit, and their indices."""
        l0_bytes, l1_bytes = self._sizes
        room = 8 * (l0_bytes - HEADER_BYTES - CRC16_BYTES + max(0, l1_bytes - CRC8_BYTES))
        used = score_code(plan.header.mode, Setting(0), plan.part, even=plan.even).bits
        gain, step = 0, self._finest(plan, 0, room - used)
        better = plan.gain(step)
        if better != gain:
            gain, step = better, self._finest(plan, better, room - used - 4)
        return plan.quantised(step, gain)

    @staticmethod
    def _finest(plan: "_Plan", gain: int, bits: float) -> int:
        low, high = 0, NO_RESIDUAL
        while low < high:
            step = (low + high) // 2
            setting, q = plan.quantised(step, gain)
            if coefficient_bits(q, setting, plan.basis) <= bits:
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
    even: bool
    basis: Basis
    values: Array
    course: int

    def quantised(self, step: int, gain: int | None = None) -> tuple[Setting, Ints]:
        """Return the setting at a step, and the indices; without a gain, the best one."""
        if step == NO_RESIDUAL or self.header.mode == SCORE_ONLY:
            return NOTHING_SENT, np.zeros(self.values.size, dtype=np.int64)
        chosen = self.gain(step) if gain is None else gain
        setting = Setting(step, chosen, self.course)
        return setting, quantise_rd(self.values, setting, self.basis, coefficient_tables())

    def gain(self, step: int) -> int:
        """Return the gain at which error and bits weigh least at a step."""
        if step == NO_RESIDUAL or self.header.mode == SCORE_ONLY:
            return 0
        weights = []
        for gain in range(len(GAINS)):
            setting, q = self.quantised(step, gain)
            error = self.values - dequantise(q, setting, self.basis, coefficient_tables())
            bits = coefficient_bits(q, setting, self.basis) + (3 if gain else 0)
            weights.append(np.square(error / width_mm(step)).sum() + WEIGHT * bits)
        return int(np.argmin(weights))


class SuperframeDecoder:
    """Decoder of superframes in any order, with holes.

    It remembers a few superframes to predict from; results of other numbers do not depend on
    the order in which parts arrive once the neighbours are known (`render`).
    """

    def __init__(self, voice: Voice) -> None:
        self.voice = voice
        self._coding = coding_for(voice)
        self._contents: dict[int, Content] = {}
        self._layers: dict[int, tuple[str, ...]] = {}

    def push(self, l0: bytes | None, l1: bytes | None, index: int) -> DecodedSuperframe:
        """Take the parts of superframe `index` and return what they say now.

        Parameters
        ----------
        l0, l1 : bytes or None
            None is a part that did not arrive; a part whose checksum is wrong counts as such.
        index : int
            Any number that is congruent to the header's sequence modulo 64.

        Raises
        ------
        VoiceError
            If the stream was made with another voice.
        BitstreamError
            If L0 is intact and breaks a rule: version (H2), mode (H3), sequence (H4).
        """
        self._forget(index)
        content, layers = self._read(l0, l1, index)
        if content is not None:
            self._contents[index], self._layers[index] = content, layers
        return self.render(index)

    def _forget(self, index: int) -> None:
        for old in [k for k in self._contents if abs(k - index) > _HISTORY]:
            del self._contents[old], self._layers[old]

    def _read(
        self, l0: bytes | None, l1: bytes | None, index: int
    ) -> tuple[Content | None, tuple[str, ...]]:
        if l0 is None or not is_intact(l0):
            return None, ()
        header = read_header(l0)
        if header.sequence != index % SEQUENCES:
            raise BitstreamError(
                f"sequence number {header.sequence}, superframe {index} has {index % SEQUENCES}",
                section="H4", bit=4,
            )  # fmt: skip
        digit = voice_digit(self.voice.identity, header.sequence)
        if header.voice != digit:
            raise VoiceError(
                f"digit {header.sequence % 16} of the stream's voice is {header.voice:x}, "
                f"voice {self.voice.name} has {digit:x}"
            )
        basis = self._basis(header)
        content, known = read_l0(l0, basis)
        if l1:
            try:
                return read_l1(l0, l1, content, known, basis), ("L0", "L1")
            except BitstreamError:
                return content, ("L0",)
        return content, ("L0",)

    def render(self, index: int) -> DecodedSuperframe:
        """Return superframe `index` from all that has arrived by now.

        Called when its time comes, the neighbours are known and the motion is the best possible.
        """
        near = [k for k in (index - 1, index, index + 1) if k in self._contents]
        parts = {k: part for k in near if (part := self._contents[k].part) is not None}
        content = self._contents.get(index)
        plain = content.header.mode == PLAIN if content else bool(near) and not parts
        course = content.setting.course if content else 0
        prediction = self._coding.mean if plain else predict(self._coding, parts, index, course)
        residual = self._residual(content) if content else self._decaying(index)
        score = score_of(parts)
        begin, end = index * SUPERFRAME_S - 1e-6, (index + 1) * SUPERFRAME_S - 1e-6
        return DecodedSuperframe(
            index,
            index * SUPERFRAME_S,
            (prediction + residual).astype(np.float32),
            tuple(p for p in score.phones if begin <= p.start < end),
            tuple(k for k in score.keys if begin <= k.start < end),
            self._layers.get(index, ()),
            content is None,
            content.part if content else None,
            content.header.lead if content else -1,
            index % SEQUENCES,
        )

    def _basis(self, header: Header) -> Basis:
        return self._coding.plain if header.mode == PLAIN else self._coding.residual

    def _residual(self, content: Content) -> Array:
        basis = self._basis(content.header)
        if content.setting.step == NO_RESIDUAL:
            return np.zeros((TICKS, len(basis.matrix)))
        tables = coefficient_tables()
        return basis.backward(dequantise(content.q, content.setting, basis, tables))

    def _decaying(self, index: int) -> Array:
        """Return how the last known residual fades out over a lost superframe."""
        before = self._contents.get(index - 1)
        if before is None:
            return np.zeros((TICKS, len(self.voice.layout)))
        fade: Array = np.exp(-(np.arange(TICKS) + 1.0) / _FADE_FRAMES)
        return np.outer(fade, self._residual(before)[-1])
