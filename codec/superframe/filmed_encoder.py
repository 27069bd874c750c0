"""Encoding of filmed superframes: every use of the prediction, then refined beside its neighbours.

Each superframe is made from its analysis alone at first, and several times again beside what its
neighbours then were (`codec.superframe.refining`). It stays a function of the motion and the
index: what those to either side were in the first turns belongs to it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.timeline import SUPERFRAME_S
from codec.superframe.allocation import allocate, without_coefficients
from codec.superframe.analysis import Analysis, Analyst, block_at
from codec.superframe.coding import Coding
from codec.superframe.decoder import residual_of
from codec.superframe.payload import (
    CRC8_BYTES,
    Content,
    read_l0,
    read_l1,
    room_bits,
    score_code,
    write_l0,
    write_l1,
)
from codec.superframe.plan import plan_of, plans
from codec.superframe.quantise import NO_RESIDUAL, WEIGHT, width_mm
from codec.superframe.refining import Neighbour, SeenError, metrics_of, refined
from codec.superframe.superframe import Superframe

Array = NDArray[np.float64]

FILMED_MM = 108.0
"""Width of the steps at which uses of the prediction are compared for filmed cuers: that at which
27 bytes hold one who cues."""

TURNS = 6
"""Times that a superframe is refined; as many to either side shape it. With 3, four of 64 real
takes are more than 3 % worse than without keys (`cuecast evaluate onair`)."""

LIVE_TURNS = 3
"""Times that the last known superframe of a motion is refined, so every one of a live programme:
more leave the same error (7.51 and 7.54 mm on one real take)."""

_WORTH = 20000.0
"""Squared error, mm**2 over all markers and frames, that a label against a second loss is worth:
with 15 000 more keys are lost at 5 % loss, with 33 000 takes are worse."""

_MOST_COST = 0.3
"""Share of a superframe's squared error that labels against a second loss may cost, at most."""

_WRITTEN = 6
"""Refined superframes that are written, to see how many bits the ends of their parts leave."""


@dataclass(frozen=True, slots=True)
class _Made:
    """An encoded superframe with its source.

    Attributes
    ----------
    analysis : Analysis
    superframe : Superframe
    content : Content
        As it is read.
    beside : Neighbour
        As its neighbours see it.
    origin : int
        A hash of all that it depends on.
    """

    analysis: Analysis
    superframe: Superframe
    content: Content
    beside: Neighbour
    origin: int


