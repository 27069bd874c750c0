"""The second virtual cuer: a body, strokes, a face, small motion; markers at any moment."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.phonology import PAUSE, PHONE_NUMBER
from codec.cues.score import Key, Score
from codec.errors import CueError
from synth.motion.body.body import Body, BodyPose, load_asset, load_body
from synth.motion.body.skeleton import HAND_ANGLES
from synth.motion.measured.drift_noise import DriftNoise
from synth.motion.measured.face import articulators, steps
from synth.motion.measured.plan import MovementPlan, make_plan
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.labels import Labels
from synth.motion.rules.visemes import ARTICULATORS, UNITS_OF

FloatArray = NDArray[np.float64]

MEASURED = "measured"
"""Name of her movement, where others have a law of movement."""

_HEAD_SD = np.array([*np.radians([0.7, 0.48, 0.43]), 1.0, 0.9, 1.0])
"""Standard deviation of the head's small motion: turn in radians, shift in mm. With her mobility
the mouth moves by 0.9 and 1.7 mm against the ears and the head by 1.6 mm, as in 64 real takes."""

_HEAD_STEP_S = 0.45
"""Seconds between the points of the head's small motion."""

_ARM_SD = np.array([0.012, 0.012, 0.012, 1.6, 1.6, 1.6])
"""Standard deviation of the arm's small motion: turn in radians, shift in mm."""

_ARM_STEP_S = 0.16
"""Seconds between its points."""

_FREE_ARM_SD = np.array([0.2, 0.2, 0.2, 25.0, 25.0, 25.0])
"""The same in free space (corpus 1)."""

_FINGER_SD_DEG, _WRIST_SD_DEG = 1.5, 1.0
"""Standard deviation in degrees of the small motion of finger joints and wrist."""

_FREE_WRIST_SD_DEG = (16.0, 6.0, 9.0)
"""That of the wrist in free space, by axis."""

_FINGER_STEP_S = 0.2
"""Seconds between the points of the fingers' small motion."""

_UNIT_SD, _UNIT_STEP_S = 0.015, 0.3
"""Standard deviation of the face units' small motion, and seconds between its points."""

_FOLLOWS = 0.9
"""How much of the head's motion the raised hand takes over; a resting hand none."""

_HELD_S = 0.06
"""Seconds about an arrival whose frames are labelled as held."""


class Performer(Protocol):
    """A virtual cuer, whichever way she moves."""

    body: Body
    rate_hz: float

    def pose(self, score: Score, start_s: float, n_frames: int) -> BodyPose:
        """Return the pose of each frame."""

    def markers(self, score: Score, start_s: float, n_frames: int) -> NDArray[np.float32]:
        """Return the true markers, shape (n_frames, 113, 3), mm."""

    def motion(self, score: Score, start_s: float, n_frames: int, voice: Voice) -> Motion:
        """Return the parameters that `voice` finds for the markers."""

    def labels(self, score: Score, start_s: float, n_frames: int) -> Labels:
        """Return the held key of each frame."""

    def target_times(self, score: Score) -> list[tuple[Key | None, float]]:
        """Return when the hand is on target, per key and per rest (None)."""


def performer(
    identity: str, law: str, *, rate_hz: float = 50.0, seed: int = 0, free_space: bool = False
) -> Performer:
    """Return a virtual cuer by her name and her way of moving.

    Parameters
    ----------
    identity : str
        One of `synth.motion.body.anatomy.IDENTITIES`.
    law : str
        `MEASURED`, or one of the laws of movement of the rule-based cuers.
    rate_hz : float
    seed : int
    free_space : bool
        The arm wanders and the wrist bends at will, as in the paper's first corpus.

    Raises
    ------
    CueError
        If there is no such cuer.

    Examples
    --------
    >>> type(performer("solange", "measured")).__name__
    'MeasuredCuer'
    """
    if law == MEASURED:
        return MeasuredCuer(identity, rate_hz=rate_hz, seed=seed, free_space=free_space)
    return GestureSynthesiser(identity, law=law, rate_hz=rate_hz, seed=seed, free_space=free_space)


