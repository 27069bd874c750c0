"""Small programmes, made once for all tests of the applications."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cuecast.media.film import write_film

FS = 48000


def tone(seconds: float, channels: int = 2, fs: int = FS) -> NDArray[np.float32]:
    """A harmonic sound with noise, different in each channel."""
    rng = np.random.default_rng(1)
    t = np.arange(round(seconds * fs)) / fs
    base = 0.2 * np.sin(2 * np.pi * 220 * t) + 0.1 * np.sin(2 * np.pi * 1760 * t)
    noise = 0.02 * rng.standard_normal((len(t), channels))
    return (base[:, None] + noise).astype(np.float32)


def pictures(seconds: float, rate: int = 25) -> list[NDArray[np.uint8]]:
    """A bar that moves over a ramp."""
    ramp = np.add.outer(np.arange(48), np.arange(64)).astype(np.uint8)
    frames = []
    for n in range(round(seconds * rate)):
        frame = np.repeat(ramp[:, :, None], 3, axis=2)
        frame[:, n % 60 : n % 60 + 4] = 255
        frames.append(frame)
    return frames


@pytest.fixture
def hangups_end() -> Iterator[None]:
    """Let started processes notice a terminal that closes, also where tests run under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="session")
def make_film(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str, int], Path]:
    """Give films of four seconds by container, sound codec and bit rate; each is made once."""
    folder = tmp_path_factory.mktemp("films")
    made: dict[tuple[str, str, int], Path] = {}

    def make(suffix: str, encoder: str, bit_rate: int) -> Path:
        key = (suffix, encoder, bit_rate)
        if key not in made:
            made[key] = folder / f"film-{len(made)}{suffix}"
            write_film(
                made[key], tone(4), FS, encoder=encoder, bit_rate=bit_rate, pictures=pictures(4)
            )
        return made[key]

    return make
