"""The codec against the plain decoder that was written from the specification."""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.errors import BitstreamError
from codec.superframe import _kernels
from codec.superframe.bits import COMPACT, crc8, crc16, identity_bits, read_header
from codec.superframe.checks import is_compact, is_own, is_possible, proof_of, with_check
from codec.superframe.payload import read_l0, read_l1
from codec.superframe.quantise import NO_RESIDUAL, dequantise_integers, step_width
from codec.superframe.range_coder import RangeDecoder
from codec.superframe.score_coding import REST_GAPS_S, ScorePart
from codec.superframe.tables import coefficient_tables
from codec.superframe.transform import Bases, Basis
from codec.superframe.window import Window
from spec.reference import superframe as reference
from spec.reference.range_decoder import RangeDecoder as ReferenceDecoder

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
CHANNELS = 6
DECAY = np.arange(32)


IDENTITY = "9c3a5b17f0e2d468"


def four(top: int) -> Bases:
    """Return four bases, no two alike."""
    return tuple(
        Basis(np.eye(CHANNELS), np.roll(basis(top + 2 * k).scales, k, axis=0)) for k in range(4)
    )


def basis(top: int) -> Basis:
    """A small basis with scales from `top` downwards, ties among them."""
    scales = top - 6 * np.arange(CHANNELS)[:, None] - (3 * np.log2(1 + DECAY) * 2).astype(int)
    return Basis(np.eye(CHANNELS), scales.astype(np.int64))


def as_reference(part: ScorePart | Window | None) -> dict[str, Any] | None:
    if part is None:
        return None
    cheek = [part.options.un, part.options.schwa, part.options.oe]
    if isinstance(part, Window):
        return {
            "begin": part.begin,
            "end": part.end,
            "numbers": list(part.numbers),
            "starts": list(part.starts),
            "cheek": [int(name == "cheek") for name in cheek],
            "rest_gap": REST_GAPS_S.index(part.options.rest_gap_s),
        }
    return {
        "first": part.first,
        "first_end": part.first_end,
        "numbers": list(part.numbers),
        "starts": list(part.starts),
        "ahead": part.ahead,
        "cheek": [int(name == "cheek") for name in cheek],
        "rest_gap": REST_GAPS_S.index(part.options.rest_gap_s),
        "overrides": {str(k): list(v) for k, v in part.overrides.items()},
    }


def broken_rule(l0: bytes, bases: Bases) -> str:
    try:
        reference.decode(l0, None, [basis.scales.tolist() for basis in bases], IDENTITY)
    except reference.MalformedError as error:
        return str(error)
    return ""


def setting_of(decoded: reference.Decoded) -> list[int]:
    return [
        decoded.step,
        decoded.basis,
        decoded.level,
        decoded.course,
        decoded.shift,
        *decoded.shares,
    ]


def header_of(decoded: reference.Decoded) -> list[int]:
    return [decoded.mode, decoded.sequence, decoded.lead, decoded.signed, decoded.proof]


def refusal(l0: bytes) -> str:
    """Return the paragraph by which the codec refuses a part."""
    if not is_possible(l0):
        return "H1"
    if not is_own(l0, IDENTITY):
        return "M2" if is_compact(l0) else "H6"
    try:
        read_header(l0)
    except BitstreamError as error:
        return error.section
    return ""


def decode_both(l0: bytes, l1: bytes, bases: Bases) -> None:
    """Compare everything that both decoders say about two parts."""
    broken = broken_rule(l0, bases)
    assert refusal(l0) == broken
    if broken:
        return
    expected = reference.decode(l0, l1, [basis.scales.tolist() for basis in bases], IDENTITY)
    content, known = read_l0(l0, bases)
    with contextlib.suppress(BitstreamError):
        content = read_l1(l0, l1, content, known, bases)
    header, setting = content.header, content.setting
    proof = proof_of(l0)
    found = [header.mode, header.sequence, header.lead, header.signed, proof[0] if proof else 0]
    assert found == header_of(expected)
    assert list(content.slow) == expected.slow
    told = [setting.step, setting.basis, setting.level, setting.course, setting.shift]
    assert [*told, *setting.shares] == setting_of(expected)
    assert {
        str(distance): [list(item) for item in preview]
        for distance, preview in content.previews.items()
    } == expected.previews
    assert header.filmed == expected.filmed or header.mode == COMPACT
    assert (None if header.filmed else as_reference(content.part)) == expected.score
    assert content.q.tolist() == expected.indices
    if content.setting.step != NO_RESIDUAL:
        used = bases[setting.basis]
        values = dequantise_integers(content.q, content.setting, used, coefficient_tables())
        assert values.tolist() == expected.values


