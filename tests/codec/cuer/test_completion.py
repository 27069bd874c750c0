from types import ModuleType

import numpy as np
import pytest

from codec.cuer import layout
from codec.cuer.models.completion import (
    COMPLETED_COLUMNS,
    CONFIDENCE,
    HandCompletion,
    fit_completion,
    recover_hand,
)
from codec.cuer.models.inversion import invert_hand
from codec.cuer.voice import Voice
from codec.errors import CueError

RATE_HZ = 120.0
FAR = [layout.HAND_MARKERS.index(name) for name in ("F22", "F23", "F2T", "S2")]


def hand(toy: ModuleType, seed: int, frames: int) -> np.ndarray:
    return np.asarray(toy.cuer_markers(seed, frames)[:, layout.N_FACE :], dtype=float)


@pytest.fixture(scope="module")
def completion(toy: ModuleType) -> HandCompletion:
    frames = np.concatenate([hand(toy, seed, 700) for seed in range(20, 23)])
    gaps = np.random.default_rng(0).random(frames.shape[:2]) < 0.02
    return fit_completion(np.where(gaps[..., None], np.nan, frames))


def hidden_finger(toy: ModuleType) -> tuple[np.ndarray, np.ndarray]:
    truth = hand(toy, 8, 240)
    visible = np.ones(truth.shape[:2], dtype=bool)
    visible[40:200, FAR] = False
    return truth, visible


def test_a_finger_that_stays_hidden_is_expected_from_its_root(
    toy: ModuleType, toy_voice: Voice, completion: HandCompletion
) -> None:
    truth, visible = hidden_finger(toy)
    world = np.where(visible[..., None], truth, 0.0)
    completed, confidence = completion.complete(world, visible, rate_hz=RATE_HZ)
    off = np.linalg.norm(completed - truth, axis=-1)
    np.testing.assert_array_equal(off[visible], 0.0)
    assert (confidence[~visible] == CONFIDENCE).all()
    alone = invert_hand(toy_voice.hand, world, visible)
    by_model = np.linalg.norm(toy_voice.hand.reconstruct(alone) - truth, axis=-1)
    # The toy's fingers bend at random, each on its own: measured 2.8 against 4.6 mm.
    assert off[~visible].mean() < 0.75 * by_model[~visible].mean()
    assert off[~visible].mean() < 3.5


def test_parameters_follow_the_completed_markers(
    toy: ModuleType, toy_voice: Voice, completion: HandCompletion
) -> None:
    truth, visible = hidden_finger(toy)
    world = np.where(visible[..., None], truth, 0.0)
    found, recovered = recover_hand(toy_voice.hand, completion, world, visible, rate_hz=RATE_HZ)
    alone = toy_voice.hand.reconstruct(invert_hand(toy_voice.hand, world, visible))
    together = toy_voice.hand.reconstruct(found)
    errors = [np.linalg.norm(m - truth, axis=-1)[~visible].mean() for m in (alone, together)]
    assert errors[1] < 0.7 * errors[0]
    assert np.isfinite(recovered).all()


def test_hidden_markers_hardly_jump(
    toy: ModuleType, completion: HandCompletion, monkeypatch: pytest.MonkeyPatch
) -> None:
    truth, visible = hidden_finger(toy)
    world = np.where(visible[..., None], truth, 0.0)

    def jump() -> float:
        off = completion.complete(world, visible, rate_hz=RATE_HZ)[0] - truth
        return float(np.linalg.norm(off[[40, 199]][:, FAR], axis=-1).mean())

    blended = jump()
    monkeypatch.setattr("codec.cuer.models.completion.blend", lambda steps, *_, **__: np.zeros(3))
    assert blended < 0.85 * jump()  # measured 0.77


def test_swapped_neighbours_are_not_believed(toy: ModuleType, completion: HandCompletion) -> None:
    truth = hand(toy, 9, 120)
    observed = truth.copy()
    one, other = (layout.HAND_MARKERS.index(name) for name in ("F23", "F33"))
    observed[50:60, [one, other]] = observed[50:60, [other, one]]
    far = np.linalg.norm(observed - truth, axis=-1)[50:60, one] > 20.0
    assert far.any()
    visible = np.ones(truth.shape[:2], dtype=bool)
    completed, confidence = completion.complete(observed, visible, rate_hz=RATE_HZ)
    wrong = np.linalg.norm(completed - truth, axis=-1)[50:60][far][:, [one, other]]
    assert wrong.mean() < 0.4 * np.linalg.norm(observed - truth, axis=-1)[50:60][far].max()
    assert (confidence[:45] == 1).mean() > 0.99


def test_without_the_palm_nothing_is_completed(
    toy: ModuleType, toy_voice: Voice, completion: HandCompletion
) -> None:
    truth = hand(toy, 10, 60)
    visible = np.ones(truth.shape[:2], dtype=bool)
    visible[20:24] = False
    _, confidence = completion.complete(
        np.where(visible[..., None], truth, 0.0), visible, rate_hz=RATE_HZ
    )
    assert (confidence[20:24] == 0).all()
    np.testing.assert_array_equal(confidence[:20], 1.0)
    _, recovered = recover_hand(
        toy_voice.hand,
        completion,
        np.where(visible[..., None], truth, 0.0),
        visible,
        rate_hz=RATE_HZ,
    )
    assert np.linalg.norm(recovered - truth, axis=-1)[20:24].mean() < 25.0


@pytest.mark.parametrize("rate_hz", [1.0, 25.0, 120.0, 240.0])
def test_any_rate_and_length(toy: ModuleType, completion: HandCompletion, rate_hz: float) -> None:
    for frames in (1, 2, 9):
        truth = hand(toy, 11, frames)
        visible = np.ones(truth.shape[:2], dtype=bool)
        visible[:, FAR] = False
        completed, _ = completion.complete(truth, visible, rate_hz=rate_hz)
        assert np.isfinite(completed).all()


def test_wrist_and_forearm_stay_as_they_are() -> None:
    names = {layout.HAND_MARKERS[k] for k in COMPLETED_COLUMNS}
    assert names.isdisjoint({*layout.WRIST, *layout.FOREARM})
    assert len(names) == 34


def test_a_hand_without_palm_is_refused(toy: ModuleType) -> None:
    frames = hand(toy, 12, 300)
    frames[:, layout.HAND_MARKERS.index("P3")] = np.nan
    with pytest.raises(CueError, match="0 frames show the whole palm, 200 needed"):
        fit_completion(frames)
