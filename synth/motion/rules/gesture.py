"""From a score to the moving cuer: face, head and hand at any moment.

`GestureSynthesiser.markers` is a pure function of score and absolute time: a window of frames is
the same whether it is made alone or within a longer one. Timing of the hand:
`synth.motion.rules.movement`; of the face: `synth.motion.rules.coarticulation`; the targets:
`synth.motion.body`.

Hand targets belong to the head (Gibert, Bailly, Elisei 2004, section 4): while the hand is at the
face it follows the head's motion.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.models.smooth_inversion import ANCHORED, SIDE
from codec.cuer.motion import Motion
from codec.cuer.movement import FLOWING, Movement
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.phonology import PHONE_NUMBER
from codec.cues.score import PLACEMENTS, Key, Score
from codec.cues.timeline import TICK_S, Sounding, to_ticks
from codec.errors import CueError
from codec.superframe.lips import LipContract
from synth.motion.body.body import Body, BodyPose, load_asset, load_body
from synth.motion.body.reach import key_poses, placement_target
from synth.motion.body.skeleton import HAND_ANGLES
from synth.motion.rules.coarticulation import PhoneLine, articulate
from synth.motion.rules.drift import Drift, normals_at
from synth.motion.rules.labels import Labels, labels_at
from synth.motion.rules.movement import Gestures, check_alignment, moved, plan_gestures
from synth.motion.rules.movement import law as movement_law
from synth.motion.rules.outline import Outline, slack_of
from synth.motion.rules.visemes import ARTICULATORS, UNITS_OF, viseme_table

FloatArray = NDArray[np.float64]
Lateness = float | FloatArray

FOLLOWS_HEAD = {"rest": 0.1, "side": 0.8, "mouth": 1.0, "chin": 1.0, "cheek": 1.0, "throat": 0.7}
"""How much of the head's motion the hand takes over where it is."""

_MEETS_HAND_DEG = {
    "rest": (0.0, 0.0),
    "side": (0.1, -0.3),
    "mouth": (0.4, -0.8),
    "chin": (0.9, -0.5),
    "cheek": (0.3, -1.2),
    "throat": (-0.9, -0.4),
}
"""Pitch and yaw of the head towards the hand, degrees: its part of the constriction."""

_HEAD_DRIFT = np.array([*np.radians([1.2, 0.8, 0.5]), 1.2, 1.0, 1.4])
ARC = (-0.24, -0.13, 0.1)
"""How far the middle of a stroke lies outwards, upwards and to the front, per mm of way, unless it
would pass a third placement so (``lab/arcs.py``); real cuers' strokes bend outwards by a fifth of
their length."""

_OUT_OF_STEP_S = {"thumb": -0.02, "index": -0.01, "middle": 0.0, "ring": 0.008, "little": 0.016}
"""How much later than the fingers together each one moves."""

_FINGER_DRIFT_DEG = 0.8
"""Standard deviation in degrees of each finger joint's slow drift."""

_WRIST_DRIFT_DEG = 1.0
"""That of the wrist."""

_ARM_DRIFT = np.array([0.008] * 3 + [1.0] * 3)  # rad, mm

_FREE_WRIST_DEG = (16.0, 6.0, 9.0)
"""That of the wrist in free space (corpus 1), by axis."""

_FREE_ARM = 25.0  # times the usual drift
_TURN_SCATTER = 0.01  # rad
_WIDEST = 2.0
"""Standard deviations to which the scatter is bounded."""

_AIM = {"rest": 1.0, "side": 1.0, "mouth": 0.5, "chin": 0.5, "cheek": 0.8, "throat": 1.0}
"""Share of the scatter at each placement: mouth and chin, 37 mm apart, are aimed at with care."""

_SCATTERED = np.array([0.25] * 3 + [1.0] * (len(HAND_ANGLES) - 3))
"""Shares of the scatter in wrist and fingers: the wrist's would carry the tip 6 mm away."""

_UNIT_DRIFT = {
    "browInnerUp": 0.08, "browOuterUpLeft": 0.05, "browOuterUpRight": 0.05, "browDownLeft": 0.04,
    "browDownRight": 0.04, "jawLeft": 0.03, "mouthLeft": 0.03, "mouthShrugUpper": 0.03,
    "mouthShrugLower": 0.04, "mouthDimpleLeft": 0.03, "mouthDimpleRight": 0.03, "jawForward": 0.03,
    "cheekSquintLeft": 0.03, "cheekSquintRight": 0.03, "mouthSmileLeft": 0.03,
    "mouthSmileRight": 0.03, "jawOpen": 0.006, "larynxRaise": 0.3,
}  # fmt: skip
_SMOOTH_HZ = 50.0
"""Frames per second from which neighbouring ones are near enough to begin each other's inversion.
"""

