from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cuer import layout
from codec.cuer.models.inversion import _banded, bridge, invert_hand, linked
from codec.cuer.voice import Voice

RATE_HZ = 120.0


def hand(toy: ModuleType, frames: int) -> np.ndarray:
    return np.asarray(toy.cuer_markers(8, frames, noise_mm=0.0)[:, layout.N_FACE :], dtype=float)


def test_a_moment_without_any_marker_is_bridged(toy: ModuleType, toy_voice: Voice) -> None:
    truth, model = hand(toy, 120), toy_voice.hand
    seen = np.ones(truth.shape[:2], dtype=bool)
    seen[50:54] = False
    alone = invert_hand(model, np.where(seen[..., None], truth, 0.0), seen)
    bridged = bridge(model, truth, seen, alone, rate_hz=RATE_HZ)
    errors = [
        np.linalg.norm(model.reconstruct(p)[50:54] - truth[50:54], axis=-1).mean()
        for p in (alone, bridged)
    ]
    assert errors[1] < 0.4 * errors[0]  # measured 0.2


def test_nothing_changes_when_everything_is_seen(toy: ModuleType, toy_voice: Voice) -> None:
    truth, model = hand(toy, 20), toy_voice.hand
    seen = np.ones(truth.shape[:2], dtype=bool)
    found = invert_hand(model, truth, seen)
    assert bridge(model, truth, seen, found, rate_hz=RATE_HZ) is found


def test_linked_frames_err_less_and_do_not_jump(toy: ModuleType, toy_voice: Voice) -> None:
    truth, model = hand(toy, 120), toy_voice.hand
    noisy = truth + np.random.default_rng(7).normal(0.0, 3.0, truth.shape)
    seen = np.ones(truth.shape[:2], dtype=bool)
    alone = invert_hand(model, noisy, seen)
    shown = [
        model.reconstruct(p).astype(float)
        for p in (alone, linked(model, noisy, seen, alone, rate_hz=RATE_HZ))
    ]
    errors = [np.linalg.norm(x - truth, axis=-1).mean() for x in shown]
    jumps = [np.linalg.norm(np.diff(x - truth, n=2, axis=0), axis=-1).mean() for x in shown]
    assert errors[1] < 0.95 * errors[0]  # measured 0.92
    assert jumps[1] < 0.5 * jumps[0]  # measured 0.36


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_short_recordings(toy: ModuleType, toy_voice: Voice, frames: int) -> None:
    truth, model = hand(toy, frames), toy_voice.hand
    seen = np.ones(truth.shape[:2], dtype=bool)
    seen[:, 3] = False
    found = invert_hand(model, truth, seen)
    bridged = bridge(model, truth, seen, found, rate_hz=RATE_HZ)
    np.testing.assert_allclose(bridged, found, atol=0.5)


@given(st.integers(1, 6), st.integers(1, 4), st.integers(0, 1000))
def test_banded_form_equals_the_dense_matrix(frames: int, n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = rng.normal(size=(frames, n, n))
    blocks = blocks + np.swapaxes(blocks, 1, 2)
    differences = np.diff(np.eye(frames), n=2, axis=0)
    dense = 7.0 * np.kron(differences.T @ differences, np.eye(n))
    for t in range(frames):
        dense[t * n : t * n + n, t * n : t * n + n] += blocks[t]
    banded = _banded(blocks, 7.0)
    for offset in range(min(len(banded), frames * n)):
        np.testing.assert_allclose(
            banded[offset, : frames * n - offset], np.diagonal(dense, -offset), atol=1e-9
        )
