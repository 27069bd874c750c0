"""From sound to events, with the real carrier and the real codec."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from receiver.reception.assemble import Assembler
from receiver.reception.engine import Receiver
from receiver.reception.events import Event, KeysFound, MotionPiece, StateChanged
from tests.receiver.air import marked_noise
from tests.receiver.standin import make_motion, make_voice

FS = 48000
VOICE = make_voice()
MOTION = make_motion(VOICE, duration_s=10.0)


@cache
def marked() -> NDArray[np.float32]:
    return marked_noise(VOICE, MOTION, 8)


def receive(
    sound: NDArray[np.float32], sizes: list[int], start_s: float = 0.0
) -> tuple[Receiver, list[Event]]:
    receiver = Receiver(FS, 1, voice=VOICE, start_s=start_s)
    events: list[Event] = []
    at = 0
    while at < len(sound):
        size = sizes[len(events) % len(sizes)]
        events += receiver.process(sound[at : at + size])
        at += size
    return receiver, events + receiver.flush()


@cache
def received() -> tuple[Receiver, list[Event]]:
    return receive(marked(), [FS])


def described(events: list[Event]) -> list[object]:
    """Events with arrays as bytes, so that they compare."""
    return [
        (e.start_s, e.params.tobytes(), e.layers) if isinstance(e, MotionPiece) else e
        for e in events
    ]


def test_everything_arrives_in_its_place() -> None:
    receiver, events = received()
    summary = receiver.summary()
    assert summary["superframes"] == {"received": 12, "lost": 0}
    assert summary["layers"] == {"L0": {"received": 12}, "L1": {"received": 12}}
    assert summary["carriers"]["audio"]["locked"] is True
    assert summary["voice"] == VOICE.identity
    assert summary["duration_s"] == pytest.approx(8.0)
    assert 0.6 < summary["tune_in_s"] < 2.0
    starts = {round(e.start_s, 2) for e in events if isinstance(e, MotionPiece)}
    assert starts == {round(0.64 * i, 2) for i in range(2, 14)}
    assert [e.state for e in events if isinstance(e, StateChanged)] == ["locked"]


def test_keys_of_the_summary_are_the_sent_ones() -> None:
    receiver, events = received()
    assert MOTION.score is not None
    found = receiver.summary()["keys"]
    sent = [k.as_dict() for k in MOTION.score.keys if 1.3 < k.start < found[-1]["start"] + 0.02]
    assert len(found) >= 20
    for key, expected in zip(found, sent, strict=True):
        assert key["start"] == pytest.approx(expected["start"], abs=0.012)
        assert (key["phones"], key["shape"]) == (expected["phones"], expected["shape"])
    assert sum(len(e.keys) for e in events if isinstance(e, KeysFound) and e.final) == len(found)


def test_the_split_into_blocks_does_not_matter() -> None:
    _, whole = received()
    _, parts = receive(marked(), [4001, 7, 30011, 480])
    assert described(parts) == described(whole)


def test_a_late_start_moves_the_times_only() -> None:
    cut = round(1.7 * FS)
    receiver, events = receive(marked()[cut:], [FS], start_s=1.7)
    starts = {round(e.start_s, 2) for e in events if isinstance(e, MotionPiece)}
    assert starts == {round(0.64 * i, 2) for i in range(5, 14)}
    assert receiver.summary()["tune_in_s"] < 2.0


def test_assembled_motion_is_near_the_sent_one() -> None:
    assembler = Assembler(VOICE)
    for event in received()[1]:
        assembler.add(event)
    motion = assembler.motion()
    at = round(motion.start_s * 50)
    error = motion.params - MOTION.params[at : at + len(motion.params)]
    assert motion.start_s == pytest.approx(1.28, abs=0.005)
    assert np.sqrt(np.mean(error**2)) < 2.0  # random stand-in models: coarse


def test_silence_has_no_cuer() -> None:
    receiver, events = receive(np.zeros((2 * FS, 1), np.float32), [FS])
    assert events == []
    summary = receiver.summary()
    assert summary["tune_in_s"] is None
    assert summary["voice"] is None
    assert summary["superframes"] == {"received": 0, "lost": 0}
