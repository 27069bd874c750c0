import numpy as np
import pytest

from codec.errors import CueError
from watermark import _kernels
from watermark.tape import Tape, impulse_responses


def sine(positions: np.ndarray, period: float) -> np.ndarray:
    return np.asarray(np.sin(2 * np.pi * positions / period))


@pytest.mark.parametrize("ratio", [1.0, 1.0001, 44100 / 48000, 48000 / 44100, 4.0])
def test_reads_a_sine_at_any_position_and_speed(ratio: float) -> None:
    tape = Tape()
    tape.append(sine(np.arange(4000.0), 9.7))
    positions = 1000.3 + ratio * np.arange(400)
    error = tape.read(1000.3, ratio, 400) - sine(positions, 9.7)
    assert np.abs(error).max() < 1e-3  # measured: 8e-5 and less


def test_knows_its_limits() -> None:
    tape = Tape()
    tape.append(np.ones(100))
    tape.forget(40)
    assert (tape.first, tape.end) == (40, 100)
    assert tape.read(38.0, 1.0, 4).tolist() == [0.0, 0.0, 1.0, 1.0]
    with pytest.raises(CueError, match=r"^resampling ratio 0 is not within 0..64$"):
        tape.read(0.0, 0, 1)


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(0)
    x, table = rng.standard_normal(300), impulse_responses(0.5)
    for kernel in (_kernels.interpolate, getattr(_kernels.interpolate, "py_func", None)):
        out = np.empty(5)
        assert kernel is not None
        kernel(x, 90.2, 1.7, table, out)
        if kernel is _kernels.interpolate:
            expected = out
    np.testing.assert_allclose(out, expected, rtol=0, atol=1e-12)


def test_pilot_scores_kernel() -> None:
    rng = np.random.default_rng(1)
    soft = rng.standard_normal((3, 60)).astype(np.float32)
    drift = np.array([[0, 0, 0, 0], [0, 0, 1, 1]])
    group = rng.integers(0, 3, 4)
    sign = rng.choice([-1.0, 1.0], 4).astype(np.float32)
    compiled, plain = np.ones((2, 7), dtype=np.float32), np.ones((2, 7), dtype=np.float32)
    _kernels.pilot_scores(soft, 2, 10, drift, group, sign, compiled)
    python = getattr(_kernels.pilot_scores, "py_func", _kernels.pilot_scores)
    python(soft, 2, 10, drift, group, sign, plain)
    np.testing.assert_allclose(compiled, plain, rtol=1e-6)
    rows = 2 + np.arange(7) + 10 * np.arange(4)[:, np.newaxis] + drift[1][:, np.newaxis]
    direct = 1 + (sign[:, np.newaxis] * soft[group[:, np.newaxis], rows]).sum(axis=0)
    np.testing.assert_allclose(compiled[1], direct, rtol=1e-5)
