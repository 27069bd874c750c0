"""Training of a voice's coding tables on motions of its cuer.

Motions with scores go in; targets by least squares on the weights of the resynthesis, and the
bases of what remains, come out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.movement import FLOWING, Movement
from codec.cuer.voice import Voice
from codec.cues.timeline import TICKS, to_line
from codec.errors import CueError
from codec.superframe.coding import Coding, basis_of_any
from codec.superframe.merging import MergedScore, join
from codec.superframe.resynthesis.movements import Movements, movements
from codec.superframe.resynthesis.targets import Targets
from codec.superframe.resynthesis.trajectory import (
    Resynthesis,
    TrajectoryProfile,
    held_keys,
    phone_weights,
)
from codec.superframe.score_coding import ScorePart, part_of
from codec.superframe.transform import Basis, klt, marker_metric, scales_of

Array = NDArray[np.float64]

_PRIOR_FRAMES = 5.0
"""Weight of the voice's gesture table against the frames of a target."""

_LOOSER = 6
"""Quarter octaves that an underived loose basis expects above the other one."""

_GREAT = 16
"""Channels of most motion, over which the spectrum of filmed motion is the mean."""

_EVERY = 97
"""Stride in frames of the mean that is the metric."""


def blocks_of(motion: Motion) -> Array:
    """Return a motion at 50 Hz from time 0 as whole superframes, shape (N, 32, P)."""
    if motion.rate_hz != 50 or motion.start_s != 0:
        raise CueError(f"training needs 50 Hz from 0 s, not {motion.rate_hz} Hz, {motion.start_s}")
    count = len(motion.params) // TICKS
    params = motion.params[: count * TICKS].astype(np.float64)
    return params.reshape(count, TICKS, -1)


def parts_of(motion: Motion, count: int) -> dict[int, ScorePart]:
    """Return the score of a motion as parts of superframes -1 to `count`."""
    line = to_line(motion.score)
    return {k: part_of(line, k) for k in range(-1, count + 1)}


def near(parts: dict[int, ScorePart], k: int) -> MergedScore:
    """Return a superframe's score joined with its neighbours'."""
    return join({i: parts[i] for i in (k - 1, k, k + 1)})


def train_coding(
    voice: Voice,
    motions: Sequence[Motion],
    imprecise: Sequence[Motion] = (),
    others: Sequence[Motion] = (),
    *,
    movement: Movement = FLOWING,
) -> Coding:
    """Return coding tables of a voice.

    Parameters
    ----------
    voice : Voice
    motions : sequence of Motion
        Of this voice, with scores, at 50 Hz from time 0.
    imprecise : sequence of Motion
        The same by a cuer who keeps less well to scores, for the loose basis; without any, it is
        derived from the other one.
    others : sequence of Motion
        Of other cuers, at the pace of real ones, as the voice explains them, for the basis of
        filmed motion; without any, the motions serve.
    movement : Movement
        How the voice's hand moves.
    """
    blocks = [blocks_of(motion) for motion in motions]
    parts = [parts_of(motion, len(b)) for motion, b in zip(motions, blocks, strict=True)]
    targets = _targets(voice, blocks, parts, movement)
    frames = np.concatenate([b.reshape(-1, b.shape[-1]) for b in blocks])
    metric = marker_metric(voice, frames[::_EVERY])
    tight = _basis(metric, _lacking(targets, blocks, parts))
    loose = Basis(tight.matrix, tight.scales + _LOOSER)
    if imprecise:
        worse = [blocks_of(motion) for motion in imprecise]
        known = [parts_of(motion, len(b)) for motion, b in zip(imprecise, worse, strict=True)]
        loose = _basis(metric, _lacking(targets, worse, known))
    mean = frames.mean(axis=0)
    plain = _basis(metric, np.concatenate(blocks) - mean)
    filmed = _filmed(metric, np.concatenate([blocks_of(m) for m in others or motions]) - mean)
    return Coding(voice.identity, targets, tight, loose, mean, plain, filmed)


def _filmed(metric: Array, blocks: Array) -> Basis:
    """Return the basis of motion of cuers of whom little is known but these examples."""
    flat = blocks.reshape(-1, blocks.shape[-1])
    own = _basis(metric, blocks)
    power = 2.0 ** (own.scales[:_GREAT] / 2)
    spectrum = np.exp(np.log(power / power.sum(axis=1, keepdims=True)).mean(axis=0))
    return basis_of_any(metric, np.asarray(np.cov(flat.T)), spectrum)


