"""The sender's own receiver: superframes that went out whole, those that arrived, the alarm."""

import numpy as np
import pytest

from cuecast.live.options import RunClock
from cuecast.live.own_reception import MinuteReport, ReceptionCount
from cuecast.live.packets import PERIOD, step

TICKS = 90_000
STEP = round(0.64 * TICKS)


def minute(
    count: ReceptionCount,
    lost: set[int],
    bypass: range = range(0),
    start: int = PERIOD - 5 * TICKS,
    lag: int = 0,
) -> list[MinuteReport]:
    """Let 80 s of sound go out in pieces of 24 ms; the stamps begin anew on the way.

    The receiver is `lag` pieces behind.
    """
    count.clock(RunClock(start, 10.0, 10.0 - 0.2))
    reports, before = [], 0
    piece = round(0.024 * TICKS)
    for n in range(80_000 // 24):
        at_s = 0.024 * n
        count.went_out((start + n * piece) % PERIOD, piece, n not in bypass, 100.0 + at_s)
        if n >= lag:
            count.heard((start + (n - lag) * piece) % PERIOD)
        number = int((0.024 * (n - lag) + 0.2) / 0.64) - 4
        begins = (start + round((0.64 * number - 0.2) * TICKS)) % PERIOD
        if number > before and number not in lost:
            count.arrived((begins + 4000) % PERIOD)
        before = number
        found = count.settle(100.0 + at_s)
        reports += [found] if found else []
    return reports


def test_everything_arrives() -> None:
    count = ReceptionCount()
    (report,) = minute(count, set())
    assert report.sent == report.received > 70
    assert not report.alarms
    assert count.alarms == 0


def test_losses_raise_an_alarm() -> None:
    count = ReceptionCount()
    (report,) = minute(count, {30, 31, 60, 61})
    assert report.sent - report.received == 4
    assert count.alarms == 1
    assert str(report).startswith("alarm, below 98 %: read back")


def test_what_went_out_unmarked_is_not_missed() -> None:
    whole, cut = ReceptionCount(), ReceptionCount()
    minute(whole, set())
    minute(cut, set(range(29, 41)), bypass=range(790, 1070))
    assert cut.sent == cut.received
    assert whole.sent - cut.sent in (11, 12)


def test_a_receiver_that_lags_raises_no_alarm() -> None:
    count = ReceptionCount()
    (report,) = minute(count, set(), lag=1000)
    assert report.sent == report.received > 30
    count = ReceptionCount()
    assert not minute(count, set(), lag=10_000)
    assert count.settle(400.0) is None
    assert count.sent == 0


@pytest.mark.parametrize("late", [-3, 0, 5])
def test_clock_of_superframes(late: int) -> None:
    clock = RunClock(PERIOD - 100, 4.0, 3.5)
    assert clock.at((PERIOD - 100 + late) % PERIOD) == pytest.approx(4.0 + late / TICKS)
    assert step(5, PERIOD - 5) == 10
    assert np.isclose(STEP / TICKS, 0.64)
