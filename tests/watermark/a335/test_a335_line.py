"""The ATSC A/335 line and its messages: exact values, the frame recorded off air, refusals."""

import contextlib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from codec.errors import BitstreamError, CueError
from tests.watermark.a335.assembling import MessageAssembler
from tests.watermark.lines import grey, one, payload_of, source, vectors
from watermark.a335.carrier import A335Embedder, read_blocks
from watermark.a335.line import (
    RUN_IN,
    SYSTEM_1X,
    SYSTEM_2X,
    LineSystem,
    line_candidates,
    line_values,
    system_1x,
)
from watermark.a335.messages import (
    EXTENDED_VP1,
    USER_PRIVATE_LONG,
    USER_PRIVATE_SHORT,
    VP1,
    Block,
    body_capacity,
    checksum,
    fragments,
    pack_private,
    parse_blocks,
    parse_private,
)
from watermark.a335.profile import DOMAIN
from watermark.a335.vp1 import parse_vp1


def plain(line: ArrayLike, depth: int = 8) -> tuple[LineSystem, bytes] | None:
    """Read a line as it stands, without symbols changed."""
    return next(line_candidates(line, depth=depth, doubtful=0), None)


@pytest.mark.parametrize("case", vectors("A/335 5.1"), ids=lambda c: c["id"])
def test_line_vectors(case: dict[str, Any]) -> None:
    system = {"1X": SYSTEM_1X, "2X": SYSTEM_2X}[case["system"]]
    bits = case["bits"].ljust(system.payload_bytes * 8, "0")
    payload = int(bits, 2).to_bytes(system.payload_bytes)
    line = line_values(payload, case["width"], system=system, depth=case["depth"])
    for pixel, value in case["pixels"].items():
        assert line[int(pixel)] == value


@pytest.mark.parametrize("system", [SYSTEM_1X, SYSTEM_2X], ids=["1X", "2X"])
@pytest.mark.parametrize("width", [480, 720, 1280, 1366, 1440, 1920, 3840])
@pytest.mark.parametrize("depth", [8, 10, 12])
def test_line_round_trip(system: Any, width: int, depth: int) -> None:
    payload = payload_of(system)
    found = plain(line_values(payload, width, system=system, depth=depth), depth=depth)
    assert found is not None
    assert (found[0].name, found[1]) == (system.name, payload)


def test_levels_where_symbols_fill_pixels() -> None:
    line = line_values(RUN_IN, 1920, system=SYSTEM_2X)
    assert line[::8][:8].tolist() == [235, 162, 162, 235, 89, 89, 16, 162]
    assert set(line_values(payload_of(SYSTEM_1X), 720, system=system_1x(16, 100))) == {16, 100}


def test_noisy_and_low_contrast_lines_are_read() -> None:
    payload = payload_of(SYSTEM_1X)
    line = line_values(payload, 1280, system=system_1x(4, 20))
    noise = np.random.default_rng(3).normal(0, 3, line.size)
    assert plain(line + noise) == (SYSTEM_1X, payload)


