"""Figures of naturalness: joins, cuts without a join, changes of duration."""

import numpy as np
import pytest

from codec.cuer.motion import Motion
from cuecast.evaluate.naturalness import NaturalnessTally
from synth.units.concatenation.concatenation import Performance
from synth.units.concatenation.sounds import PlacedUnit
from synth.units.concatenation.units import Unit

FS = 16_000


def _unit(recording: int, source_s: float, target_s: float, change: float = 1.0) -> PlacedUnit:
    """Return a quarter of a second of speech with its border in the middle."""
    source = Unit(("a", "l"), tuple(source_s + np.array([0.0, 0.125, 0.25]) / change))
    return PlacedUnit(
        recording, source, Unit(("a", "l"), (target_s, target_s + 0.125, target_s + 0.25))
    )


def _said(hz: list[float], units: list[PlacedUnit]) -> Performance:
    phase = 2 * np.pi * np.cumsum(np.repeat(hz, FS // 4)) / FS
    sound = 0.2 * (np.sin(phase) + np.sin(3 * phase)).astype(np.float32)
    motion = Motion(np.zeros((1, 1), dtype=np.float32), 50.0, 0.0, ("face.jaw",), "nobody")
    return Performance(sound, FS, motion, tuple(units))


def test_joins_are_separated_from_cuts() -> None:
    units = [_unit(0, 1.0, 0.0), _unit(0, 1.25, 0.25), _unit(3, 5.0, 0.5), _unit(3, 5.25, 0.75)]
    tally = NaturalnessTally()
    sound = tally.add([_said([150, 150, 200, 200], units)])
    row = tally.row()
    assert len(sound) == FS
    assert row["joins_per_second"] == 1.0
    at_joins, elsewhere = row["pitch_step_semitones"]
    assert at_joins == pytest.approx(12 * np.log2(200 / 150), abs=0.2)
    assert elsewhere < 0.1
    assert row["spectrum_step_db"][0] > 3 * row["spectrum_step_db"][1]
    assert (row["duration_change"], row["stretched"]) == (0.0, 0.0)


def test_stretched_units_are_counted() -> None:
    tally = NaturalnessTally()
    units = [_unit(0, 1.0, 0.0), _unit(0, 3.0, 0.25, change=2.0)]
    tally.add([_said([150, 150], units)])
    row = tally.row()
    assert row["stretched"] == 0.5
    assert row["duration_change"] == pytest.approx(np.log(2) / 2, abs=1e-3)


def test_nothing_said_has_figures() -> None:
    assert NaturalnessTally().row()["joins_per_second"] == 0.0
