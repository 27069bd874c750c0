"""A broadcast over UDP on the loopback in real time: joining, loss of packets, holes.

One datagram in a hundred is lost, and the line is dead for five seconds now and then. Measured by
the wall clock: from the first datagram after joining in the middle to the first correct key, and
from the end of each hole to motion again. The report goes to ``artefacts/line/udp.json``.
"""

import json
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from receiver.live.broadcast import Broadcast, Happening
from receiver.reception.events import KeysFound, MotionPiece
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.badair import POOL_S, VOICE, speech
from tests.receiver.standin import make_motion
from tests.receiver.transmitter import Transmitter

REPORT = Path(__file__).resolve().parents[2] / "artefacts" / "line" / "udp.json"
LOSS = 0.01
JOIN_S = 4.0
HOLES_S = (8.0, 19.0)
"""Seconds after joining at which the line goes dead for `HOLE_S`."""

HOLE_S = 5.0


def correct(keys: list[tuple[float, int, str]]) -> list[bool]:
    """Tell which keys (start, shape, placement) were sent, whatever the receiver's zero."""
    sent = speech().keys
    offsets = np.array(
        [
            start - key.start
            for start, shape, placement in keys
            for key in sent
            if (key.shape, key.placement) == (shape, placement)
        ]
    )
    votes = [(np.abs(offsets - offset) < 0.1).sum() for offset in offsets]
    zero_s = float(np.median(offsets[np.abs(offsets - offsets[int(np.argmax(votes))]) < 0.1]))
    return [
        any(
            (key.shape, key.placement) == (shape, placement)
            and abs(start - zero_s - key.start) < 0.2
            for key in sent
        )
        for start, shape, placement in keys
    ]


def receive(seed: int) -> dict[str, object]:
    motion = replace(make_motion(VOICE, POOL_S + 2.0), score=speech())
    data = transport_stream(marked_noise(VOICE, motion, POOL_S))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    moments: list[tuple[float, Happening]] = []
    broadcast = Broadcast(
        f"udp://127.0.0.1:{port}", VOICE, lambda h: moments.append((time.monotonic(), h))
    )
    thread = threading.Thread(target=broadcast.run, daemon=True)
    thread.start()
    time.sleep(1.0)
    at_byte = int(len(data) * JOIN_S / POOL_S) // 188 * 188
    transmitter = Transmitter(
        data[at_byte:], port, POOL_S - JOIN_S, loss=LOSS, rng=np.random.default_rng(seed)
    )
    begin = time.monotonic()
    transmitter.start()
    again = []
    for hole_s in HOLES_S:
        time.sleep(max(0.0, begin + hole_s - time.monotonic()))
        transmitter.silent.set()
        time.sleep(HOLE_S)
        transmitter.silent.clear()
        again.append(time.monotonic())
    transmitter.join()
    time.sleep(0.5)
    broadcast.stop()
    keys = [(at - begin, key) for at, h in moments if isinstance(h, KeysFound) for key in h.keys]
    right = correct([(key.start, key.shape, key.placement) for _, key in keys])
    first = next(at for (at, _), ok in zip(keys, right, strict=True) if ok)
    motions = [at for at, h in moments if isinstance(h, MotionPiece) and h.layers]
    figures = broadcast.metrics.document()
    return {
        "first_correct_key_s": round(first, 2),
        "motion_again_s": [round(min(m for m in motions if m > at) - at, 2) for at in again],
        "keys": len(keys),
        "keys_wrong": right.count(False),
        "superframes_received": figures["superframes_received_total"],
        "superframes_lost": figures["superframes_lost_total"],
        "damaged_packets": figures["damaged_packets_total"],
    }


def test_join_loss_and_holes(benchmark: BenchmarkFixture) -> None:
    found: list[dict[str, object]] = []
    benchmark.pedantic(  # type: ignore[no-untyped-call]
        lambda: found.append(receive(len(found))), rounds=3
    )
    REPORT.parent.mkdir(parents=True, exist_ok=True)
    REPORT.write_text(json.dumps(found, indent=1))
    print(json.dumps(found, indent=1))
    assert all(run["keys"] for run in found)
