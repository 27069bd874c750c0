"""What her performance shows: the cuer who is to cue performs a plan herself, and is looked at.

`synth.motion.rules.visibility` is quick and leaves out drift, scatter and the head; this is slower
and true.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import Classes, classes_of, keys_shown_at
from codec.cuer import layout
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Key, Phone, Score
from synth.motion.rules.bodiless import Bodiless, has_body
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.outline import Outline
from synth.motion.rules.visibility import VisibilityModel

RATE_HZ = 50.0
"""Frames per second at which she is looked at: those of all reports."""

_AROUND_S = 0.6
"""Seconds of motion before the first key and after the last one."""

_KNOWN = 8
"""Mirrors of virtual cuers that are kept."""


@dataclass(frozen=True, slots=True)
class PerformerChoice:
    """The rule-based cuer to simulate.

    Attributes
    ----------
    voice : str
        Name of a virtual cuer, or the file of a voice.
    seed : int
        Of a virtual cuer's small motions and scatter.
    alignment : str
        One of `synth.motion.rules.movement.ALIGNMENTS`.

    Examples
    --------
    >>> PerformerChoice("agathe", seed=2).voice
    'agathe'
    """

    voice: str = "claire"
    seed: int = 0
    alignment: str = "attina"


CLAIRE = PerformerChoice()
"""The default cuer."""


class PlanPerformer(Protocol):
    """Whoever performs a score in front of the mirror."""

    def hand(self, score: Score, start_s: float, n_frames: int) -> NDArray[np.float64]:
        """Return the markers of the hand as seen from the head, shape (n_frames, 50, 3), mm."""

    def outline(self, score: Score) -> Outline:
        """Return the score's parts that the performance depends on."""


@dataclass(frozen=True, slots=True)
class SimulatedPerformance:
    """A performance that was looked at; T frames.

    Attributes
    ----------
    start_s : float
        Time of the first frame, seconds.
    outline : Outline
    shapes, placements : ndarray, shapes (T, 9) and (T, 9, 6)
        How far the hand is from each shape and placement, mm.
    held_s : ndarray, shape (N,)
        How long each key is shown.
    """

    start_s: float
    outline: Outline
    shapes: NDArray[np.float64]
    placements: NDArray[np.float64]
    held_s: NDArray[np.float64]


class PerformanceSimulation:
    """A cuer who performs, and is looked at.

    Parameters
    ----------
    performer : PlanPerformer
        At 50 frames per second.
    classes : Classes
        Her targets.
    sight : VisibilityModel
        The quick model of her hand.
    options : CueingOptions
        Which gaps between keys return to rest.
    """

    def __init__(
        self,
        performer: PlanPerformer,
        classes: Classes,
        sight: VisibilityModel,
        options: CueingOptions,
    ) -> None:
        self.sight = sight
        self.performer, self.classes, self._options = performer, classes, options

    def performed(
        self, phones: Sequence[Phone], keys: Sequence[Key], like: SimulatedPerformance | None = None
    ) -> SimulatedPerformance:
        """Return her performance of a score.

        Parameters
        ----------
        phones : sequence of Phone
        keys : sequence of Key
            As `codec.cues.cueing.cue` makes them; at least one.
        like : SimulatedPerformance, optional
            Of a score with hardly another timing: only frames that differ are made again.
        """
        score = Score(tuple(phones), tuple(keys))
        start_s = max(0.0, keys[0].start - _AROUND_S)
        frames = int((keys[-1].end + _AROUND_S - start_s) * RATE_HZ)
        outline = self.performer.outline(score)
        shapes, placements = np.empty((frames, 9)), np.empty((frames, 9, 6))
        fresh = np.ones(frames, dtype=np.bool_)
        if like is not None and like.start_s == start_s:
            known = min(frames, len(like.shapes))
            times = start_s + np.arange(known) / RATE_HZ
            fresh[:known] = outline.differs(like.outline, times, face=False)
            shapes[:known], placements[:known] = like.shapes[:known], like.placements[:known]
        for first, last in _runs(fresh):
            hand = self.performer.hand(score, start_s + first / RATE_HZ, last - first)
            shapes[first:last], placements[first:last] = self.classes.distances_of(hand)
        shown = keys_shown_at(
            shapes, placements, score, rate_hz=RATE_HZ, start_s=start_s, options=self._options
        )
        held_s = np.array([item.held_s for item in shown])
        return SimulatedPerformance(start_s, outline, shapes, placements, held_s)


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first number and end of each run of true values."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def mirror_of(
    performing: PerformerChoice = CLAIRE, options: CueingOptions = DEFAULT_OPTIONS
) -> PerformanceSimulation:
    """Return the mirror of who is to cue.

    Parameters
    ----------
    performing : PerformerChoice
    options : CueingOptions
        Which gaps between keys return to rest.

    Raises
    ------
    CueError
        If there is no such voice or alignment.
    """
    name = performing.voice
    if not has_body(name):
        voice = load_voice(name)
        if not has_body(voice.name):
            return mirror_of_voice(voice, performing.alignment, options)
        name = voice.name
    return _mirror_of_body(name, performing.seed, performing.alignment, options)


@lru_cache(_KNOWN)
def _mirror_of_body(
    name: str, seed: int, alignment: str, options: CueingOptions
) -> PerformanceSimulation:
    cuer = GestureSynthesiser(
        name, rate_hz=RATE_HZ, seed=seed, alignment=alignment, options=options
    )
    return PerformanceSimulation(
        cuer, Classes(cuer.targets()[0]), VisibilityModel.of(cuer), options
    )


def mirror_of_voice(
    voice: Voice, alignment: str = "attina", options: CueingOptions = DEFAULT_OPTIONS
) -> PerformanceSimulation:
    """Return the mirror of a voice without a body, which performs with its own targets."""
    cuer = Bodiless(voice, rate_hz=RATE_HZ, alignment=alignment, options=options)
    return PerformanceSimulation(
        _Hand(cuer, voice), classes_of(voice), VisibilityModel.of_voice(voice), options
    )


class _Hand:
    """The hand of a voice's targets before a still face."""

    def __init__(self, cuer: Bodiless, voice: Voice) -> None:
        self._cuer, self._voice = cuer, voice

    def hand(self, score: Score, start_s: float, n_frames: int) -> NDArray[np.float64]:
        params = self._cuer.hand(score, start_s, n_frames, self._voice)
        return self._voice.reconstruct(params)[:, layout.N_FACE :].astype(np.float64)

    def outline(self, score: Score) -> Outline:
        return self._cuer.outline(score)