def test_doubtful_symbols_are_tried() -> None:
    marked = one(A335Embedder(1280, 8, 25, source("1x")), grey())
    expected = read_blocks(marked)
    for symbols in ([100, 200], [3, 30]):  # one of them in the run-in
        damaged = marked.copy()
        for symbol in symbols:
            pixels = slice(symbol * 16 // 3, (symbol + 1) * 16 // 3 + 1)
            damaged[:2, pixels] = np.where(marked[0, symbol * 16 // 3 + 2] > 22, 20, 24)
        assert plain(damaged[0]) != plain(marked[0])
        assert read_blocks(damaged) == expected


def test_no_run_in_is_a_result() -> None:
    assert plain(np.full(1280, 16)) is None
    assert plain(np.arange(100)) is None
    assert plain(np.random.default_rng(0).integers(0, 255, 1280)) is None


def test_line_refusals() -> None:
    with pytest.raises(CueError, match="payload of 31 bytes, limit 30"):
        line_values(bytes(31), 1280)
    with pytest.raises(CueError, match="width 240: the line needs at least 480"):
        line_values(RUN_IN, 240)
    with pytest.raises(CueError, match=r"levels 4 and 15: 4\.\.16 and 20\.\.100"):
        system_1x(4, 15)
    with pytest.raises(CueError, match="luma of 9 bits"):
        line_values(RUN_IN, 1280, depth=9)


# --- messages ---


def test_off_air_frame() -> None:
    (case,) = vectors("A/336 5.2")
    payload = bytes.fromhex(case["payload"])
    (block,) = parse_blocks(payload)
    assert block.message_id == EXTENDED_VP1
    assert (block.version, block.fragment, block.last_fragment) == (9, 0, 0)
    assert block.convention == "ieee"
    assert RUN_IN + block.pack() == payload
    found = parse_vp1(block)
    assert found is not None
    assert found.corrected_bits == 0
    assert (found.large_domain, found.server, found.interval) == (True, 705, 840)
    assert not found.query
    assert found.time_offset == 0x8A


def test_off_air_frame_with_wrong_bits_in_the_packet() -> None:
    (case,) = vectors("A/336 5.2")
    (block,) = parse_blocks(bytes.fromhex(case["payload"]))
    body = bytearray(block.body)
    body[7] ^= 0xFF
    body[12] ^= 0x1F
    damaged = Block(block.message_id, 9, 0, 0, bytes(body))
    found = parse_vp1(damaged)
    assert found is not None
    assert (found.server, found.corrected_bits) == (705, 13)
    body[13] ^= 0xFF
    assert parse_vp1(Block(block.message_id, 9, 0, 0, bytes(body))) is None


def test_capacities() -> None:
    sizes = [
        body_capacity(system, message_id)
        for system in (SYSTEM_1X, SYSTEM_2X)
        for message_id in (USER_PRIVATE_SHORT, USER_PRIVATE_LONG)
    ]
    assert sizes == [21, 19, 51, 49]


@pytest.mark.parametrize("convention", ["ieee", "mpeg"])
def test_both_checksums(convention: Any) -> None:
    block = Block(0x7F, 5, 1, 2, b"body", None, convention)
    assert parse_blocks(RUN_IN + block.pack()) == [block]
    # The MPEG-2 convention leaves a remainder of zero over block and checksum.
    if convention == "mpeg":
        assert checksum(block.pack(), "mpeg") == 0


def test_several_blocks_and_padding() -> None:
    blocks = [Block(3, 1, 0, 0, b"a"), Block(0xFF, 2, 7, 200, b"bc")]
    payload = RUN_IN + b"".join(b.pack() for b in blocks) + bytes(5)
    assert parse_blocks(payload) == blocks


def test_damaged_block_ends_the_reading() -> None:
    good, bad = Block(3, 1, 0, 0, b"a").pack(), bytearray(Block(4, 1, 0, 0, b"b").pack())
    bad[4] ^= 1
    assert len(parse_blocks(RUN_IN + good + bytes(bad))) == 1
    assert parse_blocks(RUN_IN + b"\x03\xff") == []
    with pytest.raises(BitstreamError, match="run-in 0000"):
        parse_blocks(bytes(30))


@given(st.binary(min_size=28, max_size=58))
def test_any_bytes_parse(data: bytes) -> None:
    parse_blocks(RUN_IN + data)


@given(st.binary(min_size=1, max_size=300), st.sampled_from([0x7F, 0xFF]), st.integers(4, 60))
def test_fragments_round_trip(message: bytes, message_id: int, size: int) -> None:
    if message_id == USER_PRIVATE_SHORT and len(message) > 4 * size - 4:
        with pytest.raises(CueError, match="limit 3"):
            fragments(message_id, message, version=3, size=size)
        return
    if len(message) > size * 256 - 4:
        return
    blocks = fragments(message_id, message, version=3, size=size)
    assembler = MessageAssembler()
    found = []
    for block in blocks:
        assert len(block.body) + (4 if block.message_check is not None else 0) <= size
        assert parse_blocks(RUN_IN + block.pack()) == [block]
        found.append(assembler.add(block))
    assert found[:-1] == [None] * (len(blocks) - 1)
    assert found[-1] == (message_id, message)
    assert [assembler.add(b) for b in blocks][-1] is None  # the same version again


def test_mixed_forms_do_not_disturb_each_other() -> None:
    long, short = (fragments(i, bytes(30), version=1, size=12) for i in (0xFF, 0x7F))
    assembler = MessageAssembler()
    found = [assembler.add(b) for pair in zip(long, short, strict=True) for b in pair]
    assert [f[0] for f in found if f] == [0xFF, 0x7F]


def test_message_checksum_is_checked() -> None:
    blocks = fragments(0xFF, bytes(30), version=1, size=12)
    assembler = MessageAssembler()
    assembler.add(Block(0xFF, 1, 0, 2, b"x" * 12))
    assert [assembler.add(b) for b in blocks[1:]] == [None, None]


@given(
    st.binary(min_size=1, max_size=256), st.sampled_from([USER_PRIVATE_SHORT, USER_PRIVATE_LONG])
)
def test_private_round_trip(payload: bytes, message_id: int) -> None:
    message = pack_private(DOMAIN, payload, message_id=message_id)
    assert parse_private(message, message_id=message_id) == (DOMAIN, payload)


@given(st.binary(max_size=30))
def test_private_of_any_bytes(data: bytes) -> None:
    with contextlib.suppress(BitstreamError):
        domain, payload = parse_private(data)
        assert len(domain) + len(payload) < len(data)


def test_message_refusals() -> None:
    with pytest.raises(CueError, match="message identifier 0"):
        Block(0, 0, 0, 0, b"")
    with pytest.raises(CueError, match="fragment 4 of 4, limit 3"):
        Block(0x7F, 0, 4, 4, b"")
    with pytest.raises(CueError, match="domain of 11 and payload of 0"):
        pack_private(DOMAIN, b"")
    with pytest.raises(BitstreamError, match="is no VP1 message"):
        parse_vp1(Block(3, 0, 0, 0, b""))
    with pytest.raises(BitstreamError, match="VP1 message of 2 bytes: must be 20"):
        parse_vp1(Block(VP1, 0, 0, 0, b"ab"))
