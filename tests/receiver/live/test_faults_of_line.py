"""Simulated hours of a bad line through sound, transport stream and receiver: nothing crashes.

No key is shown that was not sent at that time, and memory stays where it is.
"""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import pytest

from tests.receiver.viewer import watch


def test_a_minute_of_a_bad_line() -> None:
    seen = watch(1 / 60, 3)
    assert seen.superframes > 30
    assert seen.shown > 50
    assert seen.wrong == []


@pytest.mark.slow
def test_a_day_of_a_bad_line() -> None:
    report = Path(__file__).resolve().parents[3] / "artefacts" / "line" / "day.txt"
    report.parent.mkdir(parents=True, exist_ok=True)
    minute, day = partial(watch, 1 / 60, 3), partial(watch, 24.0, 4, report, media=False)
    for work in (minute, day):  # the first process compiles the kernels, and keeps the memory
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as viewer:
            seen = viewer.submit(work).result()
    assert seen.runs > 40
    assert seen.superframes > 60_000
    assert seen.shown > 80_000
    assert seen.wrong == []
    assert max(seen.resident_mb) < 300
    assert max(seen.resident_mb[-10:]) < max(seen.resident_mb[:10]) + 30
