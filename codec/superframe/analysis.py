"""Analysis: the content of a superframe to send, as one frozen value.

A motion and a number go in; out comes an `Analysis`: the score as the receiver will know it, and
the motion's residual beyond the prediction from it, in millimetres, ready to be quantised.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cues.cueing import CueingOptions
from codec.cues.score import Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS, to_line
from codec.superframe.bits import PLAIN, SCORE, SEQUENCES, Header
from codec.superframe.coding import Coding
from codec.superframe.fitting import NOMINAL_MM, fits
from codec.superframe.labels import OWN, labels_of
from codec.superframe.merging import join
from codec.superframe.payload import Content, write_l0
from codec.superframe.preview import AHEAD, Preview, part_of_preview, preview_of, thinned
from codec.superframe.quantise import NOTHING_SENT, PARTS, UNUSED
from codec.superframe.score_coding import ScorePart, evenly, part_of
from codec.superframe.slow_channel import SlowSender
from codec.superframe.superframe import resynthesis_of

Array = NDArray[np.float64]

LABELLED_AHEAD = 2, 4
"""Distances of the superframes whose labels a filmed one codes beside its own."""

_HISTORY = 8
"""Superframes whose fitted scores are remembered."""


@dataclass(frozen=True, slots=True)
class Analysis:
    """The content of a superframe to send.

    Attributes
    ----------
    index : int
    header : Header
    part : ScorePart or None
        Its score; None in mode ``plain``.
    even : bool
        Whether the score's phones lie at even distances (S8).
    previews : dict of int to Preview
        Of other superframes, by distance: those that there are, before anything is left out. Of
        a filmed superframe its labels, its own at distance 0.
    slow : tuple of int
        Pieces of the slow channel.
    lacking : ndarray of float64, shape (32, P)
        The residual of the prediction.
    course, shift : int
        Form and time of the hand's movements in the prediction.
    shares : tuple of int
        How much of the prediction counts, by part.
    spare : dict of int to Preview
        Labels of other superframes: a filmed one may send one list more.
    """

    index: int
    header: Header
    part: ScorePart | None
    even: bool
    previews: dict[int, Preview]
    slow: tuple[int, ...]
    lacking: Array
    course: int = 0
    shift: int = 0
    shares: tuple[int, ...] = (0,) * PARTS
    spare: dict[int, Preview] = field(default_factory=dict)

    @property
    def unpredicted(self) -> bool:
        """Whether nothing of the prediction is used."""
        return self.header.mode == PLAIN or self.shares == UNUSED


def block_at(motion: Motion, index: int) -> Array:
    """Return the 32 frames of superframe `index` at 50 Hz, shape (32, P).

    Between frames of another rate the motion is interpolated linearly; before its first and
    after its last frame it stands still.
    """
    times = index * SUPERFRAME_S + TICK_S * np.arange(TICKS)
    place = np.clip((times - motion.start_s) * motion.rate_hz, 0, len(motion.params) - 1)
    # The same for every window of a motion: times of a second hour have other roundings.
    place = np.round(place, 9)
    below = np.minimum(place.astype(np.int64), max(len(motion.params) - 2, 0))
    above = np.minimum(below + 1, len(motion.params) - 1)
    share = (place - below)[:, None]
    return np.asarray((1 - share) * motion.params[below] + share * motion.params[above])


class Analyst:
    """Analyses superframes of motions, in any order.

    Parameters
    ----------
    coding : Coding
        Tables of the voice.
    l0_bytes : int
        Room for a score, its header and check.
    lead : int
        Lead on air before their time, in superframes.
    options : CueingOptions
        Under which the receiver derives keys from phones.
    protected : bool
        Preview later superframes.
    signed : bool
        Leave room for a proof.
    slow : SlowSender
        Tells lasting facts.
    filmed : bool
        Tell keys as labels (section 3.4).
    begin : int or None
        First superframe on air; None for the one where a motion begins.
    """

    def __init__(
        self,
        coding: Coding,
        l0_bytes: int,
        lead: int,
        options: CueingOptions,
        *,
        protected: bool,
        signed: bool,
        slow: SlowSender,
        filmed: bool = False,
        begin: int | None = None,
    ) -> None:
        self._filmed, self._begin = filmed, begin
        self._coding = coding
        self._l0_bytes = l0_bytes
        self._lead = lead
        self._options = options
        self._protected = protected
        self._signed = signed
        self._slow = slow
        self._score: Score | None = None
        self._line = to_line(None, options)
        self._fitted: dict[int, tuple[ScorePart, bool]] = {}

    def analyse(self, motion: Motion, index: int) -> Analysis:
        """Return the content to send of superframe `index`."""
        if motion.score is not None:
            return self._ways(motion, motion.score, index, NOMINAL_MM)[0]
        block = block_at(motion, index)
        slow = (self._slow.piece(index),) if self._slow.due(index) else ()
        header = self._header(PLAIN, index, slow)
        return Analysis(index, header, None, False, {}, slow, block - self._coding.mean)

    def ways(self, motion: Motion, index: int, width_mm: float) -> list[Analysis]:
        """Return the content to send of a superframe by the likely uses of its prediction.

        Parameters
        ----------
        motion : Motion
        index : int
        width_mm : float
            Of the step at which uses are compared.
        """
        if motion.score is None:
            return [self.analyse(motion, index)]
        return self._ways(motion, motion.score, index, width_mm)

    def _ways(self, motion: Motion, score: Score, index: int, width_mm: float) -> list[Analysis]:
        block = block_at(motion, index)
        slow = (self._slow.piece(index),) if self._slow.due(index) else ()
        around = {k: self._part(score, k) for k in (index - 1, index, index + 1)}
        part, even = around[index]
        joined = join({k: p for k, (p, _) in around.items()})
        resynthesis = resynthesis_of(self._coding, joined, index)
        header = self._header(SCORE, index, slow)
        previews = self._previews(motion, index)
        spare = self._spare(motion, index) if self._filmed else {}
        return [
            Analysis(
                index, header, part, even, previews, slow, fitted.lacking, fitted.course,
                fitted.shift, fitted.shares, spare,
            )
            for fitted in fits(
                block, lambda course, shift: resynthesis.params(course=course, shift=shift),
                self._coding, width_mm,
            )
        ]  # fmt: skip

    def _header(self, mode: int, index: int, slow: tuple[int, ...]) -> Header:
        return Header(mode, index % SEQUENCES, self._lead, self._signed, len(slow), self._filmed)

    def _previews(self, motion: Motion, index: int) -> dict[int, Preview]:
        """Return the previews of a superframe; of a filmed one its labels and those of others."""
        if self._filmed:
            return self._labels_told(motion, index)
        if not self._protected:
            return {}
        return {
            distance: preview_of(part_of(self._line, index + distance, self._options), distance)
            for distance in AHEAD
        }

    def _labels_told(self, motion: Motion, index: int) -> dict[int, Preview]:
        """Return the labels of a filmed superframe, its own first, and those against a loss."""
        told = {OWN: self._labels(index)}
        if not self._protected:
            return told
        near, _ = LABELLED_AHEAD
        last = self._labels(index - 1)
        if last and self._line.starts[-1] < TICKS * (index + 1):
            # The end of all that is known, as always in a live programme.
            return told | {-1: last}
        told[near] = self._labels(index + near)
        begin = int(motion.start_s // SUPERFRAME_S) if self._begin is None else self._begin
        if last and index - 1 - near < begin <= index - 1:
            # The beginning of a programme was not sent before.
            return told | {-1: last}
        return told

    def _spare(self, motion: Motion, index: int) -> dict[int, Preview]:
        """Return labels that a filmed superframe may send against a second loss."""
        near, far = LABELLED_AHEAD
        if set(self._labels_told(motion, index)) != {OWN, near}:
            return {}
        begin = int(motion.start_s // SUPERFRAME_S) if self._begin is None else self._begin
        others = (-1, far) if begin < index else (far,)
        return {k: labels for k in others if (labels := self._labels(index + k))}

    def _part(self, score: Score, index: int) -> tuple[ScorePart, bool]:
        """Return the score of a superframe as far as it fits into L0, and whether evenly."""
        if self._score is not score:
            self._score, self._line = score, to_line(score, self._options)
            self._fitted.clear()
        if index not in self._fitted:
            if len(self._fitted) > _HISTORY:
                self._fitted.clear()
            self._fitted[index] = self._fit(part_of(self._line, index, self._options), index)
        return self._fitted[index]

    def _labels(self, index: int) -> Preview:
        """Return the labels of a superframe, as many as fit into L0."""
        part = part_of(self._line, index, self._options)
        labels = labels_of(preview_of(part), part.language.silence)
        while labels and not self._fits(
            part_of_preview(labels, self._coding.language), index, {OWN: labels}, even=False
        ):
            labels = thinned(labels) if len(labels) > 1 else ()
        return labels

    def _fit(self, part: ScorePart, index: int) -> tuple[ScorePart, bool]:
        if self._filmed:
            return part_of_preview(self._labels(index), self._coding.language), False
        if self._fits(part, index, {}, even=False):
            return part, False
        # Denser than speech can be: first the times go, then the last phones.
        while True:
            part = evenly(part)
            if self._fits(part, index, {}, even=True) or len(part.numbers) == 1:
                return part, True
            part = part.without_last()

    def _fits(
        self, part: ScorePart, index: int, previews: dict[int, Preview], *, even: bool
    ) -> bool:
        nothing = np.zeros(self._coding.residual.scan_scales.size, dtype=np.int64)
        slow = (0,) if self._slow.due(index) else ()
        header = self._header(SCORE, index, slow)
        content = Content(header, NOTHING_SENT, part, nothing, previews, slow)
        return (
            write_l0(content, self._coding.bases, self._l0_bytes, self._coding.identity, even=even)
            is not None
        )
