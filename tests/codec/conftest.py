"""Fixtures of the models' tests: a toy cuer and a voice fitted to it once."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from codec.cuer.voice import Voice
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
def toy_voice(toy: ModuleType) -> Voice:
    training = toy.training_set(seed=1, frames=1500)
    return fit_voice("toy", hand=training, face=training, joint=training)
