from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.movement import FLOWING, Movement
from codec.cuer.voice import Voice
from codec.cues.cueing import cue
from codec.cues.score import Phone, Score
from codec.cues.timeline import TICKS, to_line
from codec.errors import CueError, VoiceError
from codec.superframe.coding import coding_for, derive_coding, load_coding, save_coding
from codec.superframe.merging import join
from codec.superframe.resynthesis import _kernels
from codec.superframe.resynthesis.movements import Movements, movements
from codec.superframe.resynthesis.targets import PARTS, Targets
from codec.superframe.resynthesis.trajectory import (
    Resynthesis,
    TrajectoryProfile,
    held_keys,
    phone_weights,
)
from codec.superframe.score_coding import ScorePart, part_of
from codec.training.coding_tables import train_coding

N_KEYS = 54
WORDS = ["b", "a", "l", "i", "s", "u"]


def parts_of_phones(
    symbols: list[str], start_tick: int = 40, length: int = 6
) -> dict[int, ScorePart]:
    phones = [
        Phone(s, 0.02 * (start_tick + i * length), 0.02 * (start_tick + (i + 1) * length))
        for i, s in enumerate(symbols)
    ]
    line = to_line(Score(tuple(phones), tuple(cue(phones))))
    return {k: part_of(line, k) for k in range(-1, 8)}


def weights_of(moves: Movements, movement: Movement, n_frames: int) -> "np.ndarray":
    still = np.zeros(N_KEYS)
    course = TrajectoryProfile(moves, movement, 0, n_frames)
    return course.moved(held_keys(moves, movement, N_KEYS), (still, still))


def test_movements_follow_the_stated_times() -> None:
    parts = parts_of_phones(WORDS)
    moves = movements(join(parts))
    # Rest, three keys of 12 ticks, rest: paragraphs P1 to P3 by hand.
    assert moves.key.tolist() == [0, 6 * 4 + 1, 6 * 6 + 2, 6 * 3 + 3, 0]
    assert moves.leave[1:].tolist() == [4000 - 2500, 5200 - 900, 6400 - 900, 7600 + 400]
    assert moves.reach[1:].tolist() == [4000 + 180, 5200 + 180, 6400 + 180, 7600 + 400 + 3500]


def test_the_hand_shares_a_silence_between_rest_and_return() -> None:
    phones = [Phone("a", 0.2, 0.4), Phone("a", 1.0, 1.2)]
    line = to_line(Score(tuple(phones), tuple(cue(phones))))
    parts = {k: part_of(line, k) for k in range(3)}
    moves = movements(join(parts))
    # Silence from tick 20 to 50: to rest from 24, back from 35 on.
    assert moves.leave[1:4].tolist() == [1000 - 2500, 2400, 5000 - 1500]
    assert moves.reach[2] == 3500


def test_a_lost_superframe_is_no_silence() -> None:
    parts = parts_of_phones(WORDS * 4, start_tick=10, length=5)
    holed = {k: part for k, part in parts.items() if k != 2}
    keys = movements(join(holed)).key.tolist()
    assert 0 not in keys[1:-1]


def test_weights_are_shares() -> None:
    movement = FLOWING
    parts = parts_of_phones(WORDS, length=9)
    joined = join(parts)
    carrier = weights_of(movements(joined, movement), movement, 200)
    phones = phone_weights(joined.line, 0, 200, 38)
    np.testing.assert_allclose(carrier.sum(axis=1), 1)
    np.testing.assert_allclose(phones.sum(axis=1), 1)
    assert phones.min() >= -1e-12
    assert carrier.min() >= -0.01  # strokes that add up may leave the space between targets
    # At rest before, on the second key in its consonant, at rest long after.
    assert carrier[0, 0] == 1
    assert carrier[60, 6 * 6 + 2] == pytest.approx(1, abs=0.05)
    assert carrier[190, 0] == 1
    assert carrier.shape == (200, N_KEYS)


def test_the_past_does_not_depend_on_the_future() -> None:
    """Frames of a superframe are the same from any window that holds its neighbours."""
    parts = parts_of_phones(WORDS * 3, start_tick=10, length=5)
    table = Targets(
        np.random.default_rng(0).normal(size=(N_KEYS, 12)),
        np.zeros((N_KEYS, 2)),
        np.random.default_rng(1).normal(size=(N_KEYS, 3)),
        np.array([0.1, 0.0, 0.2]),
        np.random.default_rng(2).normal(size=(38, 7)),
        FLOWING,
        30 * np.random.default_rng(3).normal(size=(N_KEYS, 3)),
    )
    whole = Resynthesis(join(parts), table, 0, 5 * TICKS).params()
    for k in range(1, 4):
        near = {i: parts[i] for i in (k - 1, k, k + 1)}
        block = Resynthesis(join(near), table, k * TICKS, TICKS).params()
        np.testing.assert_allclose(block, whole[k * TICKS : (k + 1) * TICKS], atol=1e-3)


