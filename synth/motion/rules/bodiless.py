"""A cuer of whom there are targets but no body: a voice learnt from a speaker's recordings.

The hand goes from one of her own targets to the next with the timing of all rule-based cuers
(`synth.motion.rules.movement`), the face is the mean of her own visemes, weighted by dominances
that fall off with time (Cohen and Massaro 1993). Both are parameters of her voice, so that every
frame is one that her models can show. Her head is still.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.models.hand import N_HAND_PARAMETERS
from codec.cuer.motion import Motion
from codec.cuer.movement import FLOWING
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.phonology import PAUSE, PHONE_NUMBER
from codec.cues.score import PLACEMENTS, SHAPES, Score
from codec.cues.timeline import TICK_S, Sounding, to_ticks
from codec.errors import CueError
from codec.superframe.lips import LipContract
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.rules.coarticulation import PhoneLine, dominance
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import Gestures, check_alignment, law, moved, plan_gestures
from synth.motion.rules.outline import Outline, slack_of

FloatArray = NDArray[np.float64]

_REST_DOMINANCE = 0.05
"""Weight of the mouth at rest against phones, as for bodies."""

_PALM = layout.marker_indices(layout.PALM)


class RuledCuer(Protocol):
    """A rule-based performer of scores."""

    rate_hz: float

    def motion(self, score: Score, start_s: float, n_frames: int, voice: Voice) -> Motion:
        """Return some frames of a score's motion in the parameters of `voice`."""


def has_body(name: str) -> bool:
    """Return whether a virtual cuer of that name performs.

    Examples
    --------
    >>> has_body("claire"), has_body("anna")
    (True, False)
    """
    return name in IDENTITIES


def ruled_cuer(
    voice: Voice,
    *,
    rate_hz: float = 50.0,
    seed: int = 0,
    alignment: str = "attina",
    options: CueingOptions = DEFAULT_OPTIONS,
) -> RuledCuer:
    """Return who performs with a voice: the virtual cuer of its name, or its own targets.

    Parameters
    ----------
    voice : Voice
    rate_hz : float
        Frames per second, 1..1000.
    seed : int
        Of a virtual cuer's small motions and scatter.
    alignment : str
        One of `synth.motion.rules.movement.ALIGNMENTS`.
    options : CueingOptions
        When the hand rests.

    Raises
    ------
    CueError
        If the alignment is unknown, or the rate out of range.
    """
    if has_body(voice.name):
        return GestureSynthesiser(
            voice.name, rate_hz=rate_hz, seed=seed, alignment=alignment, options=options
        )
    return Bodiless(voice, rate_hz=rate_hz, alignment=alignment, options=options)


class Bodiless:
    """Performs scores with the targets of a voice.

    Parameters
    ----------
    voice : Voice
    rate_hz, alignment, options
        As of `ruled_cuer`.
    """

    def __init__(
        self,
        voice: Voice,
        *,
        rate_hz: float = 50.0,
        alignment: str = "attina",
        options: CueingOptions = DEFAULT_OPTIONS,
    ) -> None:
        if not 1 <= rate_hz <= 1000:
            raise CueError(f"rate {rate_hz} Hz is not within 1..1000")
        check_alignment(alignment)
        self.rate_hz = rate_hz
        self._alignment, self._options = alignment, options
        self._profile = law("minimum-jerk")
        table = voice.gestures
        shape, place = (grid.ravel() for grid in np.mgrid[0 : len(SHAPES), 0 : len(PLACEMENTS)])
        self._hands = np.concatenate(
            [table.shape_targets[shape], table.placement_targets[shape, place]], axis=1
        ).astype(np.float64)
        rows = np.zeros((len(self._hands), len(voice.layout)))
        rows[:, voice.hand_columns] = self._hands
        rows[:, voice.face_columns[N_FACE_PARAMETERS:]] = table.neutral_head
        self._palms = voice.reconstruct(rows)[:, _PALM].mean(axis=1).astype(np.float64)
        self._visemes = table.viseme_targets.astype(np.float64)
        self._head = table.neutral_head.astype(np.float64)
        self._lips = LipContract(voice)
        self._identity = voice.identity

    def motion(self, score: Score, start_s: float, n_frames: int, voice: Voice) -> Motion:
        """Return some frames of a score's motion, the lips true to the phones.

        Parameters
        ----------
        score : Score
            On the programme's clock.
        start_s : float
            Time of the first frame, seconds.
        n_frames : int
        voice : Voice
            The one whose targets they are.

        Raises
        ------
        CueError
            If it is another voice.
        """
        params = self.hand(score, start_s, n_frames, voice)
        times = start_s + np.arange(n_frames) / self.rate_hz
        params[:, voice.face_columns[:N_FACE_PARAMETERS]] = self._face(score, times)
        return Motion(params, self.rate_hz, start_s, voice.layout, voice.identity, score)

    def hand(
        self, score: Score, start_s: float, n_frames: int, voice: Voice
    ) -> NDArray[np.float32]:
        """Return the parameters of `motion`, but with the mean face, shape (n_frames, P)."""
        if voice.identity != self._identity:
            raise CueError(f"voice {voice.name} is another one than that of the targets")
        times = start_s + np.arange(n_frames) / self.rate_hz
        params = np.zeros((n_frames, len(voice.layout)), dtype=np.float32)
        params[:, voice.hand_columns] = self._hand(score, times)
        params[:, voice.face_columns[N_FACE_PARAMETERS:]] = self._head
        return params

    def outline(self, score: Score) -> Outline:
        """Return what `hand` depends on; the face does not move there."""
        gestures, values = self._planned(score)
        return Outline(
            gestures.leave, gestures.reach, values, slack_of(FLOWING), PhoneLine.of(score)
        )

    def _planned(self, score: Score) -> tuple[Gestures, FloatArray]:
        """Return the gestures of a score with their targets, shape (G, P)."""
        gestures = plan_gestures(
            score, alignment=self._alignment, options=self._options, way=self._way
        )
        return gestures, self._hands[gestures.shape * len(PLACEMENTS) + gestures.placement]

    def _hand(self, score: Score, times: FloatArray) -> FloatArray:
        gestures, values = self._planned(score)
        begins, ends = np.zeros(values.shape[1]), np.zeros(values.shape[1])
        begins[:N_HAND_PARAMETERS] = FLOWING.fingers_begin_s
        ends[:N_HAND_PARAMETERS] = FLOWING.fingers_end_s
        return moved(times, gestures, values, self._profile, begins_s=begins, ends_s=ends)

    def _way(self, before: tuple[int, int], after: tuple[int, int]) -> float:
        one, other = (self._palms[s * len(PLACEMENTS) + p] for s, p in (before, after))
        return float(np.linalg.norm(other - one))

    def _face(self, score: Score, times: FloatArray) -> FloatArray:
        line = PhoneLine.of(score)
        pull, near = dominance(line, times)
        whole = pull.sum(axis=1, keepdims=True) + _REST_DOMINANCE
        rest = _REST_DOMINANCE * self._visemes[PHONE_NUMBER[PAUSE]]
        face = (pull @ self._visemes[line.number[near]] + rest) / whole
        soundings = [
            Sounding(PHONE_NUMBER[p.symbol], to_ticks(p.start), to_ticks(p.end))
            for p in (score.phones[number] for number in near)
        ]
        return self._lips.kept(face, soundings, times / TICK_S)
