"""Simulated hours of a bad line through sound, transport stream and receiver: nothing crashes.

No key is shown that was not sent at that time, and memory stays where it is.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, cast

import numpy as np
import pytest

from codec.score import Key
from receiver import live
from receiver.continuity import Place, SteadyClock
from receiver.events import KeysFound, MotionPiece
from receiver.fragments import Fragments
from receiver.live import Broadcast, Happening
from tests.receiver.badair import VOICE, BadLine, was_sent

TOLERANCE_S = 0.2
RUN_S = 1200.0
"""The receiver is switched off and on about this often."""


@dataclass(slots=True)
class Watched:
    """What a viewer saw."""

    hours: float = 0.0
    runs: int = 0
    superframes: int = 0
    lost: int = 0
    splices: int = 0
    shown: int = 0
    wrong: list[Key] = field(default_factory=list)
    resident_mb: list[float] = field(default_factory=list)


def resident_mb() -> float:
    """Return the memory that this process has resident now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


class Witness(SteadyClock):
    """The receiver's clock, watched: which time of the programme lies where on it."""

    line: BadLine
    zeros: list[float]

    def place(self, stream: str, stamp_s: float, duration_s: float = 0.0) -> Place:
        place = super().place(stream, stamp_s, duration_s)
        for sent_s in self.line.sent_s(stamp_s)[:2]:
            zero_s = place.time_s - sent_s
            if not any(abs(zero_s - known) < 0.01 for known in self.zeros):
                self.zeros[:] = [*self.zeros[-7:], zero_s]
        return place


def watch(
    hours: float, seed: int, monkeypatch: pytest.MonkeyPatch, report: Path | None = None
) -> Watched:
    rng = np.random.default_rng(seed)
    seen = Watched()
    while seen.hours < hours:
        seconds = min(float(rng.exponential(RUN_S)) + 20, 3600 * (hours - seen.hours))
        _watch_one(seen, BadLine(rng, ("aac", "mp2")[int(rng.integers(2))], seconds), monkeypatch)
        seen.hours += seconds / 3600
        seen.resident_mb.append(resident_mb())
        if report is not None:
            report.write_text(f"{seen}\n")
    return seen


def _watch_one(seen: Watched, line: BadLine, monkeypatch: pytest.MonkeyPatch) -> None:
    Witness.line, Witness.zeros = line, []
    monkeypatch.setattr(live, "SteadyClock", Witness)

    def tell(happening: Happening) -> None:
        if isinstance(happening, MotionPiece):
            assert np.isfinite(happening.params).all()
        if isinstance(happening, KeysFound) and happening.final:
            seen.shown += len(happening.keys)
            seen.wrong += [
                key for key in happening.keys if not was_sent(key, Witness.zeros, TOLERANCE_S)
            ]

    broadcast = Broadcast(cast(IO[bytes], line), VOICE, tell, format="mpegts", once=True)
    broadcast.run()
    figures = broadcast.metrics.document()
    seen.runs += 1
    seen.superframes += int(figures["superframes_received_total"])
    seen.lost += int(figures["superframes_lost_total"])
    seen.splices += int(figures["splices_total"])


def test_two_minutes_of_a_bad_line(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = watch(2 / 60, 3, monkeypatch)
    assert seen.superframes > 60
    assert seen.shown > 100
    assert seen.wrong == []


class NoMedia:
    """Stands for the writer of the viewers' media, which takes a quarter of the time."""

    mime = ""

    def __init__(self, *_: object) -> None:
        pass

    def sound(self, *_: object) -> Fragments:
        return Fragments()

    def close(self) -> Fragments:
        return Fragments()


@pytest.mark.slow
def test_a_day_of_a_bad_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "FragmentWriter", NoMedia)
    report = Path(__file__).resolve().parents[2] / "artefacts" / "line" / "day.txt"
    report.parent.mkdir(parents=True, exist_ok=True)
    seen = watch(24.0, 4, monkeypatch, report)
    assert seen.runs > 40
    assert seen.superframes > 60_000
    assert seen.shown > 80_000
    assert seen.wrong == []
    assert max(seen.resident_mb) < 300
    assert max(seen.resident_mb[-10:]) < max(seen.resident_mb[:10]) + 30
