import constriction
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.errors import CueError
from codec.superframe import _kernels
from codec.superframe.range_coder import (
    FLIP,
    TOTAL,
    RangeDecoder,
    RangeEncoder,
    code_length,
    cumulative,
    encode_intervals,
)

WEIGHTS = st.lists(st.floats(0, 1e3), min_size=2, max_size=40).filter(lambda w: sum(w) > 0)


@given(WEIGHTS)
def test_table_keeps_every_symbol_and_sums_to_the_total(weights: list[float]) -> None:
    table = cumulative(weights)
    assert table[0] == 0
    assert table[-1] == TOTAL
    assert (np.diff(table) >= 1).all()


@given(WEIGHTS, st.data())
def test_round_trip_and_length(weights: list[float], data: st.DataObject) -> None:
    table = cumulative(weights)
    symbols = data.draw(st.lists(st.integers(0, len(weights) - 1), max_size=200))
    encoder = RangeEncoder()
    for symbol in symbols:
        encoder.put(symbol, table)
    code = encoder.finish()
    assert 8 * len(code) < encoder.bits * 1.0005 + 8
    decoder = RangeDecoder(code)
    assert [decoder.get(table) for _ in symbols] == symbols


@given(WEIGHTS, st.data(), st.binary(max_size=6))
def test_certain_code_decodes_alike_before_anything(
    weights: list[float], data: st.DataObject, tail: bytes
) -> None:
    table = cumulative(weights)
    symbols = data.draw(st.lists(st.integers(0, len(weights) - 1), max_size=60))
    encoder = RangeEncoder()
    for symbol in symbols:
        encoder.put(symbol, table)
    code = encoder.finish(certain=True)
    assert 8 * len(code) < encoder.bits * 1.0005 + 16
    decoder = RangeDecoder(code + tail)
    assert [decoder.get(table) for _ in symbols] == symbols


@given(WEIGHTS, st.data())
def test_limit_lumps_the_symbols_from_it_on(weights: list[float], data: st.DataObject) -> None:
    table = cumulative(weights)
    limit = data.draw(st.integers(0, len(weights) - 1))
    symbols = data.draw(st.lists(st.integers(0, limit), max_size=50))
    encoder = RangeEncoder()
    for symbol in symbols:
        encoder.put(symbol, table, limit)
    decoder = RangeDecoder(encoder.finish())
    assert [decoder.get(table, limit) for _ in symbols] == symbols


def test_overhead_is_below_one_percent_on_long_lines() -> None:
    rng = np.random.default_rng(1)
    table = cumulative(rng.random(30) ** 3)
    symbols = rng.choice(30, size=5000, p=np.diff(table) / TOTAL)
    encoder = RangeEncoder()
    for symbol in symbols:
        encoder.put(int(symbol), table)
    # Measured: 0.03 % on 5000 symbols.
    assert 8 * len(encoder.finish()) < 1.001 * encoder.bits + 8


def test_constriction_needs_as_many_bits() -> None:
    """An independent range coder with the same probabilities: it ends on words of 32 bits."""
    rng = np.random.default_rng(2)
    table = cumulative(rng.random(12) ** 2)
    probabilities = np.diff(table) / TOTAL
    symbols = rng.choice(12, size=2000, p=probabilities).astype(np.int32)
    encoder = RangeEncoder()
    for symbol in symbols:
        encoder.put(int(symbol), table)
    other = constriction.stream.queue.RangeEncoder()
    model = constriction.stream.model.Categorical(probabilities, perfect=True)
    other.encode(symbols, model)
    ours, theirs = len(encoder.finish()), 4 * len(other.get_compressed())
    assert ours <= theirs
    assert theirs - ours <= 8


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(3)
    table = cumulative(rng.random(9) ** 4)
    symbols = rng.choice(9, size=300, p=np.diff(table) / TOTAL)
    starts, freqs = table[symbols], np.diff(table)[symbols]
    for certain in (False, True):
        compiled, plain = np.zeros(900, np.uint8), np.zeros(900, np.uint8)
        n = _kernels.range_encode(starts, freqs, 300, certain, compiled)
        assert n == _kernels.range_encode.py_func(starts, freqs, 300, certain, plain)
        np.testing.assert_array_equal(compiled, plain)


def test_carry_runs_through_bytes_of_ones() -> None:
    # The upper of two halves after many sure symbols: low is at 0xFF... and carries.
    table = cumulative([1, TOTAL - 2, 1])
    for symbols in ([1] * 40 + [2], [2] * 40, [0] * 40, [2] * 20 + [0] * 20):
        encoder = RangeEncoder()
        for symbol in symbols:
            encoder.put(symbol, table)
        decoder = RangeDecoder(encoder.finish())
        assert [decoder.get(table) for _ in symbols] == symbols


def test_bits_cost_one_bit_each() -> None:
    encoder = RangeEncoder()
    encoder.put_bits(0b1011001, 7)
    assert encoder.bits == 7
    assert RangeDecoder(encoder.finish()).get_bits(7) == 0b1011001


def test_nothing_is_coded_in_nothing() -> None:
    assert RangeEncoder().finish() == b""
    none = np.zeros(0, dtype=np.int64)
    assert encode_intervals(none, none) == b""
    assert code_length(none) == 0


def test_errors() -> None:
    with pytest.raises(CueError, match=r"symbol 2 is not within 0\.\.1"):
        RangeEncoder().put(2, FLIP)
    with pytest.raises(CueError, match="a table of 0 weights"):
        cumulative([])


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7])
def test_weights_of_zero_are_equally_likely(size: int) -> None:
    parts = np.diff(cumulative([0.0] * size))
    assert parts.sum() == TOTAL
    assert parts.max() - parts.min() <= TOTAL % size
