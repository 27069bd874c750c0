"""Tuners: the picture helps out where the sound has no cuer; the beginning is received early."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from receiver.reception.events import State, StateChanged
from receiver.reception.reception import Progress
from receiver.television.tuner import PREROLL_S, PROBE_S, EagerTuner, ProgrammeTuner
from tests.receiver.standin import make_voice

VOICE = make_voice()


def states_of(tuner: ProgrammeTuner, start_s: float) -> list[tuple[float, str]]:
    return [
        (p.until_s, e.state)
        for p in tuner.tune(start_s)
        for e in p.events
        if isinstance(e, StateChanged)
    ]


@pytest.mark.parametrize(
    ("sound", "looked_from_s"),
    [({0: "locked"}, None), ({}, 0.0), ({0: "locked", 9: "lost"}, 9 - PREROLL_S)],
)
def test_the_picture_is_looked_at_where_the_sound_has_no_cuer(
    monkeypatch: pytest.MonkeyPatch, sound: dict[int, State], looked_from_s: float | None
) -> None:
    looks: list[float] = []

    def receive(self: ProgrammeTuner, begin_s: float, *, look: bool) -> Iterator[Progress]:
        if look:
            looks.append(begin_s)
        for second in range(int(begin_s), 20):
            state = "locked" if look else sound.get(second)
            events = (StateChanged(float(second), state),) if state else ()
            yield Progress(float(second), events)

    monkeypatch.setattr(ProgrammeTuner, "_receive", receive)
    found = states_of(ProgrammeTuner(Path("none.mp4"), VOICE), 0.0)
    assert looks == ([] if looked_from_s is None else [looked_from_s])
    assert found[-1][1] == "ended"
    assert any(state == "locked" for _, state in found)
    assert PROBE_S < 9


class _Counted:
    """Twenty seconds of nothing, and how often they were asked for."""

    def __init__(self) -> None:
        self.starts: list[float] = []

    def tune(self, start_s: float) -> Iterator[Progress]:
        self.starts.append(start_s)
        for second in range(20):
            if start_s + second > 30:
                raise ValueError("damaged")
            yield Progress(start_s + second, ())


def test_the_beginning_is_received_once_for_the_first_viewer() -> None:
    counted = _Counted()
    eager = EagerTuner(counted, 5.0)
    assert [p.until_s for p in eager.tune(0.0)] == list(range(20))
    assert next(eager.tune(7.0)).until_s == 7.0
    assert next(eager.tune(0.0)).until_s == 0.0
    assert counted.starts[1:] == [7.0, 0.0]
    with pytest.raises(ValueError, match="damaged"):
        list(eager.tune(25.0))
