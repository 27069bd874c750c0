"""Transform, quantiser and coefficient coding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.superframe import _kernels
from codec.superframe.coding import coding_for
from codec.superframe.payload import coefficient_code
from codec.superframe.quantise import Setting, dequantise, quantise_rd, raised, step_width, width_mm
from codec.superframe.range_coder import FLIP, RangeDecoder, code_length, encode_intervals
from codec.superframe.tables import CLASSES, CONTEXTS, coefficient_tables
from codec.superframe.transform import Basis, marker_metric

SMALL = Basis(np.eye(3), np.add.outer([40, 30, 20], -np.arange(32)).astype(np.int64))
PYTHON = {
    name: getattr(_kernels, name).py_func
    for name in ("encode_coefficients", "decode_coefficients", "dequantise", "quantise_rd")
}


def cost_bits(q: NDArray[np.int64], setting: Setting) -> float:
    """Return the ideal length that the quantiser counts with."""
    return float(
        _kernels.coefficient_cost(
            q, raised(SMALL, setting), SMALL.before, setting.step, coefficient_tables().cost
        )
    )


def test_transform_inverts_and_measures_markers(toy_voice: Voice) -> None:
    basis = coding_for(toy_voice).residual
    rng = np.random.default_rng(0)
    block = 0.001 * rng.normal(size=(32, len(toy_voice.layout)))
    coefficients = basis.forward(block)
    np.testing.assert_allclose(basis.backward(coefficients), block, atol=1e-9)
    pose = np.zeros((1, len(toy_voice.layout)))
    metric = marker_metric(toy_voice, pose)
    moved = toy_voice.reconstruct(pose + block).astype(float)
    squares = np.square(moved - toy_voice.reconstruct(pose)).sum(axis=(1, 2))
    np.testing.assert_allclose(
        np.einsum("tp,pq,tq->t", block, metric, block), squares, rtol=0.05, atol=1e-3
    )


def test_scan_goes_from_great_to_small() -> None:
    assert (np.diff(SMALL.scan_scales) <= 0).all()
    assert sorted(SMALL.order.tolist()) == list(range(96))
    for i, row in enumerate(SMALL.before):
        assert (row < i).all()


@given(st.integers(0, 62), st.integers(0, 2**31))
def test_coefficients_round_trip(step: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scale = 2.0 ** (SMALL.scan_scales / 4)
    values = rng.standard_t(2, size=96) * scale
    q = quantise_rd(values, Setting(step), SMALL, coefficient_tables())
    starts, freqs, _ = coefficient_code(q, 0, Setting(step), SMALL)
    assert code_length(freqs) == pytest.approx(cost_bits(q, Setting(step)), abs=1e-6)
    data = encode_intervals(starts, freqs, certain=True)
    found = np.zeros_like(q)
    for decode in (_kernels.decode_coefficients, PYTHON["decode_coefficients"]):
        decoder = RangeDecoder(data)
        found[:] = 0
        decode(
            decoder.data, decoder.state, found, 0, SMALL.scan_scales, SMALL.before, step,
            coefficient_tables().magnitude, FLIP,
        )  # fmt: skip
        np.testing.assert_array_equal(found, q)
    width = width_mm(step)
    coded = np.array([_kernels.coefficient_class(s, step)[0] >= 0 for s in SMALL.scan_scales])
    error = np.abs(dequantise(q, Setting(step), SMALL, coefficient_tables()) - values)
    assert (error[coded] <= np.maximum(2.5 * width, 0.01 * np.abs(values[coded]))).all()


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(1)
    tables = coefficient_tables()
    values = rng.laplace(size=96) * 2.0 ** (SMALL.scan_scales / 4)
    for step in (0, 9, 20, 33):
        width = step_width(step)
        q = [np.zeros(96, np.int64), np.zeros(96, np.int64)]
        for out, kernel in zip(q, (_kernels.quantise_rd, PYTHON["quantise_rd"]), strict=True):
            kernel(values, SMALL.scan_scales, SMALL.before, step, width / 65536, 0.16,
                   tables.cost, tables.inset, out)  # fmt: skip
        np.testing.assert_array_equal(q[0], q[1])
        back = [np.zeros(96, np.int64), np.zeros(96, np.int64)]
        for out, kernel in zip(back, (_kernels.dequantise, PYTHON["dequantise"]), strict=True):
            kernel(q[0], SMALL.scan_scales, step, width, tables.inset, out)
        np.testing.assert_array_equal(back[0], back[1])
        codes = []
        for kernel in (_kernels.encode_coefficients, PYTHON["encode_coefficients"]):
            starts, freqs = np.zeros(4000, np.int64), np.zeros(4000, np.int64)
            ends = np.zeros(96, np.int64)
            n = kernel(q[0], 0, SMALL.scan_scales, SMALL.before, step, tables.magnitude,
                       starts, freqs, ends)  # fmt: skip
            codes.append((n, starts.tolist(), freqs.tolist(), ends.tolist()))
        assert codes[0] == codes[1]


def test_weighing_bits_saves_them() -> None:
    rng = np.random.default_rng(2)
    values = rng.laplace(size=96) * 2.0 ** (SMALL.scan_scales / 4)
    tables, at = coefficient_tables(), Setting(20)
    bits = [
        cost_bits(quantise_rd(values, at, SMALL, tables, weight=w), at) for w in (0.0, 0.1, 0.3)
    ]
    assert bits == sorted(bits, reverse=True)


def test_classes_lie_within_the_tables() -> None:
    for scale in range(-40, 90):
        for step in range(63):
            kind, shift = _kernels.coefficient_class(scale, step)
            assert kind < CLASSES
            assert (shift == 0) == (kind < 0 or scale - step + 16 <= 24)
    assert coefficient_tables().magnitude.shape == (CLASSES, CONTEXTS, 17)
