"""One who watches a bad line for hours, and what was seen.

Free of the test runner, so that a process of its own has the memory of a receiver.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, cast
from unittest.mock import patch

import numpy as np

from codec.cues.score import Key
from receiver.live import broadcast as live
from receiver.live.broadcast import Broadcast, Happening
from receiver.live.continuity import LocalTime, SteadyClock
from receiver.live.fragments import Fragments, FragmentWriter
from receiver.reception.events import KeysFound, MotionPiece
from receiver.television.memory import give_back_large_blocks, release, unchanged_ranges
from tests.receiver.badair import VOICE, BadLine, speech
from tests.receiver.seeded import was_sent

TOLERANCE_S = 0.2
RUN_S = 1200.0
"""The receiver is switched off and on about this often."""


@dataclass(slots=True)
class Watched:
    """What a viewer saw; memory in MB after each run and at its highest."""

    hours: float = 0.0
    runs: int = 0
    superframes: int = 0
    lost: int = 0
    splices: int = 0
    shown: int = 0
    wrong: list[Key] = field(default_factory=list)
    resident_mb: list[float] = field(default_factory=list)
    peak_mb: float = 0.0


class NoMedia:
    """Stands for the writer of the viewers' media, which takes a quarter of the time."""

    mime = ""

    def __init__(self, *_: object) -> None:
        pass

    def sound(self, *_: object) -> Fragments:
        return Fragments()

    def close(self) -> Fragments:
        return Fragments()


class Witness(SteadyClock):
    """The receiver's clock, watched: which time of the programme lies where on it."""

    line: BadLine
    zeros: list[float]

    def place(self, stream: str, stamp_s: float, duration_s: float = 0.0) -> LocalTime:
        place = super().place(stream, stamp_s, duration_s)
        for sent_s in self.line.sent_s(stamp_s)[:2]:
            zero_s = place.time_s - sent_s
            if not any(abs(zero_s - known) < 0.01 for known in self.zeros):
                self.zeros[:] = [*self.zeros[-7:], zero_s]
        return place


def memory_mb(pid: int | None = None) -> tuple[float, float]:
    """Return the memory that a process (this one) has resident now, and at its highest."""
    lines = Path(f"/proc/{pid or 'self'}/status").read_text().splitlines()
    sizes = {name: rest for name, _, rest in (line.partition(":") for line in lines)}
    now, peak = (1.024e-3 * int(sizes[name].split()[0]) for name in ("VmRSS", "VmHWM"))
    return round(now, 1), round(peak, 1)


def watch(hours: float, seed: int, report: Path | None = None, *, media: bool = True) -> Watched:
    """Watch a bad line and compare what is shown with what was sent.

    Parameters
    ----------
    hours : float
        Of programme.
    seed : int
    report : Path, optional
        File to which the figures so far are written after each run.
    media : bool
        Whether what viewers play is written, too.
    """
    give_back_large_blocks()
    rng = np.random.default_rng(seed)
    seen = Watched()
    writer = FragmentWriter if media else NoMedia
    with patch.object(live, "SteadyClock", Witness), patch.object(live, "FragmentWriter", writer):
        while seen.hours < hours:
            seconds = min(float(rng.exponential(RUN_S)) + 20, 3600 * (hours - seen.hours))
            _watch_one(seen, BadLine(rng, ("aac", "mp2")[int(rng.integers(2))], seconds))
            seen.hours += seconds / 3600
            release(unchanged_ranges("libllvmlite"))  # as the television does each second
            now, seen.peak_mb = memory_mb()
            seen.resident_mb.append(now)
            if report is not None:
                report.write_text(f"{seen}\n")
    return seen


def _watch_one(seen: Watched, line: BadLine) -> None:
    Witness.line, Witness.zeros = line, []
    sent = speech().keys

    def tell(happening: Happening) -> None:
        if isinstance(happening, MotionPiece):
            assert np.isfinite(happening.params).all()
        if isinstance(happening, KeysFound) and happening.final:
            seen.shown += len(happening.keys)
            seen.wrong += [
                key for key in happening.keys if not was_sent(key, sent, Witness.zeros, TOLERANCE_S)
            ]

    broadcast = Broadcast(cast(IO[bytes], line), VOICE, tell, format="mpegts", once=True)
    broadcast.run()
    figures = broadcast.metrics.document()
    seen.runs += 1
    seen.superframes += int(figures["superframes_received_total"])
    seen.lost += int(figures["superframes_lost_total"])
    seen.splices += int(figures["splices_total"])
