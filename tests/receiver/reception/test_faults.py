"""Simulated hours of a bad line: nothing crashes, no key is shown that was not sent."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import Key
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import Superframe
from receiver.reception.events import SUPERFRAME_S, KeysFound, MotionPiece
from receiver.reception.tracking import TimelineTracker
from tests.receiver.seeded import seeded_speech, was_sent
from tests.receiver.standin import make_motion

VOICE = load_voice()
POOL = 64
TOLERANCE_S = 0.2
"""Beside a loss the start of a key is known by a nominal length only."""


@cache
def programme() -> tuple[tuple[Superframe, ...], tuple[Key, ...]]:
    """Forty-one seconds of seeded speech as 64 superframes, and its keys."""
    score = seeded_speech(POOL * SUPERFRAME_S + 1)
    motion = replace(make_motion(VOICE, duration_s=POOL * SUPERFRAME_S + 2), score=score)
    encoder = SuperframeEncoder(VOICE, l0_bytes=24, l1_bytes=24)
    return tuple(encoder.encode(motion, index) for index in range(POOL)), score.keys


def broken(data: bytes, rng: np.random.Generator) -> bytes:
    """Change some bytes."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        changed[int(rng.integers(len(changed)))] ^= int(rng.integers(1, 256))
    return bytes(changed)


def bad_line(
    count: int, rng: np.random.Generator
) -> Iterator[tuple[bytes | None, bytes | None, float, int]]:
    """Yield L0, L1, time on air, index; losses, garbage, repeats, splices, clock jumps."""
    index, on_air_s = 0, 0.0
    superframes, _ = programme()
    lost = 0
    for _ in range(count):
        if index == POOL or rng.random() < 0.004:  # a splice, or the programme begins again
            index = int(rng.integers(POOL - 4))
            on_air_s += float(rng.uniform(0.15, 40.0))
        superframe = superframes[index]
        if lost == 0 and rng.random() < 0.03:
            lost = int(rng.integers(1, 15)) if rng.random() < 0.3 else 1
        jitter_s = float(rng.normal(0, 2e-4))
        if lost:
            lost -= 1
            if rng.random() < 0.5:
                yield None, None, on_air_s + jitter_s, index
        elif rng.random() < 0.02:
            yield broken(superframe.l0, rng), superframe.l1, on_air_s + jitter_s, index
        elif rng.random() < 0.02:
            yield superframe.l0, broken(superframe.l1, rng), on_air_s + jitter_s, index
        else:
            for _ in range(2 if rng.random() < 0.02 else 1):
                yield superframe.l0, superframe.l1, on_air_s + jitter_s, index
        index += 1
        on_air_s += SUPERFRAME_S


def watch(hours: float, seed: int) -> tuple[int, int, list[Key]]:
    """Return superframes received, keys shown, and keys that were not sent."""
    rng = np.random.default_rng(seed)
    sent = programme()[1]
    tracker = TimelineTracker(VOICE)
    received, shown = 0, 0
    wrong: list[Key] = []
    zeros: list[float] = []
    for l0, l1, on_air_s, index in bad_line(round(hours * 3600 / SUPERFRAME_S), rng):
        if rng.random() < 1e-3:
            received += tracker.received
            tracker = TimelineTracker(VOICE)  # switched off and on
        zero_s = on_air_s + 2 * SUPERFRAME_S - index * SUPERFRAME_S
        zeros = [*zeros[-3:], zero_s] if not zeros or abs(zeros[-1] - zero_s) > 0.01 else zeros
        for event in [*tracker.take(l0, l1, on_air_s), *tracker.advance(on_air_s + 0.7)]:
            if isinstance(event, MotionPiece):
                assert np.isfinite(event.params).all()
            if isinstance(event, KeysFound) and event.final:
                shown += len(event.keys)
                wrong += [key for key in event.keys if not was_sent(key, sent, zeros, TOLERANCE_S)]
    return received + tracker.received, shown, wrong


def test_six_minutes_of_faults() -> None:
    received, shown, wrong = watch(0.1, seed=1)
    assert received > 400
    assert shown > 800
    assert wrong == []


@pytest.mark.slow
def test_a_day_of_faults() -> None:
    received, shown, wrong = watch(24.0, seed=2)
    assert received > 100_000
    assert shown > 200_000
    assert wrong == []
