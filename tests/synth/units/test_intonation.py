"""Pitch of chosen units: bounded changes, no jumps at joins, rising questions."""

import numpy as np

from synth.planning.prosody.melody import Melody
from synth.units.concatenation.intonation import intone
from synth.units.concatenation.sounds import PlacedUnit
from synth.units.concatenation.units import Unit
from synth.units.speech.pitch import PitchTrack

_LOW, _HIGH = (PitchTrack(np.full(200, hz), 0.005) for hz in (200.0, 240.0))


def _row(*recordings: int) -> list[PlacedUnit]:
    """Return diphones of 0.2 s from the same places of recordings."""
    return [
        PlacedUnit(
            number,
            Unit(("l", "a"), (0.2 * k, 0.2 * k + 0.1, 0.2 * k + 0.2)),
            Unit(("l", "a"), (1 + 0.2 * k, 1.1 + 0.2 * k, 1.2 + 0.2 * k)),
        )
        for k, number in enumerate(recordings)
    ]


def test_runs_meet_and_keep_their_own_pitch_elsewhere() -> None:
    row = _row(0, 0, 1, 1)
    tracks = [_LOW, _LOW, _HIGH, _HIGH]
    flat = Melody(np.array([0.0]), np.array([220.0]))
    said = intone(flat, row, tracks)
    pitch = [ratio * track.f0[0] for (_, _, ratio), track in zip(said, tracks, strict=True)]
    assert abs(pitch[1][-1] / pitch[2][0] - 1) < 1e-6
    changes = [12 * np.abs(np.log2(ratio)).max() for _, _, ratio in said]
    assert max(changes[0], changes[3]) <= 1.5
    assert all(np.diff(target).min() > 0 for _, target, _ in said)


def test_a_question_rises_farther_than_other_words_are_moved() -> None:
    asks = Melody(np.array([1.0, 1.6, 1.8]), np.array([200.0, 200.0, 336.0]))
    said = intone(asks, _row(0, 0, 0, 0), [_LOW] * 4)
    assert 12 * np.log2(said[-1][2][-1]) > 2.0
    assert 12 * np.abs(np.log2(said[0][2])).max() <= 1.5