def with_checks(body: bytes, more: bytes) -> tuple[bytes, bytes]:
    """Give arbitrary bytes a valid version and valid checks, or the length of a compact part."""
    body = bytes([body[0] & 0x3F]) + body[1:]
    if body[0] & 0x20:
        compact = bytearray((body + bytes(4))[: max(4, len(body) % 13)])
        shift = 2 if compact[0] & 0x10 else 0
        told = identity_bits(IDENTITY, compact[0] & 15)
        compact[-1] = compact[-1] & ~(3 << shift) | told << shift
        return bytes(compact), more
    l0 = with_check(body, IDENTITY)
    return l0, more + bytes([crc8(l0[-2:] + more)])


@settings(max_examples=300)
@given(st.binary(min_size=3, max_size=60), st.binary(max_size=60), st.integers(0, 60))
def test_any_bytes_say_the_same_to_both(body: bytes, more: bytes, top: int) -> None:
    decode_both(*with_checks(body, more), four(top))


@given(st.binary(max_size=12), st.binary(max_size=4))
def test_raw_bytes_are_refused_by_the_same_rule(l0: bytes, l1: bytes) -> None:
    decode_both(l0, l1, four(40))


def fuzzed(rng: np.random.Generator, parts: Sequence[bytes]) -> list[bytes]:
    """Change, cut off or append a few bytes of valid parts."""
    changed = []
    for part in parts:
        data = bytearray(part)
        for _ in range(int(rng.integers(0, 4))):
            kind, at = int(rng.integers(0, 8)), int(rng.integers(0, len(data) + 1))
            if kind == 0:
                del data[at:]
            elif kind == 1:
                data[at:at] = rng.bytes(int(rng.integers(1, 6)))
            elif at < len(data):
                data[at] ^= 1 << int(rng.integers(0, 8))
        changed.append(bytes(data))
    return changed


@pytest.mark.slow
def test_ten_thousand_random_and_fuzzed_superframes() -> None:
    """Kernels, the same as plain Python, and the reference: all the same, errors too."""
    rng = np.random.default_rng(20)
    cases = json.loads((VECTORS / "superframe.json").read_text(encoding="utf-8"))["cases"]
    valid = [(bytes.fromhex(c["l0"]), bytes.fromhex(c["l1"])) for c in cases if c["valid"]]
    for number in range(10_000):
        body, more = rng.bytes(int(rng.integers(3, 60))), rng.bytes(int(rng.integers(0, 60)))
        if number % 2:
            l0, l1 = valid[int(rng.integers(len(valid)))]
            compact = l0[0] & 0x20
            body, more = fuzzed(rng, (l0 if compact else l0[:-2], l1[:-1]))
            body = body.ljust(3, b"\0")
        parts, used = with_checks(body, more), four(int(rng.integers(0, 60)))
        decode_both(*parts, used)
        with pytest.MonkeyPatch.context() as patch:
            for name in ("start_decoding", "decode_symbol", "decode_coefficients", "dequantise"):
                patch.setattr(_kernels, name, getattr(_kernels, name).py_func)
            decode_both(*parts, used)


@pytest.mark.vectors("superframe")
def test_vectors(case: dict[str, Any]) -> None:
    document = json.loads((VECTORS / "superframe.json").read_text(encoding="utf-8"))
    assert document["identity"] == IDENTITY
    scales = document["bases"]
    l0, l1 = bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"])
    used = tuple(Basis(np.eye(len(s)), np.array(s, dtype=np.int64)) for s in scales)
    decode_both(l0, l1, used)
    assert broken_rule(l0, used) == ("" if case["valid"] else case["section"])
    if case["valid"]:
        assert said(reference.decode(l0, l1, scales, IDENTITY)) == {
            name: case[name]
            for name in ("header", "slow", "setting", "previews", "score", "indices", "values")
        }


def said(found: reference.Decoded) -> dict[str, Any]:
    """Return what a vector states of a superframe."""
    return {
        "header": header_of(found),
        "slow": found.slow,
        "setting": setting_of(found),
        "previews": found.previews,
        "score": found.score,
        "indices": {str(i): q for i, q in enumerate(found.indices) if q},
        "values": {str(i): v for i, v in enumerate(found.values) if v},
    }


@pytest.mark.vectors("checks")
def test_checks(case: dict[str, Any]) -> None:
    data = bytes.fromhex(case["data"])
    assert {16: crc16, 8: crc8}[case["width"]](data) == case["check"]


@pytest.mark.vectors("range_decoder")
def test_range_decoders(case: dict[str, Any]) -> None:
    data, freqs = bytes.fromhex(case["data"]), case["freqs"]
    plain = ReferenceDecoder(data)
    assert [plain.symbol(freqs)[0] for _ in case["symbols"]] == case["symbols"]
    fast, ends = RangeDecoder(data), np.array([0, *np.cumsum(freqs)], dtype=np.int64)
    assert [fast.get(ends) for _ in case["symbols"]] == case["symbols"]


@pytest.mark.vectors("steps")
def test_steps(case: dict[str, Any]) -> None:
    assert step_width(case["step"]) == case["width"]
    assert reference.WIDTHS[case["step"] % 4] << case["step"] // 4 == case["width"]
