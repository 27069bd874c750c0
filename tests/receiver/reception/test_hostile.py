"""Hours of a hostile line: whatever is cut in, the cuer is back within two seconds of its end."""

import resource
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from codec.cues.score import Key
from codec.superframe.bits import COMPACT_HEADER_BYTES, HEADER_BYTES, crc16
from codec.superframe.checks import heard_mask
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.encoder import SuperframeEncoder
from receiver.reception.events import SUPERFRAME_S, KeysFound, MotionPiece
from receiver.reception.tracking import TimelineTracker
from receiver.television.protocol import pack_event
from tests.receiver.reception.test_faults import POOL, TOLERANCE_S, VOICE, programme
from tests.receiver.seeded import was_sent
from tests.receiver.standin import make_motion, make_voice

BACK_S = 2.0
MOST_EVENTS = 64
ATTACKS = (
    "voice", "voice on the grid", "version", "compact", "garbage", "broken", "silence", "pause",
    "pause on the grid", "back in time", "again and again", "spliced",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sent:
    """A superframe on the line; `index` is None for what the broadcaster did not send."""

    l0: bytes | None
    l1: bytes | None
    on_air_s: float
    index: int | None
    began: bool = False


@cache
def foreign() -> list[tuple[bytes, bytes]]:
    """Superframes of another voice, which say other keys."""
    voice = make_voice(1)
    encoder = SuperframeEncoder(voice, l0_bytes=24, l1_bytes=24)
    motion = make_motion(voice, duration_s=POOL * SUPERFRAME_S + 1)
    return [(s.l0, s.l1) for s in (encoder.encode(motion, k) for k in range(POOL))]


@cache
def compact() -> list[bytes]:
    """Compact superframes of another voice."""
    from tests.receiver.reception.test_tracking import with_phones

    voice = make_voice(2)
    encoder = CompactEncoder(voice, l0_bytes=12, first=0)
    motion = with_phones(make_motion(voice, duration_s=30.0))
    return [encoder.encode(motion, k).l0 for k in range(30)]


def of_version(l0: bytes, code: int) -> bytes:
    """The same superframe as one of another version, its check right."""
    body = bytes([l0[0] & 0x3F | code << 6]) + l0[1:-2]
    return body + (crc16(body) ^ heard_mask(l0)).to_bytes(2, "big")


def hostile(count: int, rng: np.random.Generator) -> Iterator[Sent]:
    """Yield a programme of a pool again and again, and every ten seconds or so an attack."""
    superframes, _ = programme()
    index, on_air_s, sent = 0, 0.0, 0
    began = True
    while sent < count:
        for _ in range(int(rng.integers(8, 24))):
            if index == POOL:
                index, on_air_s, began = 0, on_air_s + 0.31, True
            s = superframes[index]
            yield Sent(s.l0, s.l1, on_air_s, index, began)
            began, sent = False, sent + 1
            index, on_air_s = index + 1, on_air_s + SUPERFRAME_S
        kind = ATTACKS[int(rng.integers(len(ATTACKS)))]
        length = int(rng.integers(1, 12))
        at = int(rng.integers(20))
        shift = 0.0 if kind in ("voice on the grid", "version") else float(rng.uniform(0.15, 0.5))
        for k in range(length):
            old = superframes[(index + k) % POOL]
            place = on_air_s + k * SUPERFRAME_S + shift
            match kind:
                case "voice on the grid":  # and with our numbers
                    yield Sent(*foreign()[(index + k) % POOL], place, None)
                case "voice":
                    yield Sent(*foreign()[at + k], place, None)
                case "version":
                    yield Sent(of_version(old.l0, 1 + at % 3), old.l1, place, None)
                case "compact":
                    yield Sent(compact()[at % 18 + k], None, place, None)
                case "garbage":  # of compact parts only the carriers' checks tell it
                    yield Sent(rng.bytes(int(rng.integers(13, 60))), rng.bytes(24), place, None)
                case "broken":
                    wounded = bytearray(old.l0)
                    wounded[int(rng.integers(len(wounded)))] ^= 1 + int(rng.integers(255))
                    yield Sent(bytes(wounded), None, place, None)
                case "silence":
                    yield Sent(None, None, place, None)
                case _:
                    break
        began = kind not in ("voice on the grid", "version", "broken", "silence")
        gap_s = length * SUPERFRAME_S
        if kind == "pause":
            gap_s, began = float(rng.uniform(60, 4 * 3600)), True
        elif kind == "pause on the grid":
            gap_s, began = 64 * int(rng.integers(2, 300)) * SUPERFRAME_S, True
        elif kind == "back in time":
            gap_s, began = -float(rng.uniform(5, 600)), True
        elif kind == "again and again":
            gap_s = 0.0
            for _ in range(length):
                old = superframes[max(index - 1, 0)]
                yield Sent(old.l0, old.l1, on_air_s - SUPERFRAME_S, None)
            began = False
        elif kind == "spliced":
            index, gap_s, began = int(rng.integers(POOL - 4)), gap_s + 0.23, True
        else:
            index += length
            index = index if index < POOL else POOL
        on_air_s += gap_s


def endure(hours: float, seed: int) -> tuple[int, int, list[Key], float, int]:
    """Return superframes drawn, keys shown, wrong ones, longest way back, events at most."""
    rng = np.random.default_rng(seed)
    sent_keys = programme()[1]
    tracker = TimelineTracker(VOICE)
    wrong: list[Key] = []
    zeros: list[float] = []
    drawn = shown = most = 0
    missed_s = longest_s = 0.0
    for item in hostile(round(hours * 3600 / SUPERFRAME_S), rng):
        events = [
            *tracker.take(item.l0, item.l1, item.on_air_s),
            *tracker.advance(item.on_air_s + 0.7),
        ]
        most = max(most, len(events))
        if item.index is not None:
            zero_s = item.on_air_s + 2 * SUPERFRAME_S - item.index * SUPERFRAME_S
            zeros = [*zeros[-5:], zero_s]
            seen = any(isinstance(e, MotionPiece) and e.layers for e in events)
            drawn += seen
            missed_s = 0.0 if seen else missed_s + SUPERFRAME_S
            longest_s = max(longest_s, missed_s)
        for event in events:
            pack_event(event)
            if isinstance(event, MotionPiece):
                assert np.isfinite(event.params).all()
            if isinstance(event, KeysFound) and event.final:
                shown += len(event.keys)
                wrong += [k for k in event.keys if not was_sent(k, sent_keys, zeros, TOLERANCE_S)]
    return drawn, shown, wrong, longest_s, most


def test_ten_minutes_of_attacks() -> None:
    assert HEADER_BYTES > COMPACT_HEADER_BYTES
    drawn, shown, wrong, longest_s, most = endure(1 / 6, 1)
    assert drawn > 600
    assert shown > 900
    assert wrong == []
    assert longest_s <= BACK_S
    assert most <= MOST_EVENTS


@pytest.mark.slow
def test_a_day_of_attacks() -> None:
    """The peak of memory after twelve hours is that of the day."""
    peaks, figures = [], []
    for seed in (4, 5):
        figures.append(endure(12.0, seed))
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    drawn, shown, wrong, longest_s, most = zip(*figures, strict=True)
    grown_kb = peaks[1] - peaks[0]
    print(
        f"{sum(drawn)} superframes drawn, {sum(shown)} keys, {sum(map(len, wrong))} wrong, back "
        f"after {max(longest_s)} s, {max(most)} events at most, {grown_kb} of {peaks[1]} kB grown"
    )
    assert not any(wrong)
    assert max(longest_s) <= BACK_S
    assert max(most) <= MOST_EVENTS
    assert grown_kb < 4000
