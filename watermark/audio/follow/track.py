"""Where superframes are expected in a sound, how fast they come, at which level and phases.

A `Track` is such a place; a superframe is looked at with and without its phases.
Specification: spec/audio-carrier.md, section 7.
"""

from dataclasses import dataclass

import numpy as np

from watermark.audio.follow.align import SuperframeView, read_view
from watermark.audio.follow.demodulate import Demodulator, SuperframeReading
from watermark.audio.follow.equaliser import Equaliser, KnownCells, lean, path_of, score_phases
from watermark.audio.signal.masking import Masker
from watermark.audio.signal.profile import SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.superframe import ReceivedSuperframe

TURNED_TRIALS = 3
"""Levels at which the phases of a place are tried, the likeliest first."""

LEAST_DELAY_GAIN, LEAST_PACE_GAIN = 0.2, 0.02
"""Parts of a measured delay that an old lock adds to place and, per superframe, to clock."""

LEAST_BEND, LARGEST_BEND, BEND_GAIN = 6e-5, 2e-3, 0.5
"""Least relative change of the clock between superframes that counts, twice the error of one
fit; its limit; and the part of a further change that is believed."""


@dataclass(slots=True)
class Track:
    """Where the next superframe is expected and how it is written.

    Attributes
    ----------
    position : float
        Start on the tape, in samples.
    ratio : float
        Tape samples per sample of the mark.
    demodulator : Demodulator
        Of the profile.
    level : float
        Level of the superframe before.
    equaliser : Equaliser
        Phases of the bands.
    offset : float
        Levels by which a change of gain seems to have moved all others.
    misses : int
        Superframes in a row that failed.
    age : int
        Superframes that corrected the place after the first.
    bend : float
        Part of itself by which the ratio grows per superframe: tapes whose speed changes.
    pair : bool
        Whether cells of two channels stand in left and right; else all in the mid.
    """

    position: float
    ratio: float
    demodulator: Demodulator
    level: float
    equaliser: Equaliser
    offset: float = 0.0
    misses: int = 0
    age: int = 0
    bend: float = 0.0
    pair: bool = True

    def advance(self) -> None:
        """Go on to the next superframe."""
        self.position += SUPERFRAME * self.ratio
        self.ratio *= 1 + self.bend

    def bent(self, expected: float) -> None:
        """Learn from a ratio, measured where another was expected, how the clock changes."""
        change = self.ratio / expected - 1
        bend = self.bend + (BEND_GAIN * change if self.bend else change)
        self.bend = (
            float(np.clip(bend, -LARGEST_BEND, LARGEST_BEND)) if abs(bend) > LEAST_BEND else 0.0
        )

    def gains(self) -> tuple[float, float]:
        """Parts of the next delay by which place and clock are corrected.

        Those of a line through all places so far, until the loop is narrow enough: its memory then
        bridges superframes that fail. Source: expanding-memory filter, Morrison, "Introduction to
        Sequential Smoothing and Prediction", 1969.
        """
        n = self.age + 2
        place, pace = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
        return max(place, LEAST_DELAY_GAIN), max(pace, LEAST_PACE_GAIN)


def likely_phases(
    demodulator: Demodulator, view: SuperframeView, known: KnownCells, levels: list[float]
) -> list[tuple[Equaliser, float]]:
    """Phases from pilots and the cells' second harmonics, the likeliest with their level."""
    certain = score_phases(view, known, demodulator.bands)
    paths = []
    for level in levels:
        cells = KnownCells(demodulator.layout.cells, demodulator.profile.step(level), None)
        paths.append((*path_of(certain + score_phases(view, cells, demodulator.bands)), level))
    paths.sort(key=lambda found: -found[0])
    return [
        (Equaliser(phases.size, phases + lean(delay, phases.size)), level)
        for _, delay, phases, level in paths[:TURNED_TRIALS]
    ]


def look(tape: SampleBuffer, track: Track, masker: Masker) -> SuperframeView:
    """Return the superframe at a track's place."""
    places = track.demodulator.places if track.pair else None
    return read_view(tape, track.position, track.ratio, masker, places, bend=track.bend)


def views(track: Track, raw: SuperframeView) -> list[SuperframeView]:
    """Give the views with and without the phases of a track, the better one first."""
    views = [raw.turned(track.equaliser.bins), raw]
    return views if track.equaliser.used else views[::-1]


def as_used(track: Track, raw: SuperframeView) -> SuperframeView:
    """Return the view with the phases that the track goes by."""
    return raw.turned(track.equaliser.bins) if track.equaliser.used else raw


def received(track: Track, reading: SuperframeReading, fs: int) -> ReceivedSuperframe:
    """Make the output of a superframe."""
    agreement = reading.soft * track.demodulator.expected(reading.decoded)
    known = np.count_nonzero(agreement) or 1
    return ReceivedSuperframe(
        l0=reading.decoded.l0,
        l1=reading.decoded.l1,
        position_s=track.position / fs,
        confidence=float(np.clip(agreement.sum() / known, 0.0, 1.0)),
        ber_estimate=float((agreement < 0).sum() / known),
        ratios=reading.llr,
    )