class MeasuredCuer:
    """A cuer who moves as real ones were measured to.

    Parameters
    ----------
    identity : str
        Whose body: one of `synth.motion.body.anatomy.IDENTITIES`.
    rate_hz : float
        Frames per second.
    seed : int
        Of everything drawn.
    free_space : bool
        The arm wanders and the wrist bends at will.

    Raises
    ------
    CueError
        If the identity is unknown, or the rate is not within 1..1000 Hz.
    """

    def __init__(
        self,
        identity: str = "solange",
        *,
        rate_hz: float = 50.0,
        seed: int = 0,
        free_space: bool = False,
    ) -> None:
        if not 1 <= rate_hz <= 1000:
            raise CueError(f"rate {rate_hz} Hz is not within 1..1000")
        self.body: Body = load_body(identity)
        self.rate_hz = rate_hz
        self._seed = 64 * seed
        reach = load_asset(f"reach_{identity}")
        self._wrist, self._forearm = reach["wrist"], reach["forearm"]
        mobility = self.body.habits.head_mobility
        self._head = DriftNoise(_HEAD_SD * mobility, _HEAD_STEP_S, self._seed + 10)
        self._arm = DriftNoise(
            _FREE_ARM_SD if free_space else _ARM_SD, _ARM_STEP_S, self._seed + 11
        )
        sizes = np.full(len(HAND_ANGLES), _FINGER_SD_DEG)
        sizes[:3] = _FREE_WRIST_SD_DEG if free_space else _WRIST_SD_DEG
        self._fingers = DriftNoise(sizes, _FINGER_STEP_S, self._seed + 12)
        self._gains = self._unit_gains()
        self._face = DriftNoise(
            np.full(len(self.body.unit_names), _UNIT_SD), _UNIT_STEP_S, self._seed + 13
        )
        self._planned: tuple[Score, MovementPlan, tuple[FloatArray, FloatArray]] | None = None

    def pose(self, score: Score, start_s: float, n_frames: int) -> BodyPose:
        """Return face-unit weights, head, hand angles and forearm of each frame."""
        times = start_s + np.arange(n_frames) / self.rate_hz
        plan, (at, values) = self._plan(score)
        head = self._head.at(times)
        forearm = plan.arm.at(times) + self._arm.at(times)
        raised = self._raised(forearm)
        forearm[:, 3:] += _FOLLOWS * raised[:, None] * self._carried(forearm[:, 3:], head)
        angles = plan.fingers.at(times) + self._fingers.at(times)
        units = articulators(times, at, values) @ self._gains + self._face.at(times)
        return BodyPose(units, head, angles, forearm)

    def markers(self, score: Score, start_s: float, n_frames: int) -> NDArray[np.float32]:
        """Return the true markers, shape (n_frames, 113, 3), mm."""
        return self.body.markers(self.pose(score, start_s, n_frames)).astype(np.float32)

    def motion(self, score: Score, start_s: float, n_frames: int, voice: Voice) -> Motion:
        """Return the parameters that `voice` finds for the markers."""
        markers = self.markers(score, start_s, n_frames)
        return voice.invert(markers, rate_hz=self.rate_hz, start_s=start_s, score=score)

    def labels(self, score: Score, start_s: float, n_frames: int) -> Labels:
        """Return the held key of each frame; -1 during movements.

        She rarely stands still: a key counts as held for a moment about its arrival.
        """
        times = start_s + np.arange(n_frames) / self.rate_hz
        plan, _ = self._plan(score)
        shape = np.full(n_frames, -1, dtype=np.int8)
        placement = shape.copy()
        for number, arrive in enumerate(plan.arrive):
            until = max(arrive + 0.5 * _HELD_S, plan.leave[number])
            held = (times >= arrive - 0.5 * _HELD_S) & (times < until)
            shape[held], placement[held] = plan.shape[number], plan.placement[number]
        phone = np.full(n_frames, PHONE_NUMBER[PAUSE], dtype=np.int8)
        for one in score.phones:
            spoken = (times >= one.start) & (times < one.end)
            middle = np.abs(times - 0.5 * (one.start + one.end)) < 0.15 * (one.end - one.start)
            phone[spoken] = np.where(middle[spoken], PHONE_NUMBER[one.symbol], -1)
        return Labels(shape, placement, phone)

    def target_times(self, score: Score) -> list[tuple[Key | None, float]]:
        """Return when the hand is on target, per key and per rest (None) between or after keys."""
        plan, _ = self._plan(score)
        return [(key, float(at)) for key, at in zip(plan.keys[1:], plan.arrive[1:], strict=True)]

    def _plan(self, score: Score) -> tuple[MovementPlan, tuple[FloatArray, FloatArray]]:
        if self._planned is None or self._planned[0] is not score:
            plan = make_plan(score, self.body, self._wrist, self._forearm, self._seed)
            self._planned = score, plan, steps(score, self._seed)
        return self._planned[1:]

    def _raised(self, forearm: FloatArray) -> FloatArray:
        """Return how far the hand is up, 0 at rest to 1 at the throat and above, shape (T,)."""
        low, high = self._forearm[0, 0, 4], self._forearm[5, 5, 4]
        return np.asarray(np.clip((forearm[:, 4] - low) / (high - low), 0.0, 1.0))

    def _carried(self, points: FloatArray, head: FloatArray) -> FloatArray:
        """Return how far the head's motion carries points of the resting head, (T, 3), mm."""
        turns, places = self.body.neck(head)
        from_joint = points - self.body.face_skin.origins[-1]
        return np.asarray(
            places[:, -1] + np.einsum("tij,tj->ti", turns[:, -1], from_joint) - points
        )

    def _unit_gains(self) -> FloatArray:
        """Return how articulators drive the units of her face, shape (14, U)."""
        habits = self.body.habits
        gains = np.zeros((len(ARTICULATORS), len(self.body.unit_names)))
        for row, articulator in enumerate(ARTICULATORS):
            for unit in UNITS_OF[articulator]:
                side = 1.0 if unit.endswith("Right") else -1.0 if unit.endswith("Left") else 0.0
                gain = habits.opening * (1.0 + side * habits.asymmetry)
                gains[row, self.body.unit_names.index(unit)] = gain
        return gains
