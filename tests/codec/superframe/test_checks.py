"""What surrounds a payload: identity, check, proof, slow pieces."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.errors import CueError
from codec.superframe.checks import is_own, proof_of, proved, with_proof
from codec.superframe.coding import coding_for
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.payload import read_l0
from codec.superframe.slow_channel import SlowReceiver, SlowSender, programme_registers
from codec.superframe.superframe import Superframe
from tests.codec.speech import SENTENCE, spoken

Perform = Callable[..., Motion]
Encoder = SuperframeEncoder | CompactEncoder


def encoders(voice: Voice, **told: object) -> tuple[Encoder, Encoder]:
    """Return an encoder of each form."""
    return (
        SuperframeEncoder(voice, l0_bytes=30, l1_bytes=8, **told),  # type: ignore[arg-type]
        CompactEncoder(voice, l0_bytes=9, **told),  # type: ignore[arg-type]
    )


@pytest.fixture
def motion(perform: Perform) -> Motion:
    return perform(spoken(2 * SENTENCE), 12)


def test_a_proof_can_be_set_after_encoding(toy_voice: Voice, motion: Motion) -> None:
    identity = coding_for(toy_voice).identity
    for encoder, width in zip(encoders(toy_voice, signed=True), (9, 2), strict=True):
        frames = [encoder.encode(motion, k) for k in range(10)]
        signed = [
            Superframe(f.index, with_proof(f.l0, (37 * f.index) % (1 << width)), f.l1)
            for f in frames
        ]
        for bare, frame in zip(frames, signed, strict=True):
            assert proof_of(bare.l0) == (0, width)
            assert proof_of(frame.l0) == ((37 * frame.index) % (1 << width), width)
            assert is_own(frame.l0, identity)
            assert proved(frame.l0) == proved(bare.l0)
            assert len(frame.l0) == len(bare.l0)
            one, other = (
                SuperframeDecoder(toy_voice).push(f.l0, f.l1, f.index) for f in (bare, frame)
            )
            assert other.layers == (("L0", "L1") if frame.l1 else ("L0",))
            np.testing.assert_array_equal(one.params, other.params)
            assert one.part == other.part


def test_an_unsigned_part_has_no_proof(toy_voice: Voice, motion: Motion) -> None:
    for encoder in encoders(toy_voice):
        assert proof_of(encoder.encode(motion, 1).l0) is None


@given(st.binary(max_size=14))
def test_any_bytes_have_a_proof_or_none(data: bytes) -> None:
    try:
        found = proof_of(data)
    except CueError:
        return
    assert found is None or 0 <= found[0] < 1 << found[1]


def test_a_programme_is_told_slowly(toy_voice: Voice, motion: Motion) -> None:
    slow = SlowSender(programme_registers(0xC0FFEE42))
    for encoder in encoders(toy_voice, slow=slow):
        decoder, receiver = SuperframeDecoder(toy_voice), SlowReceiver()
        for index in range(32):
            frame = encoder.encode(motion, index)
            assert receiver.programme is None or index > 24
            for piece in decoder.push(frame.l0, frame.l1, index).slow:
                receiver.take(piece)
        assert receiver.programme == 0xC0FFEE42


def test_parts_of_a_prediction_that_mislead_are_left_out(toy_voice: Voice, motion: Motion) -> None:
    """The hand moves as another score says, the face as its own does."""
    bases = coding_for(toy_voice).bases
    encoder = SuperframeEncoder(toy_voice, l0_bytes=40, l1_bytes=0)
    told = [read_l0(encoder.encode(motion, k).l0, bases)[0].setting.shares for k in range(10)]
    params = motion.params.copy()
    params[:, 7:] = params[::-1, 7:]
    mixed = Motion(params, 50.0, 0.0, motion.layout, motion.voice, motion.score)
    shares = [read_l0(encoder.encode(mixed, k).l0, bases)[0].setting.shares for k in range(10)]
    assert sum(map(sum, told)) < sum(map(sum, shares))
    assert any(share[1] > 0 or share[3] > 0 for share in shares)
