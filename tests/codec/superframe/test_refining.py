"""Refining: the error that a viewer sees, and coefficients of less of it within the same bytes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.timeline import SUPERFRAME_S, TICKS
from codec.superframe import _kernels
from codec.superframe.analysis import block_at
from codec.superframe.coding import coding_for
from codec.superframe.decoder import SuperframeDecoder, blended
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.quantise import Setting, dequantise, quantise_rd, raised, width_mm
from codec.superframe.refining import REACH, Neighbour, SeenError, metrics_of, refined
from codec.superframe.superframe import Superframe
from codec.superframe.tables import coefficient_tables
from tests.codec.speech import SENTENCE, spoken

COUNT = 9


@pytest.fixture(scope="module")
def motion(toy_voice: Voice, perform: Callable[..., Motion]) -> Motion:
    return perform(spoken(SENTENCE, length_s=0.16), COUNT)


def superframes(voice: Voice, motion: Motion, order: list[int]) -> dict[int, Superframe]:
    encoder = SuperframeEncoder(
        voice, l0_bytes=20, l1_bytes=7, protected=True, filmed=True, begin=0
    )
    return {k: encoder.encode(motion, k) for k in order}


def neighbours(voice: Voice, size: int, seed: int) -> list[Neighbour]:
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(3):
        meant = rng.normal(0, 0.5, (TICKS, size)).cumsum(0) * 0.1
        drawn = meant + rng.normal(0, 0.02, meant.shape)
        found.append(Neighbour(meant, drawn, metrics_of(voice, meant)))
    return found


def test_metrics_weigh_changes_as_markers_do(toy_voice: Voice) -> None:
    rng = np.random.default_rng(1)
    poses = rng.normal(0, 0.3, (3, len(toy_voice.layout)))
    moved = rng.normal(0, 1e-3, poses.shape)
    gap = toy_voice.reconstruct(poses + moved).astype(float) - toy_voice.reconstruct(poses)
    told = np.einsum("tp,tpq,tq->t", moved, metrics_of(toy_voice, poses), moved)
    np.testing.assert_allclose(told, np.square(gap).sum((1, 2)), rtol=0.02)


@pytest.mark.parametrize("sides", [(True, True), (True, False), (False, True), (False, False)])
def test_the_error_is_that_of_blended_superframes(
    toy_voice: Voice, sides: tuple[bool, bool]
) -> None:
    before, own, after = neighbours(toy_voice, len(toy_voice.layout), 2)
    left, right = before if sides[0] else None, after if sides[1] else None
    around = (None if side is None else side.drawn for side in (left, right))
    shown = blended(own.drawn, *around)
    rows = [(own.meant - shown, own.metrics)]
    if left:
        shown = blended(left.drawn, None, own.drawn)
        rows.append(((left.meant - shown)[-REACH:], left.metrics[-REACH:]))
    if right:
        shown = blended(right.drawn, own.drawn, None)
        rows.append(((right.meant - shown)[:REACH], right.metrics[:REACH]))
    expected = sum(float(np.einsum("tp,tpq,tq->", gap, metric, gap)) for gap, metric in rows)
    assert SeenError(own, left, right).of(own.drawn) == pytest.approx(expected)


def test_refined_coefficients_fit_and_err_less(toy_voice: Voice) -> None:
    before, own, after = neighbours(toy_voice, len(toy_voice.layout), 3)
    coding, tables, setting = coding_for(toy_voice), coefficient_tables(), Setting(12, 3)
    basis = coding.bases[setting.basis]
    q = quantise_rd(basis.forward(own.meant - coding.mean), setting, basis, tables)
    error = SeenError(own, before, after)
    bits = _kernels.coefficient_cost(
        q, raised(basis, setting), basis.before, setting.step, tables.cost
    )
    predicted = np.tile(coding.mean, (TICKS, 1))
    found = refined(error, predicted, setting, q, coding.bases, bits)
    assert found[0].error < error.of(
        predicted + basis.backward(dequantise(q, setting, basis, tables))
    )
    for one in found:
        scales = raised(basis, one.setting)
        told = _kernels.coefficient_cost(one.q, scales, basis.before, one.setting.step, tables.cost)
        assert told <= bits + 1.0
        drawn = predicted + basis.backward(dequantise(one.q, one.setting, basis, tables))
        assert error.of(drawn) == pytest.approx(one.error)


def test_the_descent_agrees_with_its_python(toy_voice: Voice) -> None:
    rng = np.random.default_rng(4)
    basis, tables = coding_for(toy_voice).bases[2], coefficient_tables()
    setting, channels = Setting(20, 2), len(basis.matrix)
    q = rng.integers(-2, 3, basis.scan_scales.size)
    waves = rng.normal(size=(TICKS, TICKS))
    half = rng.normal(size=(TICKS, channels, 4))
    metric = half @ half.transpose(0, 2, 1)
    slopes = rng.normal(0, 50, (TICKS, channels))
    made = []
    for function in (_kernels.descend, _kernels.descend.py_func):
        own, left = q.copy(), slopes.copy()
        changed = function(
            own, raised(basis, setting), (basis.before, basis.after), setting.step,
            width_mm(setting.step), 300.0, tables.cost, tables.inset,
            (basis.order // TICKS, basis.order % TICKS), waves, left, metric,
            np.full(q.size, 40.0),
        )  # fmt: skip
        made.append((changed, own, left))
    assert made[0][0] == made[1][0] > 0
    np.testing.assert_array_equal(made[0][1], made[1][1])
    np.testing.assert_allclose(made[0][2], made[1][2])


def test_who_counts_a_coefficient(toy_voice: Voice) -> None:
    basis = coding_for(toy_voice).bases[0]
    counted = {(i, int(j)) for i, row in enumerate(basis.before) for j in row if j >= 0}
    counting = {(int(j), i) for i, row in enumerate(basis.after) for j in row if j >= 0}
    assert counted == counting


def test_superframes_do_not_depend_on_order_or_on_what_lies_far_off(
    toy_voice: Voice, motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    turns = 3
    monkeypatch.setattr("codec.superframe.filmed_encoder.TURNS", turns)
    forwards = superframes(toy_voice, motion, list(range(COUNT)))
    assert superframes(toy_voice, motion, [5, 2, 7]) == {k: forwards[k] for k in (5, 2, 7)}
    first = 4 - turns
    window = replace(
        motion,
        start_s=first * SUPERFRAME_S,
        params=motion.params[first * TICKS : (4 + turns + 1) * TICKS],
    )
    assert superframes(toy_voice, window, [4])[4] == forwards[4]
    # A second window, of which most is known.
    encoder = SuperframeEncoder(
        toy_voice, l0_bytes=20, l1_bytes=7, protected=True, filmed=True, begin=0
    )
    assert encoder.encode(motion, 3) == forwards[3]
    assert encoder.encode(window, 4) == forwards[4]


@pytest.mark.parametrize("hours", [0, 7])
def test_windows_of_a_motion_hold_the_same_frames(motion: Motion, hours: int) -> None:
    start, params = hours * 5625, motion.params
    for first in range(COUNT):
        begin = (start + first) * SUPERFRAME_S
        window = replace(motion, start_s=begin, params=params[first * TICKS :])
        for k in range(first, COUNT - 1):
            frames = params[k * TICKS : (k + 1) * TICKS]
            np.testing.assert_array_equal(block_at(window, start + k), frames)


def test_refining_makes_superframes_better(
    toy_voice: Voice, motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    def left(frames: dict[int, Superframe]) -> float:
        decoder, squares = SuperframeDecoder(toy_voice), 0.0
        for k in range(COUNT):
            decoder.take(frames[k].l0, frames[k].l1, k)
        for k in range(COUNT):
            meant = toy_voice.reconstruct(block_at(motion, k)).astype(float)
            gap = meant - toy_voice.reconstruct(decoder.render(k).params)
            squares += float(np.square(gap).sum())
        return squares

    every = list(range(COUNT))
    found = superframes(toy_voice, motion, every)
    monkeypatch.setattr("codec.superframe.filmed_encoder.TURNS", 0)
    plain = superframes(toy_voice, motion, every)
    assert all((len(f.l0), len(f.l1)) == (20, 7) for f in found.values())
    assert left(found) < 0.97 * left(plain)