_LIPS_TICKS = 10
"""How far from a frame a phone can bind its lips."""


@dataclass(frozen=True, slots=True)
class _Plan:
    """A score with the targets of its gestures, rest included; G of them.

    `angles` (G, 31) and `forearm` (G, 6) are targets of hand and arm, `target` (G, 3) the point
    of the resting head that the tip goes to, `follows` (G,) how much of the head's motion the arm
    takes over there, `meets` (G, 3) how the head turns towards the hand, rad.
    """

    score: Score
    phones: PhoneLine
    gestures: Gestures
    angles: FloatArray
    forearm: FloatArray
    target: FloatArray
    follows: FloatArray
    meets: FloatArray


class GestureSynthesiser:
    """A cuer who performs scores.

    Parameters
    ----------
    identity : str
        One of `synth.motion.body.anatomy.IDENTITIES`.
    law : str
        Movement law of the hand, one of `synth.motion.rules.movement.LAWS`.
    rate_hz : float
        Frames per second.
    seed : int
        Of the small motions and the scatter of targets.
    alignment : str
        One of `synth.motion.rules.movement.ALIGNMENTS`.
    options : CueingOptions
        When the hand rests.
    movement : Movement
        Timing and courses of the hand.
    free_space : bool
        The arm wanders and the wrist bends at will, as in the paper's first corpus.

    Raises
    ------
    CueError
        If identity, law or alignment is unknown, or the rate is not within 1..1000 Hz.
    """

    def __init__(
        self,
        identity: str = "claire",
        *,
        law: str = "minimum-jerk",
        rate_hz: float = 50.0,
        seed: int = 0,
        alignment: str = "attina",
        options: CueingOptions = DEFAULT_OPTIONS,
        movement: Movement = FLOWING,
        free_space: bool = False,
    ) -> None:
        if not 1 <= rate_hz <= 1000:
            raise CueError(f"rate {rate_hz} Hz is not within 1..1000")
        check_alignment(alignment)
        self.body: Body = load_body(identity)
        self.rate_hz = rate_hz
        self._profile = movement_law(law)
        self._seed = seed
        self._alignment = alignment
        self._options = options
        self._movement = movement
        reach = load_asset(f"reach_{identity}")
        self._wrist, self._forearm = reach["wrist"], reach["forearm"]
        self.arcs = arcs_of(reach["arcs"])
        self._targets = np.array([placement_target(self.body, p) for p in PLACEMENTS])
        rng = np.random.default_rng([seed, 11])
        mobility = self.body.habits.head_mobility
        self._head_drift = Drift.seeded(_HEAD_DRIFT * mobility, rng)
        angle_sizes = np.full(len(HAND_ANGLES), _FINGER_DRIFT_DEG)
        angle_sizes[:3] = _FREE_WRIST_DEG if free_space else _WRIST_DRIFT_DEG
        self._angle_drift = Drift.seeded(angle_sizes, rng)
        self._arm_drift = Drift.seeded(_ARM_DRIFT * (_FREE_ARM if free_space else 1.0), rng)
        sizes = np.array([_UNIT_DRIFT.get(name, 0.0) for name in self.body.unit_names])
        self._unit_drift = Drift.seeded(sizes, rng, band_hz=(0.1, 1.5))
        self._unit_matrix = self._articulator_matrix()
        self._begins, self._ends = self._joints_lateness()
        self._planned: _Plan | None = None
        self._lips: tuple[str, LipContract] | None = None

    def times_s(self, start_s: float, n_frames: int) -> FloatArray:
        """Return the time of each frame, seconds, shape (n_frames,)."""
        return start_s + np.arange(n_frames) / self.rate_hz

    def markers(self, score: Score, start_s: float, n_frames: int) -> NDArray[np.float32]:
        """Return the true marker positions.

        Parameters
        ----------
        score : Score
            On the programme's clock.
        start_s : float
            Time of the first frame, seconds.
        n_frames : int

        Returns
        -------
        ndarray of float32, shape (n_frames, 113, 3)
            Millimetres, order of `codec.cuer.layout.MARKERS`.
        """
        times = self.times_s(start_s, n_frames)
        plan = self._plan(score)
        head, angles, forearm, neck = self._carriage(plan, times)
        pose = BodyPose(self._units(plan, times), head, angles, forearm)
        return self.body.markers(pose, neck).astype(np.float32)

    def hand(self, score: Score, start_s: float, n_frames: int) -> FloatArray:
        """Return the markers of hand and forearm as seen from the head.

        Parameters
        ----------
        score, start_s, n_frames
            As of `markers`.

        Returns
        -------
        ndarray of float64, shape (n_frames, 50, 3)
            Millimetres; the head is at rest.
        """
        times = self.times_s(start_s, n_frames)
        _, angles, forearm, (turns, places) = self._carriage(self._plan(score), times)
        apart = self.body.hand(angles, forearm) - places[:, -1:]
        return np.asarray(apart @ turns[:, -1] + self.body.face_skin.origins[-1])

    def motion(self, score: Score, start_s: float, n_frames: int, voice: Voice) -> Motion:
        """Return the parameters that `voice` finds for the markers, the lips true to the phones."""
        params = self._found(score, start_s, n_frames, voice)
        motion = Motion(params, self.rate_hz, start_s, voice.layout, voice.identity, score)
        if self._lips is None or self._lips[0] != voice.identity:
            self._lips = voice.identity, LipContract(voice)
        ticks, line = self.times_s(start_s, n_frames) / TICK_S, self._plan(score).phones
        near = [
            Sounding(PHONE_NUMBER[p.symbol], to_ticks(p.start), to_ticks(p.end))
            for p in (
                score.phones[number]
                for number in _under_way(line.start / TICK_S, line.end / TICK_S, ticks, _LIPS_TICKS)
            )
        ]
        face = motion.params[:, :N_FACE_PARAMETERS].astype(np.float64)
        motion.params[:, :N_FACE_PARAMETERS] = self._lips[1].kept(face, near, ticks)
        return motion

    def _found(
        self, score: Score, start_s: float, n_frames: int, voice: Voice
    ) -> NDArray[np.float32]:
        """Return the parameters that `voice` finds for the markers, shape (n_frames, P).

        Frames that begin others' inversion are the same ones in every window.
        """
        if self.rate_hz < _SMOOTH_HZ or not n_frames:
            markers = self.markers(score, start_s, n_frames)
            return voice.invert(markers, rate_hz=self.rate_hz).params
        lead = round(start_s * self.rate_hz) % ANCHORED + SIDE
        frames = 1 - (1 - lead - n_frames) // ANCHORED * ANCHORED + SIDE
        first_s = start_s - lead / self.rate_hz
        markers = self.markers(score, first_s, frames)
        # The voice's own shapes, on the strokes of the fingers: the hand that is to be found is
        # near, but for drift and scatter.
        gestures, rule = self._plan(score).gestures, self._movement
        shapes = voice.gestures.shape_targets[gestures.shape].astype(np.float64)
        begins, ends = (
            np.full(shapes.shape[1], x) for x in (rule.fingers_begin_s, rule.fingers_end_s)
        )
        hand = moved(
            self.times_s(first_s, frames), gestures, shapes, self._profile,
            begins_s=begins, ends_s=ends, movement=rule,
        )  # fmt: skip
        return voice.invert_smooth(markers, hand)[lead : lead + n_frames]

    def pose(self, score: Score, start_s: float, n_frames: int) -> BodyPose:
        """Return face-unit weights, head, hand angles and forearm of each frame."""
        times = self.times_s(start_s, n_frames)
        plan = self._plan(score)
        return BodyPose(self._units(plan, times), *self._carriage(plan, times)[:3])

    def _carriage(
        self, plan: _Plan, times: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
        """Return head, hand angles and forearm at each time, as of `BodyPose`, and its neck."""
        rule = self._movement

        # Every channel moves from target to target by the law, each with its own lateness.
        def course(values: FloatArray, begin_s: Lateness, end_s: Lateness) -> FloatArray:
            begins, ends = (np.broadcast_to(x, values.shape[1:]) for x in (begin_s, end_s))
            return moved(
                times,
                plan.gestures,
                values,
                self._profile,
                begins_s=begins,
                ends_s=ends,
                movement=rule,
            )

        # head    = drift + its turn towards the hand
        # forearm = course of the targets + drift + arc beside the straight way
        #           + the part of the head's motion that the placement shares
        head = self._head_drift.at(times)
        head[:, :3] += course(plan.meets, rule.head_begin_s, rule.head_end_s)
        neck = self.body.neck(head)
        carrier = course(np.column_stack([plan.target, plan.follows]), 0.0, 0.0)
        turning = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        forearm = course(plan.forearm, rule.turn_begin_s * turning, rule.turn_end_s * turning)
        forearm += self._arm_drift.at(times)
        forearm[:, 3:] += self._arc(plan, times)
        forearm[:, 3:] += carrier[:, 3:] * self._carried(carrier[:, :3], neck)
        angles = course(plan.angles, self._begins, self._ends) + self._angle_drift.at(times)
        return head, angles, forearm, neck

    def _arc(self, plan: _Plan, times: FloatArray) -> FloatArray:
        """Return how far the wrist leaves the straight way, (T, 3), mm."""
        g = plan.gestures
        path = np.linalg.norm(np.diff(plan.forearm[:, 3:], axis=0), axis=1)
        keys = len(PLACEMENTS) * g.shape + g.placement
        out = np.zeros((len(times), 3))
        for number in 1 + _under_way(g.leave[1:], g.reach[1:], times):
            here = slice(*np.searchsorted(times, [g.leave[number], g.reach[number]]))
            elapsed = (times[here] - g.leave[number]) / (g.reach[number] - g.leave[number])
            # A parabola over the way: 0 at both ends, the arc's height at its middle.
            part = self._profile(elapsed**self._movement.power)
            arc = self.arcs[keys[number - 1], keys[number]]
            out[here] += np.outer(4.0 * part * (1.0 - part) * path[number - 1], arc)
        return out

    def targets(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the markers of all targets, exact and with the head at rest.

        Returns
        -------
        keys : ndarray of float32, shape (9, 6, 113, 3)
            Every hand shape at every placement, mm.
        visemes : ndarray of float32, shape (38, 113, 3)
            The face of every phone, the hand at rest, mm.
        """
        angles, forearm = self.key_poses()
        still = np.zeros((len(angles), 6))
        face = np.zeros((len(angles), len(self.body.unit_names)))
        keys = self.body.markers(BodyPose(face, still, angles, forearm))
        units = viseme_table()[0] @ self._unit_matrix
        n = len(units)
        at_rest = BodyPose(
            units, still[:n], np.repeat(angles[:1], n, axis=0), np.repeat(forearm[:1], n, axis=0)
        )
        visemes = self.body.markers(at_rest)
        return keys.reshape(9, len(PLACEMENTS), -1, 3).astype(np.float32), visemes.astype(
            np.float32
        )

    def key_poses(self) -> tuple[FloatArray, FloatArray]:
        """Return hand angles (54, 31) and forearm poses (54, 6) of all keys, by shape."""
        shape, placement = (grid.ravel() for grid in np.mgrid[0:9, 0 : len(PLACEMENTS)])
        return self._key_targets(shape, placement)

    def labels(self, score: Score, start_s: float, n_frames: int) -> Labels:
        """Return the held key of each frame."""
        plan, times = self._plan(score), self.times_s(start_s, n_frames)
        return labels_at(times, plan.gestures, plan.phones, self._movement)

    def target_times(self, score: Score) -> list[tuple[Key | None, float]]:
        """Return when the hand is on target: per key and per rest (None) between or after keys."""
        gestures = self.gestures(score)
        keys = iter(score.keys)
        return [
            (None if placement == 0 else next(keys), float(reach))
            for placement, reach in zip(gestures.placement[1:], gestures.reach[1:], strict=True)
        ]

    def gestures(self, score: Score) -> Gestures:
        """Return when every target of `score` is left and reached."""
        return self._plan(score).gestures

    def outline(self, score: Score) -> Outline:
        """Return the score's parts that its markers depend on."""
        plan = self._plan(score)
        targets = [plan.angles, plan.forearm, plan.target, plan.follows, plan.meets]
        gestures = plan.gestures
        return Outline(
            gestures.leave,
            gestures.reach,
            np.column_stack(targets),
            slack_of(self._movement),
            plan.phones,
        )

    def _plan(self, score: Score) -> _Plan:
        if self._planned is None or self._planned.score is not score:
            self._planned = self._make_plan(score)
        return self._planned

    def _make_plan(self, score: Score) -> _Plan:
        places = self._forearm[..., 3:]
        gestures = plan_gestures(
            score,
            alignment=self._alignment,
            options=self._options,
            movement=self._movement,
            way=lambda before, after: float(np.linalg.norm(places[after] - places[before])),
        )
        shape, placement = gestures.shape, gestures.placement
        names = [PLACEMENTS[number] for number in placement]
        angles, forearm = self._key_targets(shape, placement)
        habits = self.body.habits
        # Aim: each key misses its target by noise that depends on its moment alone, so that a
        # plan made again, or from a later start, gives the same hand.
        for number, moment in enumerate(gestures.reach):
            noise = normals_at(moment, len(HAND_ANGLES) + 6, self._seed)
            noise = _AIM[names[number]] * np.clip(noise, -_WIDEST, _WIDEST)
            angles[number] += habits.scatter_deg * noise[6:] * _SCATTERED
            forearm[number, :3] += _TURN_SCATTER * noise[:3]
            forearm[number, 3:] += habits.scatter_mm * noise[3:6]
        self._undershoot(gestures, angles, forearm)
        meets = np.zeros((len(names), 3))
        meets[:, :2] = np.radians([_MEETS_HAND_DEG[name] for name in names])
        follows = np.array([FOLLOWS_HEAD[name] for name in names])
        return _Plan(
            score, PhoneLine.of(score), gestures, angles, forearm, self._targets[placement],
            follows, meets,
        )  # fmt: skip

    def _key_targets(
        self, shape: NDArray[np.int64], placement: NDArray[np.int64]
    ) -> tuple[FloatArray, FloatArray]:
        """Return hand angles (G, 31) and forearm poses (G, 6) of keys, head at rest."""
        return key_poses(self._wrist, self._forearm, shape, placement)

    def _undershoot(self, g: Gestures, angles: FloatArray, forearm: FloatArray) -> None:
        """Pull the targets of short gestures back towards their predecessors."""
        ends = np.append(g.leave[1:], np.inf)
        natural = self._movement.natural_s
        hurry = np.clip((natural - (ends - g.leave)) / (0.5 * natural), 0.0, 1.5)
        missing = self.body.habits.undershoot * hurry
        for number in range(1, len(missing)):
            angles[number] += missing[number] * (angles[number - 1] - angles[number])
            forearm[number] += missing[number] * (forearm[number - 1] - forearm[number])

    def _joints_lateness(self) -> tuple[FloatArray, FloatArray]:
        """Return how much later than its place the hand's angles begin and end, both (31,), s."""
        rule = self._movement
        late = np.zeros(len(HAND_ANGLES))
        for name, out_of_step_s in _OUT_OF_STEP_S.items():
            late[[i for i, angle in enumerate(HAND_ANGLES) if name in angle]] = out_of_step_s
        begins, ends = late + rule.fingers_begin_s, late + rule.fingers_end_s
        begins[:3], ends[:3] = rule.turn_begin_s, rule.turn_end_s
        return begins, ends

    def _carried(self, points: FloatArray, neck: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return how far the head's motion carries points of the resting head, (T, 3), mm."""
        turns, places = neck
        from_joint = points - self.body.face_skin.origins[-1]
        turned: FloatArray = np.einsum("tij,tj->ti", turns[:, -1], from_joint)
        return places[:, -1] + turned - points

    def _units(self, plan: _Plan, times: FloatArray) -> FloatArray:
        return articulate(plan.phones, times) @ self._unit_matrix + self._unit_drift.at(times)

    def _articulator_matrix(self) -> FloatArray:
        """Return how articulators drive face units, shape (14, U)."""
        habits = self.body.habits
        matrix = np.zeros((len(ARTICULATORS), len(self.body.unit_names)))
        for row, articulator in enumerate(ARTICULATORS):
            for unit in UNITS_OF[articulator]:
                side = 1.0 if unit.endswith("Right") else -1.0 if unit.endswith("Left") else 0.0
                gain = habits.opening * (1.0 + side * habits.asymmetry)
                matrix[row, self.body.unit_names.index(unit)] = gain
        return matrix


def arcs_of(hundredths: NDArray[Any]) -> FloatArray:
    """Return arcs, shape (54, 54, 3), per mm of way, from those of the asset (54, 54, 2)."""
    front = np.full((*hundredths.shape[:2], 1), ARC[2])
    return np.concatenate([hundredths / 100.0, front], axis=2)


def _under_way(
    begins: FloatArray, ends: FloatArray, times: FloatArray, margin: float = 0.0
) -> NDArray[np.int64]:
    """Return which of many spans have to do with increasing times, or lie within a margin."""
    if not len(times):
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero((ends > times[0] - margin) & (begins <= times[-1] + margin))
