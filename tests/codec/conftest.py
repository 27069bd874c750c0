"""Fixtures of the models' tests: a toy cuer and a voice fitted to it once."""

import fcntl
import importlib.util
import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice, save_voice
from codec.cues.score import Score
from codec.cues.timeline import TICKS
from codec.superframe.coding import coding_for
from codec.superframe.superframe import resynthesis_of
from codec.training.coding_tables import near, parts_of
from codec.training.fit import fit_voice


@pytest.fixture(scope="session")
def toy() -> ModuleType:
    """The module tests/codec/toy_cuer.py: test folders are no packages."""
    path = Path(__file__).with_name("toy_cuer.py")
    spec = importlib.util.spec_from_file_location("toy_cuer", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def toy_voice(toy: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Voice:
    """The voice of the toy cuer: the first worker that needs it fits it for all of them."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    path = folder / "toy.npz"
    with (folder / "toy.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            training = toy.training_set(seed=1, frames=1500)
            save_voice(fit_voice("toy", hand=training, face=training, joint=training), path)
    return load_voice(path)


@pytest.fixture(scope="session")
def perform(toy_voice: Voice) -> Callable[[Score, int], Motion]:
    """Return a motion near the prediction of a score: with smooth deviations."""

    def make(score: Score, superframes: int, seed: int = 0) -> Motion:
        motion = Motion(
            np.zeros((superframes * TICKS, len(toy_voice.layout)), np.float32),
            50,
            0.0,
            toy_voice.layout,
            toy_voice.identity,
            score,
        )
        parts = parts_of(motion, superframes)
        params = [
            resynthesis_of(coding_for(toy_voice), near(parts, k), k).params()
            for k in range(superframes)
        ]
        rng = np.random.default_rng(seed)
        drift = np.cumsum(rng.normal(0, 0.03, (superframes * TICKS, params[0].shape[1])), axis=0)
        moved = (np.concatenate(params) + drift - drift.mean(axis=0)).astype(np.float32)
        return Motion(moved, 50, 0.0, motion.layout, motion.voice, score)

    return make