def _lacking(
    targets: Targets, blocks: Sequence[Array], parts: Sequence[dict[int, ScorePart]]
) -> Array:
    """Return what resynthesis lacks in each superframe, shape (N, 32, P)."""
    return np.concatenate(
        [
            block - Resynthesis(near(known, k), targets, k * TICKS, TICKS).params()[None]
            for b, known in zip(blocks, parts, strict=True)
            for k, block in enumerate(np.split(b, len(b)))
        ]
    )


def _basis(metric: Array, blocks: Array) -> Basis:
    flat = blocks.reshape(-1, blocks.shape[-1])
    matrix = klt(metric, flat.T @ flat / len(flat))
    any_order = Basis(matrix, np.zeros(blocks.shape[:0:-1], dtype=np.int64))
    squares = np.zeros(blocks[0].size)
    for block in blocks:
        squares[any_order.order] += np.square(any_order.forward(block))
    return Basis(matrix, scales_of((squares / len(blocks)).reshape(-1, TICKS)))


def _targets(
    voice: Voice, blocks: Sequence[Array], parts: Sequence[dict[int, ScorePart]], movement: Movement
) -> Targets:
    prior = Targets.of(voice, movement)
    widths = [prior.hand.shape[1], prior.head.shape[1], prior.forearm.shape[1]]
    groups = np.cumsum([7, *widths[:2]])
    rows = []
    for block, known in zip(blocks, parts, strict=True):
        n_frames = block.shape[0] * TICKS
        joined = join(known)
        faces = [
            phone_weights(joined.line, k * TICKS, TICKS, len(prior.face)) for k in range(len(block))
        ]
        values = np.split(block.reshape(n_frames, -1), groups, 1)
        rows.append((_Linear.of(prior, joined, n_frames), np.concatenate(faces), values))
    phones = np.concatenate([weights for _, weights, _ in rows])
    face, hand, head, forearm = (np.concatenate([r[2][i] for r in rows]) for i in range(4))
    fingers, turned, carrier = (
        np.concatenate([linear.weights(i) for linear, _, _ in rows]) for i in range(3)
    )
    # Targets without the arc first: the arc stands across the straight ways between them.
    straight = _solve(carrier, forearm, prior.forearm)
    bend = np.concatenate([linear.bend(straight) for linear, _, _ in rows])
    both = _solve(
        np.column_stack([carrier, bend]), forearm, np.vstack([straight, np.zeros(len(prior.arc))])
    )
    return replace(
        prior,
        hand=_solve(fingers, hand, prior.hand),
        head=_solve(turned, head, prior.head),
        forearm=both[:-1],
        arc=both[-1],
        face=_solve(phones, face, prior.face),
    )


@dataclass(frozen=True, slots=True)
class _Linear:
    """The linear part of the hand's prediction over some frames: shares of the keys' targets.

    `late` has the lateness of hand, head and forearm, each of one channel.
    """

    moves: Movements
    course: TrajectoryProfile
    held: Array
    late: list[tuple[float, float]]

    @classmethod
    def of(cls, targets: Targets, joined: MergedScore, n_frames: int) -> "_Linear":
        moves = movements(joined, targets.movement, targets.places)
        width = np.cumsum([0, targets.hand.shape[1], targets.head.shape[1]])
        late = [(float(targets.lateness[0][i]), float(targets.lateness[1][i])) for i in width]
        course = TrajectoryProfile(moves, targets.movement, 0, n_frames)
        return cls(moves, course, held_keys(moves, targets.movement, len(targets.hand)), late)

    def weights(self, group: int) -> Array:
        """Return the shares of the keys in hand (0), head (1) or forearm (2), shape (T, 54)."""
        late = tuple(np.full(self.held.shape[1], x) for x in self.late[group])
        return self.course.moved(self.held, (late[0], late[1]))

    def bend(self, targets: Array) -> Array:
        """Return the bend of strokes between forearm targets (54, C) per unit of arc, (T,)."""
        ends = targets[self.moves.key]
        distance = np.zeros(len(ends))
        distance[1:] = np.linalg.norm(np.diff(ends, axis=0), axis=1)
        late = (np.full(1, self.late[2][0]), np.full(1, self.late[2][1]))
        still = np.zeros((len(ends), 1))
        return self.course.moved(still, late, distance=distance, arc=np.ones(1))[:, 0]


def _solve(weights: Array, values: Array, prior: Array) -> Array:
    """Return the targets that explain `values` best, drawn to `prior` where data are few."""
    square = weights.T @ weights + _PRIOR_FRAMES * np.eye(weights.shape[1])
    return np.asarray(np.linalg.solve(square, weights.T @ values + _PRIOR_FRAMES * prior))
