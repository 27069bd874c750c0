"""The carrier in the A/335 line: its codes, round trips, losses, other services in the line."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.errors import CueError
from tests.watermark.a335.assembling import MessageAssembler
from tests.watermark.lines import grey, one, source, vectors
from watermark.a335 import bch
from watermark.a335.carrier import A335Embedder, A335Receiver, frame_rate, is_foreign, read_blocks
from watermark.a335.erasure import decode_parts, encode_part
from watermark.a335.framing import join_long, long_blocks, long_grid, pack_block
from watermark.a335.line import SYSTEM_1X, line_values
from watermark.a335.messages import USER_PRIVATE_LONG, parse_private
from watermark.a335.profile import DOMAIN, PROFILES

# --- codes ---


@settings(max_examples=30)
@given(st.integers(0, 2**50 - 1), st.sets(st.integers(0, 126), max_size=13))
def test_bch_corrects_thirteen(value: int, wrong: set[int]) -> None:
    payload = [int(b) for b in f"{value:050b}"]
    word = bch.encode(payload)
    word[list(wrong)] ^= 1
    found = bch.decode(word)
    assert found is not None
    assert (found[0].tolist(), found[1]) == (payload, len(wrong))


def test_bch_refuses_lengths() -> None:
    with pytest.raises(CueError, match="payload of shape"):
        bch.encode([0])
    with pytest.raises(CueError, match="word of shape"):
        bch.decode([0])


@settings(max_examples=30)
@given(st.data(), st.integers(1, 20), st.integers(1, 5))
def test_any_k_parts_are_enough(data: st.DataObject, k: int, size: int) -> None:
    block = np.random.default_rng(k).integers(0, 256, (k, size)).astype(np.uint8)
    chosen = data.draw(st.sets(st.integers(0, 255), min_size=k, max_size=k))
    parts = {p: encode_part(block, p) for p in chosen}
    decoded = decode_parts(parts, k)
    assert decoded is not None
    np.testing.assert_array_equal(decoded, block)
    assert decode_parts(dict(list(parts.items())[1:]), k) is None


def test_part_out_of_range() -> None:
    with pytest.raises(CueError, match="part 256"):
        encode_part(np.zeros((1, 1), dtype=np.uint8), 256)


@pytest.mark.parametrize("count", [15, 16, 20, 32])
def test_long_message_survives_as_many_losses_as_its_grid_says(count: int) -> None:
    profile = PROFILES["1x-high"]
    l0, l1 = source("1x-high")(1)
    block = pack_block(l0, l1, profile)
    blocks = long_blocks(block, profile, count=count, version=0, domain=DOMAIN, convention="ieee")
    parity = long_grid(profile, count, DOMAIN).parity
    assert parity >= 1
    kept = {b.fragment: b.body for b in blocks[parity:]}
    assert join_long(kept, profile, count=count, domain=DOMAIN) == (l0, l1)
    kept.pop(count - 2)
    assert join_long(kept, profile, count=count, domain=DOMAIN) is None
    assembler = MessageAssembler()  # whole, it is an ordinary A/336 message
    found = [assembler.add(b) for b in blocks][-1]
    assert found is not None
    assert parse_private(found[1], message_id=USER_PRIVATE_LONG)[0] == DOMAIN


@pytest.mark.parametrize(("fps", "lost"), [(25, [1]), (50, [])])
def test_lost_frame_of_a_shared_message(fps: int, lost: list[int]) -> None:
    """At 25 frames a second a superframe is there once, at 50 twice."""
    give = source("1x-max")
    embedder = A335Embedder(1280, 8, fps, give, profile="1x-max")
    receiver = A335Receiver(1280, 8, fps)
    found = []
    for n in range(8 * fps):
        marked = one(embedder, grey())
        found += receiver.process(grey() if n == fps else marked)
    numbers = [round(s.position_s / 0.64) for s in found]
    assert numbers == [k for k in range(12) if k not in lost]
    assert [(s.l0, s.l1) for s in found] == [give(k) for k in numbers]


def test_shared_message_is_an_ordinary_one_and_can_be_entered_anywhere() -> None:
    give = source("1x-max")
    embedder = A335Embedder(1280, 8, 25, give, profile="1x-max")
    frames = [one(embedder, grey()) for _ in range(64)]
    receiver, assembler = A335Receiver(1280, 8, 25), MessageAssembler()
    found = [s for frame in frames[17:] for s in receiver.process(frame)]
    assert [s.l0 for s in found] == [give(k)[0] for k in (2, 3)]
    assert found[0].position_s == pytest.approx(2 * 0.64 - 17 / 25, abs=0.05)
    whole = [assembler.add(block) for frame in frames for _, block in read_blocks(frame)][-1]
    assert whole is not None
    assert parse_private(whole[1], message_id=USER_PRIVATE_LONG)[0] == DOMAIN
    with pytest.raises(CueError, match="62 frames hold no 4 superframes of 299 bytes"):
        A335Embedder(1280, 8, 24, give, profile="1x-max")


# --- the carrier ---


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("fps", [25, 50, Fraction(30000, 1001)])
def test_carrier_round_trip(name: str, fps: Any) -> None:
    give = source(name)
    embedder = A335Embedder(1280, 8, fps, give, profile=name)
    receiver = A335Receiver(1280, 8, fps)
    found = []
    for _ in range(int(3.2 * fps)):
        frame = grey()
        marked = one(embedder, frame)
        assert (frame == 120).all()
        assert (marked[2:] == 120).all()
        assert (marked[0] == marked[1]).all()
        found += receiver.process(marked)
    assert len(found) >= 4
    for k, superframe in enumerate(found):
        assert (superframe.l0, superframe.l1) == give(k)
        assert superframe.position_s == pytest.approx(0.64 * k, abs=1.01 / fps)
    assert receiver.locked
    assert embedder.flush() == []
    assert receiver.first_lock_s is not None
    assert receiver.first_lock_s <= 0.7


@pytest.mark.parametrize("name", ["1x", "2x"])
def test_lost_frames_and_tuning_in(name: str) -> None:
    give = source(name)
    embedder = A335Embedder(1280, 8, 25, give, profile=name)
    receiver = A335Receiver(1280, 8, 25)
    rng = np.random.default_rng(2)
    found = []
    for n in range(160):
        marked = one(embedder, grey())
        if n >= 5:
            found += receiver.process(grey() if rng.random() < 0.2 else marked)
    assert len(found) >= 9
    assert [(f.l0, f.l1) for f in found] == [give(k) for k in range(10 - len(found), 10)]
    assert found[-1].position_s == pytest.approx(9 * 0.64 - 0.2)


def test_frame_rate_conversion_repeats_frames() -> None:
    give = source("1x")
    embedder = A335Embedder(1280, 8, 25, give)
    receiver = A335Receiver(1280, 8, 50)
    found = []
    for _ in range(64):
        marked = one(embedder, grey())
        found += receiver.process(marked) + receiver.process(marked)
    assert [(f.l0, f.l1) for f in found] == [give(k) for k in range(4)]


def test_ten_bits() -> None:
    give = source("2x")
    embedder = A335Embedder(1920, 6, 25, give, profile="2x", depth=10)
    receiver = A335Receiver(1920, 6, 25, depth=10)
    frame = np.full((6, 1920), 500, dtype=np.uint16)
    found = [s for _ in range(16) for s in receiver.process(one(embedder, frame))]
    assert (found[0].l0, found[0].l1) == give(0)
    assert one(embedder, frame).dtype == np.uint16


def test_another_service_keeps_its_line() -> None:
    (case,) = vectors("A/336 5.2")
    occupied = grey()
    occupied[:2] = line_values(bytes.fromhex(case["payload"]), 1280)
    assert is_foreign(occupied, DOMAIN)
    give = source("1x")
    embedder = A335Embedder(1280, 8, 25, give)
    receiver = A335Receiver(1280, 8, 25)
    found = []
    for n in range(32):
        frame = occupied if n % 5 == 0 else grey()
        marked = one(embedder, frame)
        if n % 5 == 0:
            np.testing.assert_array_equal(marked, occupied)
        found += receiver.process(marked)
    assert embedder.skipped == 7
    assert receiver.vp1 is not None
    assert receiver.vp1.server == 705
    assert [(f.l0, f.l1) for f in found] == [give(0), give(1)]
    forced = A335Embedder(1280, 8, 25, give, overwrite=True)
    assert not is_foreign(one(forced, occupied), DOMAIN)


def test_own_line_is_replaced() -> None:
    first = one(A335Embedder(1280, 8, 25, source("1x")), grey())
    again = one(A335Embedder(1280, 8, 25, lambda k: (bytes(20), bytes(39))), first)
    assert not np.array_equal(first, again)


def test_other_domain_is_not_ours() -> None:
    embedder = A335Embedder(1280, 8, 25, source("1x"), domain="a.tv,2026")
    receiver = A335Receiver(1280, 8, 25)
    for _ in range(20):
        assert receiver.process(one(embedder, grey())) == []
    assert not receiver.locked


def test_second_line_helps() -> None:
    marked = one(A335Embedder(1280, 8, 25, source("1x")), grey())
    marked[0, ::3] += 14
    marked[0, 1::3] -= 3
    assert len(read_blocks(marked)) == 1


def test_rates_are_as_published() -> None:
    rates = {name: round(p.net_bps) for name, p in PROFILES.items()}
    assert rates == {
        "1x": 738,
        "1x-high": 3000,
        "1x-max": 3738,
        "2x": 4112,
        "2x-high": 8250,
        "2x-max": 9738,
    }
    gross = [p.body_bytes * 8 * 25 for p in PROFILES.values()]
    assert gross == [4200, 3800, 3800, 10200, 9800, 9800]


def test_frame_rates() -> None:
    assert frame_rate(23.976) == Fraction(24000, 1001)
    assert frame_rate(25) == 25
    for fps in (1, 120):
        with pytest.raises(CueError, match=r"must be 8\.\.100"):
            frame_rate(fps)


def test_carrier_refusals() -> None:
    give = source("1x")
    with pytest.raises(CueError, match="width 320"):
        A335Embedder(320, 240, 25, give)
    with pytest.raises(CueError, match="height 2"):
        A335Embedder(1280, 2, 25, give)
    with pytest.raises(CueError, match="unknown A/335 profile '3x'"):
        A335Embedder(1280, 720, 25, give, profile="3x")
    with pytest.raises(CueError, match="needs modulation 2X"):
        A335Embedder(1280, 720, 25, give, profile="2x", system=SYSTEM_1X)
    with pytest.raises(CueError, match="6 frames a superframe hold no 244 bytes"):
        A335Embedder(1280, 720, 8, give, profile="1x-high")
    with pytest.raises(CueError, match="leaves no room"):
        A335Embedder(1280, 8, 25, give, domain="a" * 30).process(grey())
    with pytest.raises(CueError, match="of 20 and 39 bytes"):
        A335Embedder(1280, 8, 25, lambda k: (b"1", b"")).process(grey())
    for end in (A335Embedder(1280, 8, 25, give), A335Receiver(1280, 8, 25)):
        with pytest.raises(CueError, match=r"expected \(8, 1280\)"):
            end.process(grey(9))