def test_silence_is_rest() -> None:
    moves = movements(join({}))
    assert moves.key.tolist() == [0]
    assert weights_of(moves, FLOWING, 3)[:, 0].tolist() == [1, 1, 1]
    assert phone_weights([], 0, 3, 38)[:, 0].tolist() == [1, 1, 1]
    assert PARTS == 100


def test_trained_tables_predict_better_than_derived_ones(toy_voice: Voice) -> None:
    rng = np.random.default_rng(7)
    hidden = derive_coding(toy_voice).targets
    other = Targets(
        hidden.hand + 0.5 * rng.normal(size=hidden.hand.shape),
        hidden.head,
        hidden.forearm + 0.5 * rng.normal(size=hidden.forearm.shape),
        hidden.arc + 0.05,
        hidden.face + 0.3 * rng.normal(size=hidden.face.shape),
    )
    phones = [
        Phone(s, 0.5 + 0.12 * i, 0.62 + 0.12 * i)
        for i, s in enumerate(rng.choice(["b", "a", "l", "i", "s", "u", "e", "g"], 250))
    ]
    score = Score(tuple(phones), tuple(cue(phones)))
    line = to_line(score)
    known = {k: part_of(line, k) for k in range(-1, 50)}
    params = Resynthesis(join(known), other, 0, 48 * TICKS).params()
    params += 0.02 * rng.normal(size=params.shape)
    motion = Motion(params.astype(np.float32), 50, 0.0, toy_voice.layout, toy_voice.identity, score)
    trained = train_coding(toy_voice, [motion])
    errors = [
        np.abs(Resynthesis(join(known), targets, 0, 48 * TICKS).params() - params).mean()
        for targets in (hidden, trained.targets)
    ]
    # Measured: 0.31 and 0.04.
    assert errors[1] < 0.3 * errors[0]


def test_tables_survive_their_file(toy_voice: Voice, tmp_path: Path) -> None:
    coding = coding_for(toy_voice)
    path = tmp_path / "tables.npz"
    save_coding(coding, path)
    again = load_coding(path, toy_voice)
    np.testing.assert_array_equal(again.residual.scales, coding.residual.scales)
    np.testing.assert_allclose(again.residual.matrix, coding.residual.matrix, rtol=1e-6)
    np.testing.assert_allclose(again.targets.hand, coding.targets.hand, rtol=1e-6)


def test_a_movement_survives_the_file_and_counts_for_the_identity(
    toy_voice: Voice, tmp_path: Path
) -> None:
    plain = replace(coding_for(toy_voice), trained=True)
    faster = replace(FLOWING, fastest_m_s=1.0)
    coding = replace(plain, targets=Targets.of(toy_voice, faster))
    assert coding.identity != plain.identity
    path = tmp_path / "tables.npz"
    save_coding(coding, path)
    again = load_coding(path, toy_voice)
    assert again.targets.movement == faster
    assert again.identity == coding.identity
    np.testing.assert_allclose(again.targets.places, coding.targets.places, rtol=1e-6)
    with pytest.raises(CueError, match="constants, not"):
        Movement.from_array(np.zeros(3, dtype=np.float32))
    with pytest.raises(CueError, match="movement: power is nan"):
        replace(FLOWING, power=float("nan"))


def test_tables_of_another_voice_are_refused(toy_voice: Voice, tmp_path: Path) -> None:
    path = tmp_path / "tables.npz"
    save_coding(replace(coding_for(toy_voice), voice="0" * 16), path)
    with pytest.raises(VoiceError, match="coding tables of voice 0000000000000000"):
        load_coding(path, toy_voice)


def test_compiled_loops_are_those_of_python() -> None:
    rng = np.random.default_rng(3)
    sounds = np.array([[1, 3, 9], [0, 9, 12], [20, 12, 60]], dtype=np.int64)
    weights = np.full((2, 40, 38), 0.05)
    _kernels.pull_into(sounds, 5, 22.5, 2.5, 0.6, weights[0])
    _kernels.pull_into.py_func(sounds, 5, 22.5, 2.5, 0.6, weights[1])
    leave = np.array([-9999, 300, 800], dtype=np.int64)
    reach = np.array([-9999, 850, 1400], dtype=np.int64)
    held, distance = rng.normal(size=(3, 4)), np.array([0.0, 1.5, 2.0])
    begins, ends = np.array([0.0, -80.0, 30.0, 0.0]), np.array([0.0, -150.0, 60.0, -40.0])
    out, arc = np.zeros((2, 20, 4)), np.array([0.1, -0.2, 0.0, 0.3])
    for i, which in enumerate(("__call__", "py_func")):
        moved_into = getattr(_kernels.moved_into, which)
        moved_into(leave, reach, 100, 100, begins, ends, 700.0, 0.55, held, distance, arc, out[i])
    for found in (weights, out):
        np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    np.testing.assert_allclose(out[0, [0, -1]], held[[0, 2]])
