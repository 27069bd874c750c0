"""Superframes: 0.64 s of motion in two parts, and a receiver's view of them.

Their scores and those of their neighbours predict the motion, alike for encoder and decoder.
Decoded ones merge into one score, whole or as they arrive.
Specification: spec/bitstream.md, sections 2 and 5.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS
from codec.superframe.coding import Coding
from codec.superframe.merging import MergedScore, score_of
from codec.superframe.quantise import SHARES
from codec.superframe.resynthesis.trajectory import Resynthesis
from codec.superframe.score_coding import ScorePart
from codec.superframe.window import Window

Array = NDArray[np.float64]

WINDOWS = 4
"""Superframes before one whose windows can reach into it."""


@dataclass(frozen=True, slots=True)
class Superframe:
    """The two parts of superframe `index`, whose media time is ``index * 0.64`` s.

    Examples
    --------
    >>> frame = Superframe(3, bytes(20), bytes(7))
    >>> len(frame.l0) + len(frame.l1)
    27
    """

    index: int
    l0: bytes
    l1: bytes


@dataclass(frozen=True, slots=True)
class DecodedSuperframe:
    """Decoded state of 0.64 s of motion.

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
    part : ScorePart or Window or None
        The score as sent, or as previewed if L0 is missing; None if neither arrived.
    lead : int
        Superframes of lead on air before its time, -1 if L0 is missing.
    sequence : int
        `index` modulo 64.
    slow : tuple of int
        Pieces of the slow channel (`codec.superframe.slow_channel`).

    Examples
    --------
    >>> from codec import SuperframeDecoder, SuperframeEncoder, load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> sent = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7).encode(
    ...     motion_of(score_of_text("Oui"), voice), 0
    ... )
    >>> decoder = SuperframeDecoder(voice)
    >>> decoder.take(sent.l0, sent.l1, 0)
    >>> decoded = decoder.render(0)
    >>> [phone.symbol for phone in decoded.phones], [str(key) for key in decoded.keys]
    (['w', 'i'], ['26'])
    >>> decoded.layers, decoded.concealed
    (('L0', 'L1'), False)
    """

    index: int
    start_s: float
    params: NDArray[np.float32]
    phones: tuple[Phone, ...]
    keys: tuple[Key, ...]
    layers: tuple[str, ...]
    concealed: bool
    part: ScorePart | Window | None
    lead: int
    sequence: int
    slow: tuple[int, ...] = ()


def resynthesis_of(coding: Coding, joined: MergedScore, index: int) -> Resynthesis:
    """Return the score of superframe `index` from all scores that cover it (section 5)."""
    return Resynthesis(joined, coding.targets, index * TICKS, TICKS)


def scaled(prediction: Array, coding: Coding, shares: tuple[int, ...]) -> Array:
    """Return a prediction with some parts weighted less (P10).

    Parameters
    ----------
    prediction : ndarray of float64, shape (32, P)
    coding : Coding
    shares : tuple of int
        Indices in `codec.superframe.quantise.SHARES` of face, hand, head and forearm.
    """
    if not any(shares):
        return prediction
    targets = coding.targets
    widths = [part.shape[1] for part in (targets.face, targets.hand, targets.head, targets.forearm)]
    share = np.repeat([SHARES[k] for k in shares], widths)
    return np.asarray(coding.mean + share * (prediction - coding.mean))


def merge_scores(superframes: Iterable[DecodedSuperframe]) -> Score:
    """Return the merged score of superframes, every phone and key once.

    Parameters
    ----------
    superframes : iterable of DecodedSuperframe
        In any order; concealed ones say nothing.

    Returns
    -------
    Score
        Exact, on the grid of 20 ms, where no superframe is missing.
    """
    return score_of({s.index: s.part for s in superframes if s.part is not None})


class ScoreMerger:
    """Keys of superframes that arrive in order of time, each given out once and complete."""

    def __init__(self) -> None:
        self._parts: dict[int, ScorePart | Window] = {}
        self._settled: int | None = None

    def add(self, superframe: DecodedSuperframe) -> list[Key]:
        """Take the next superframe; return the keys that start before it and not yet given."""
        if superframe.part is not None:
            self._parts[superframe.index] = superframe.part
        return self._until(superframe.index)

    def flush(self) -> list[Key]:
        """Return the keys that were still open."""
        return self._until(max(self._parts, default=0) + 2)

    def _until(self, index: int) -> list[Key]:
        # The sound of a superframe's first phone may have begun in the one before.
        first = index - 1 if self._settled is None else self._settled
        begin, end = (k * SUPERFRAME_S - 0.5 * TICK_S for k in (first, index))
        keys = [key for key in score_of(self._parts).keys if begin <= key.start < end]
        self._settled = max(first, index)
        self._parts = {k: part for k, part in self._parts.items() if k >= index - WINDOWS}
        return keys
