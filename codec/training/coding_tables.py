"""Training of a voice's coding tables on motions of its cuer.

Motions with scores go in; targets by least squares on the weights of the resynthesis, and the
bases of what remains, come out.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.coding import Coding
from codec.bitstream.joining import Joined, join
from codec.bitstream.resynthesis.course import Resynthesis, key_weights, phone_weights
from codec.bitstream.resynthesis.movements import movements
from codec.bitstream.resynthesis.targets import Targets
from codec.bitstream.score_coding import ScorePart, part_of
from codec.bitstream.transform import Basis, klt, marker_metric, scales_of
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.timeline import TICKS, to_line
from codec.errors import CueError

Array = NDArray[np.float64]

_PRIOR_FRAMES = 5.0
"""Weight of the voice's gesture table against the frames of a target."""

_LOOSER = 6
"""Quarter octaves by which an underived loose basis expects more than the other one."""

_EVERY = 97
"""The metric is the mean over every so many frames."""


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


def near(parts: dict[int, ScorePart], k: int) -> Joined:
    """Return a superframe's score joined with its neighbours'."""
    return join({i: parts[i] for i in (k - 1, k, k + 1)})


def train_coding(
    voice: Voice, motions: Sequence[Motion], imprecise: Sequence[Motion] = ()
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
    """
    blocks = [blocks_of(motion) for motion in motions]
    parts = [parts_of(motion, len(b)) for motion, b in zip(motions, blocks, strict=True)]
    targets = _targets(voice, blocks, parts)
    frames = np.concatenate([b.reshape(-1, b.shape[-1]) for b in blocks])
    metric = marker_metric(voice, frames[::_EVERY])
    tight = _basis(metric, _lacking(targets, blocks, parts))
    loose = Basis(tight.matrix, tight.scales + _LOOSER)
    if imprecise:
        others = [blocks_of(motion) for motion in imprecise]
        known = [parts_of(motion, len(b)) for motion, b in zip(imprecise, others, strict=True)]
        loose = _basis(metric, _lacking(targets, others, known))
    mean = frames.mean(axis=0)
    plain = _basis(metric, np.concatenate(blocks) - mean)
    return Coding(voice.identity, targets, tight, loose, mean, plain)


def _lacking(
    targets: Targets, blocks: Sequence[Array], parts: Sequence[dict[int, ScorePart]]
) -> Array:
    """Return what resynthesis lacks in each superframe, shape (N, 32, P)."""
    return np.concatenate([
        block - Resynthesis(near(known, k), targets, k * TICKS, TICKS).params()[None]
        for b, known in zip(blocks, parts, strict=True)
        for k, block in enumerate(np.split(b, len(b)))
    ])  # fmt: skip


def _basis(metric: Array, blocks: Array) -> Basis:
    flat = blocks.reshape(-1, blocks.shape[-1])
    matrix = klt(metric, flat.T @ flat / len(flat))
    any_order = Basis(matrix, np.zeros(blocks.shape[:0:-1], dtype=np.int64))
    squares = np.zeros(blocks[0].size)
    for block in blocks:
        squares[any_order.order] += np.square(any_order.forward(block))
    return Basis(matrix, scales_of((squares / len(blocks)).reshape(-1, TICKS)))


def _targets(
    voice: Voice, blocks: Sequence[Array], parts: Sequence[dict[int, ScorePart]]
) -> Targets:
    prior = Targets.of(voice.gestures)
    groups = np.cumsum([7, prior.hand.shape[1], prior.head.shape[1]])
    rows = []
    for block, known in zip(blocks, parts, strict=True):
        joined = join(known)
        n_frames = block.shape[0] * TICKS
        keys = key_weights(movements(joined), 0, n_frames)
        faces = [phone_weights(joined.line, k * TICKS, TICKS) for k in range(len(block))]
        rows.append((keys, np.concatenate(faces), np.split(block.reshape(n_frames, -1), groups, 1)))
    fingers = np.concatenate([keys.fingers for keys, _, _ in rows])
    carrier = np.concatenate([keys.carrier for keys, _, _ in rows])
    phones = np.concatenate([weights for _, weights, _ in rows])
    face, hand, head, forearm = (np.concatenate([r[2][i] for r in rows]) for i in range(4))
    straight = _solve(carrier, forearm, prior.forearm)
    ends = np.concatenate([keys.ends for keys, _, _ in rows])
    bend = np.concatenate([keys.bend for keys, _, _ in rows])
    bend = bend * np.linalg.norm(straight[ends[:, 1]] - straight[ends[:, 0]], axis=1)
    both = _solve(
        np.column_stack([carrier, bend]), forearm, np.vstack([straight, np.zeros(len(prior.arc))])
    )
    return Targets(
        _solve(fingers, hand, prior.hand), _solve(carrier, head, prior.head),
        both[:-1], both[-1], _solve(phones, face, prior.face),
    )  # fmt: skip


def _solve(weights: Array, values: Array, prior: Array) -> Array:
    """Return the targets that explain `values` best, drawn to `prior` where data are few."""
    square = weights.T @ weights + _PRIOR_FRAMES * np.eye(weights.shape[1])
    return np.asarray(np.linalg.solve(square, weights.T @ values + _PRIOR_FRAMES * prior))