class FilmedEncoder:
    """Encoder of filmed superframes of constant size.

    Parameters
    ----------
    voice : Voice
    coding : Coding
        Of the voice.
    analyst : Analyst
        For filmed superframes.
    sizes : tuple of int
        Bytes of L0 and L1.
    begin : int or None
        First superframe on air; None for the one where a motion begins.
    """

    def __init__(
        self,
        voice: Voice,
        coding: Coding,
        analyst: Analyst,
        sizes: tuple[int, int],
        begin: int | None,
    ) -> None:
        self._voice, self._coding, self._analyst = voice, coding, analyst
        self._sizes, self._begin = sizes, begin
        self._known: dict[tuple[int, int], tuple[Motion, _Made]] = {}

    def encode(self, motion: Motion, index: int) -> Superframe:
        """Return superframe `index` of a motion."""
        for old in [key for key in self._known if abs(key[0] - index) > 2 * TURNS]:
            del self._known[old]
        turns = TURNS if self._is_known(motion, index + 1) else min(TURNS, LIVE_TURNS)
        return self._made(motion, index, turns).superframe

    def _made(self, motion: Motion, index: int, turns: int) -> _Made:
        known = self._known.get((index, turns))
        if known is not None and known[0] is motion:
            return known[1]
        before = None if known is None else known[1]
        made = (
            self._again(motion, index, turns, before)
            if turns
            else self._first(motion, index, before)
        )
        self._known[index, turns] = motion, made
        return made

    def _first(self, motion: Motion, index: int, known: _Made | None) -> _Made:
        """Return the superframe of least error among all uses of the prediction."""
        ways = self._analyst.ways(motion, index, FILMED_MM)
        origin = hash(tuple(_origin(way) for way in ways))
        if known is not None and known.origin == origin:
            return known
        bases = self._coding.bases
        best: tuple[float, Analysis, Superframe, Content] | None = None
        for way in ways:
            found = self._allocated(way)
            if found is not None and (best is None or found[0] < best[0]):
                best = found
        # Nothing fits with its coefficients: send labels alone.
        if best is None:
            way = ways[-1]
            own = dict(list(way.previews.items())[:1])
            written = self._written(without_coefficients(plan_of(way, own), bases), way)
            assert written is not None, "fitted labels always fit"
            best = 0.0, way, *written
        block = block_at(motion, index)
        drawn = self._drawn(block, best[1], best[3])
        beside = Neighbour(block, drawn, metrics_of(self._voice, block))
        return _Made(*best[1:], beside, origin)

    def _allocated(self, way: Analysis) -> tuple[float, Analysis, Superframe, Content] | None:
        """Return a superframe by one use of the prediction: squared error first, mm**2."""
        bases = self._coding.bases
        for plan in plans(way, *self._sizes):
            content = allocate(plan, bases, self._room(way))
            chosen = way
            if len(plan.previews) == len(way.previews):
                chosen = self._with_more(way, content)
            if chosen is not way:
                content = allocate(plan_of(chosen, chosen.previews), bases, self._room(way))
            written = self._written(content, chosen)
            if written is None:
                continue
            return self._error(way, written[1]), chosen, *written
        return None

    def _with_more(self, way: Analysis, content: Content) -> Analysis:
        """Return an analysis with one more list of labels, if any is worth its bits."""
        most = _MOST_COST * self._error(way, content)
        least, chosen = 0.0, way
        for distance, labels in way.spare.items():
            labelled = replace(way, previews=way.previews | {distance: labels})
            bits = plan_of(labelled, labelled.previews).bits - plan_of(way, way.previews).bits
            price = WEIGHT * width_mm(content.setting.step) ** 2 * bits
            if price <= most and price - _WORTH * len(labels) < least:
                least, chosen = price - _WORTH * len(labels), labelled
        return chosen

    def _error(self, way: Analysis, content: Content) -> float:
        """Return the squared error that coefficients leave, mm**2 by the metric of the mean."""
        sent = residual_of(content.setting, content.q, self._coding)
        return float(np.square((way.lacking - sent) @ self._coding.residual.matrix).sum())

    def _again(self, motion: Motion, index: int, turns: int, known: _Made | None) -> _Made:
        """Return a superframe that is refined once more, beside its neighbours."""
        own = self._made(motion, index, turns - 1)
        sides = [
            self._made(motion, k, turns - 1) if self._is_known(motion, k) else None
            for k in (index - 1, index + 1)
        ]
        origin = hash((own.origin, *(None if side is None else side.origin for side in sides)))
        if known is not None and known.origin == origin:
            return known
        made, setting = own, own.content.setting
        if setting.step != NO_RESIDUAL:
            before, after = (None if side is None else side.beside for side in sides)
            # The error that a viewer sees counts the joins with both neighbours as they stand after
            # the round before; the result is kept only where it is less.
            error = SeenError(own.beside, before, after)
            analysis, block = own.analysis, own.beside.meant
            predicted, least = block - analysis.lacking, error.of(own.beside.drawn)
            bits = self._room(analysis) - score_code(own.content, even=False).bits
            found = refined(error, predicted, setting, own.content.q, self._coding.bases, bits)
            for one in [one for one in found if one.error < least][:_WRITTEN]:
                content = Content(
                    analysis.header,
                    one.setting,
                    analysis.part,
                    one.q,
                    own.content.previews,
                    analysis.slow,
                )
                written = self._written(content, analysis)
                if written is None:
                    continue
                drawn = self._drawn(block, analysis, written[1])
                if (left := error.of(drawn)) < least:
                    beside = Neighbour(block, drawn, own.beside.metrics)
                    made, least = _Made(analysis, *written, beside, origin), left
        return _Made(made.analysis, made.superframe, made.content, made.beside, origin)

    def _is_known(self, motion: Motion, index: int) -> bool:
        """Return whether a superframe is on air and of this motion."""
        if self._begin is not None and index < self._begin:
            return False
        begin = index * SUPERFRAME_S + 1e-6
        end = motion.start_s + motion.duration_s
        return begin + SUPERFRAME_S > motion.start_s + 2e-6 and begin < end

    def _room(self, analysis: Analysis) -> float:
        l0_bytes, l1_bytes = self._sizes
        return room_bits(analysis.header, l0_bytes) + 8 * max(0, l1_bytes - CRC8_BYTES)

    def _drawn(self, block: Array, analysis: Analysis, content: Content) -> Array:
        sent = residual_of(content.setting, content.q, self._coding)
        return np.asarray(block - analysis.lacking + sent)

    def _written(self, content: Content, analysis: Analysis) -> tuple[Superframe, Content] | None:
        """Return a superframe and its decoded values, None if L0 has no room for its labels."""
        bases, (l0_bytes, l1_bytes) = self._coding.bases, self._sizes
        l0 = write_l0(content, bases, l0_bytes, self._coding.identity, even=analysis.even)
        if l0 is None:
            return None
        read, known = read_l0(l0, bases, self._coding.language)
        if not l1_bytes:
            return Superframe(analysis.index, l0, b""), read
        l1 = write_l1(l0, content.setting, content.q, known, bases, l1_bytes)
        return Superframe(analysis.index, l0, l1), read_l1(l0, l1, read, known, bases)


def _origin(way: Analysis) -> int:
    form = way.course, way.shift, way.shares
    return hash(
        (way.index, way.header, tuple(way.previews.items()), way.slow, *form, way.lacking.tobytes())
    )
