"""Superframes: 0.64 s of motion in two parts, and what a receiver knows of them.

Their scores and those of their neighbours predict the motion, alike for encoder and decoder.
Specification: spec/bitstream.md, sections 2 and 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.coding import Coding
from codec.joining import Joined
from codec.resynthesis.course import Resynthesis
from codec.score import Key, Phone
from codec.score_coding import ScorePart
from codec.timeline import TICKS
from codec.window import Window

Array = NDArray[np.float64]

WINDOWS = 4
"""Superframes before one whose windows can reach into it."""


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
    part : ScorePart or Window or None
        The score as sent, or as previewed if L0 is missing; None if neither arrived.
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
    part: ScorePart | Window | None
    lead: int
    sequence: int


def resynthesis_of(coding: Coding, joined: Joined, index: int) -> Resynthesis:
    """Return what the scores about superframe `index` say of it (section 5)."""
    return Resynthesis(joined, coding.targets, index * TICKS, TICKS)
