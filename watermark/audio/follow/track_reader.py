"""Read superframes at a track's place, and correct tracks by them.

In: a sound and a track; out: what is read there, at first as predicted, then by all means that the
purse pays for. Places are refined by pilots or by decoded bits, and a superframe that failed is
sought beside its place. Specification: spec/audio-carrier.md, section 7.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.demodulate import UNTOLD, Demodulator, SuperframeReading
from watermark.audio.follow.equaliser import KnownCells
from watermark.audio.follow.fit import AlignmentFit, find_delay, search_fit
from watermark.audio.follow.purse import CELLS, PHASES, VIEW, DecodingPurse
from watermark.audio.follow.track import TURNED_TRIALS, Track, as_used, likely_phases, look, views
from watermark.audio.search.acquire import DEVIATION, Candidate
from watermark.audio.signal.channel_choice import MID
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.masking import FLOOR, make_masker
from watermark.audio.signal.profile import (
    FRAMES_PER_SUPERFRAME,
    PILOT_STEPS,
    PROFILES,
    SUPERFRAME,
    TIER_LEVELS,
)
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer

PULL_IN = (
    (np.arange(-2.5, 2.6, 0.5), np.arange(-80.0, 81.0, 40.0)),
    (np.arange(-0.75, 0.8, 0.25), np.arange(-40.0, 41.0, 20.0)),
)
"""Delays in samples and drifts in ppm tried around a candidate, from coarse to fine."""

LEAST_COARSE = 4.0
"""Least score of pilots after the first of them, in deviations, for the second: 34 true candidates
of five clips and seven injuries had 5.3 at least, 86 % of those that unmarked sound gave less."""

BESIDE = (np.arange(-24.0, 24.1, 1.5), np.arange(-1600.0, 1601.0, 200.0))
"""Delays and drifts at which the pilots of a superframe that failed are sought."""

BESIDE_FINE = (np.arange(-1.0, 1.1, 0.5), np.arange(-150.0, 151.0, 50.0))
"""Delays and drifts tried around what was found there."""

LEAST_SCORE = 5.0
"""Least score of pilots at a refined place, in deviations, for reading there: of 20 true candidates
(standard, AAC 128k) 18 have more, of 47 that unmarked sound gave, 8 had."""

DEEP = 1e-2 * FLOOR
"""Floor of the mask where a superframe fails: a gain of -20 dB may have moved quiet bands there."""

LONE_IN = (np.arange(-0.8, 0.9, 0.2), np.arange(-60.0, 61.0, 20.0))
"""Delays and drifts at which cells of left or of right are tried where neither bits nor wide pilots
tell, and with the bits of L0 where L1 was not read: cells lie high, where a quarter of a sample
spoils them."""

LONE_SCORE = 4.0
"""Standard deviations above unmarked sound that they must then have."""

FOLLOW = 0.3
"""Delay tried on either side with the decoded bits of each following superframe, samples."""

YOUNG, LIKELY_CLOCK = 4, 2e-4
"""Superframes after which a clock is known well enough, and how far it may be from its nominal rate
to be believed nominal before: that of one superframe is known to 30 ppm."""

PAIR_CHECKS = 8
"""One in so many superframes of an old lock shows whether cells are better read elsewhere; one that
fails is tried there at once."""

CLEARLY = 1.0
"""Least advantage of known bits in standard deviations for cells to be read elsewhere."""

BACK_GAIN = 0.5
"""Part of the delay of a superframe of the past that moves the place of the one before."""


class TrackReader:
    """Reads superframes where a track predicts them, and corrects tracks by them.

    Parameters
    ----------
    key : int
        Seed of the layout.
    nominal : float
        Tape samples per sample of the mark at its nominal rate.
    purse : DecodingPurse, optional
        Pays for what superframes that fail cost; otherwise nothing is left out.

    Attributes
    ----------
    purse : DecodingPurse
        See there.
    """

    def __init__(self, key: int, nominal: float, purse: DecodingPurse | None = None) -> None:
        self._key, self._nominal = key, nominal
        self.purse = purse or DecodingPurse(math.inf)
        self._masker, self._deep = make_masker(), make_masker(floor=DEEP)
        self._demodulators: dict[int, Demodulator] = {}

    def demodulator(self, number: int) -> Demodulator:
        """Demodulator of a profile; learnt values are kept for the next lock."""
        if number not in self._demodulators:
            profile = list(PROFILES.values())[number]
            self._demodulators[number] = Demodulator(profile, self._key, self.purse)
        return self._demodulators[number]

    def view(self, tape: SampleBuffer, track: Track) -> SuperframeView:
        """Return the cells of the superframe at a track's place."""
        self.purse.charge(VIEW)
        return look(tape, track, self._masker)

    def read(
        self,
        tape: SampleBuffer,
        track: Track,
        raw: SuperframeView,
        *,
        due: bool,
        brief: bool = False,
    ) -> SuperframeReading:
        """Read with the phases that the track has, then without, or the other way round.

        Unless only in brief, then with bands that are too quiet for a programme of full loudness;
        where bands are turned, at last with phases from this superframe itself.
        """
        demodulator, turned = track.demodulator, track.equaliser.turned
        for view in views(track, raw) if turned else [raw]:
            levels = demodulator.likely_levels(view, track.level, track.offset)
            reading = demodulator.read(view, levels, offset=track.offset, due=due, brief=brief)
            if reading.decoded.l0 is not None:
                return self.complete(tape, track, reading)
        if brief:
            return reading
        # The gain may have returned to the nominal one since the track was found.
        if track.offset:
            nominal = demodulator.likely_levels(as_used(track, raw), track.level - track.offset)
            again = demodulator.read(as_used(track, raw), nominal, due=due, brief=True)
            if again.decoded.l0 is not None:
                track.offset = 0.0
                return self.complete(tape, track, again)
        # A programme below full loudness has more audible bands than the usual view uses.
        if not self.purse.pays(VIEW):
            return reading
        deep = look(tape, track, self._deep)
        if np.count_nonzero(deep.amplitudes) > np.count_nonzero(raw.amplitudes):
            view = as_used(track, deep)
            softer = demodulator.likely_levels(view, track.level, track.offset)
            again = demodulator.read(view, softer, offset=track.offset, due=due, brief=True)
            if again.decoded.l0 is not None:
                return self.complete(tape, track, again)
        # As a last resort, measure the phases anew from this superframe: its pilots are known.
        if turned:
            pilots, profile = make_pilots(self._key), demodulator.profile
            tier = math.floor((levels[0] - track.offset) / TIER_LEVELS + 1e-6)
            step = profile.pilot_step(0) * 2 ** (tier + track.offset / TIER_LEVELS)
            known = KnownCells(pilots.cells, step, pilots.expected(profile.number))
            if not self.purse.pays(PHASES):
                return reading
            likely = likely_phases(demodulator, raw, known, levels[:TIER_LEVELS])
            for equaliser, level in likely:
                turned_view = raw.turned(equaliser.bins)
                again = demodulator.read(turned_view, [level], offset=track.offset, due=False)
                if again.decoded.l0 is not None:
                    return self.complete(tape, replace(track, equaliser=equaliser), again)
        return reading

    def complete(
        self, tape: SampleBuffer, track: Track, reading: SuperframeReading
    ) -> SuperframeReading:
        """Seek L1 where only L0 was read, at the place where the bits of L0 fit best."""
        demodulator = track.demodulator
        if reading.decoded.l0 is None or reading.decoded.l1 is not None:
            return reading
        cells, step = demodulator.layout.cells, demodulator.profile.step(reading.level)
        moved = replace(track)
        expected = demodulator.expected(reading.decoded)
        here = as_used(track, self.view(tape, track))
        self.move(moved, search_fit(here, cells, step, expected, LONE_IN))
        raw = self.view(tape, moved)
        for view in views(moved, raw) if track.equaliser.turned else [raw]:
            again = demodulator.read_second(reading, view)
            if again.decoded.l1 is not None:
                return again
        return reading

    def pull_in(self, tape: SampleBuffer, track: Track, candidate: Candidate) -> float:
        """Refine a candidate's place by its pilots; give their score there, in deviations."""
        pilots, step = make_pilots(self._key), PILOT_STEPS[candidate.tier] * 2 ** (track.offset / 4)
        expected = pilots.expected(candidate.profile)
        for grid in PULL_IN:
            # Pilots stand in the mid.
            self.purse.charge(CELLS)
            view = as_used(track, self.view(tape, replace(track, pair=False)))
            fit = search_fit(view, pilots.cells, step, expected, grid)
            self.move(track, fit)
            if fit.score < LEAST_COARSE * DEVIATION:
                break
        return fit.score / DEVIATION

    def lone(self, track: Track, raw: SuperframeView, levels: list[float]) -> Iterator[Track]:
        """Places where cells of left, or of right, seem written in a single channel."""
        demodulator, cells = track.demodulator, track.demodulator.layout.cells
        view = as_used(track, raw)
        found = []
        for kind, _ in demodulator.standing.lone_levels(view, levels[:1]):
            expected = kind * np.ones((FRAMES_PER_SUPERFRAME, 1))
            least = LONE_SCORE * math.sqrt(expected.sum() / 2)
            for level in levels[:TIER_LEVELS]:
                self.purse.charge(CELLS)
                step = demodulator.profile.step(level)
                fit = search_fit(view, cells, step, expected, LONE_IN, harmonic=2)
                if fit.score > least:
                    found.append((fit.score, level, fit))
        for _, level, fit in sorted(found, key=lambda x: -x[0])[:TURNED_TRIALS]:
            moved = replace(track, level=level, misses=0, age=0)
            self.move(moved, fit)
            yield moved

    def elsewhere(self, tape: SampleBuffer, track: Track, raw: SuperframeView) -> Iterator[Track]:
        """Places where a superframe that failed may lie: by steadier clocks, by its pilots.

        The first is its own, with its cells in mid, left and right if they were in the mid before,
        and the other way round.
        """
        if isinstance(tape, StereoBuffer) and (raw.paired or not track.pair):
            yield replace(track, pair=not track.pair)
        if track.bend:
            yield replace(track, ratio=track.ratio / (1 + track.bend), bend=0.0)
        error = self._nominal - track.ratio
        if track.age < YOUNG and 0 < abs(error) < LIKELY_CLOCK * self._nominal:
            # Both clocks agree in the middle of the superframe before.
            position = track.position + SUPERFRAME / 2 * error
            yield replace(track, position=position, ratio=self._nominal, misses=0, age=0)
        moved = self.find_beside(tape, track, raw)
        if moved is not None:
            yield moved
        if not raw.paired:
            levels = track.demodulator.likely_levels(raw, track.level, track.offset)
            yield from self.lone(track, raw, levels)

    def settle_pair(self, tape: SampleBuffer, track: Track, reading: SuperframeReading) -> None:
        """Go on with cells in mid, left and right, or all in the mid: as known bits fit clearly."""
        old = track.age >= PAIR_CHECKS and track.age % PAIR_CHECKS
        if old or not isinstance(tape, StereoBuffer):
            return
        if track.pair and not reading.view.paired:
            return  # The channels are equal.
        other = replace(track, pair=not track.pair)
        raw = self.view(tape, other)
        if raw.paired == reading.view.paired:
            return
        demodulator = track.demodulator
        expected = demodulator.expected(reading.decoded) * (demodulator.places.cells != MID)
        step = demodulator.profile.step(reading.level)
        there = as_used(other, raw).soft(demodulator.layout.cells, step)
        # A lock has moved the track from where it was read.
        here = reading.soft
        if not track.age:
            here = as_used(track, self.view(tape, track)).soft(demodulator.layout.cells, step)
        gain = float(((there - here) * expected).sum())
        if gain > CLEARLY * math.sqrt(np.count_nonzero(expected) / 2):
            track.pair = other.pair

    def find_beside(self, tape: SampleBuffer, track: Track, raw: SuperframeView) -> Track | None:
        """Find by its pilots where a superframe lies that the clock has led astray."""
        pilots, profile = make_pilots(self._key), track.demodulator.profile
        tier = math.floor((track.level - track.offset) / TIER_LEVELS + 1e-6)
        step = profile.pilot_step(0) * 2 ** (tier + track.offset / TIER_LEVELS)
        expected = pilots.expected(profile.number)
        moved = replace(track, misses=0, age=0)
        view = as_used(track, raw)
        for grid, least in ((BESIDE, UNTOLD), (BESIDE_FINE, LEAST_SCORE * DEVIATION)):
            self.purse.charge(CELLS)
            fit = search_fit(view, pilots.cells, step, expected, grid)
            if fit.score < least:
                return None
            self.move(moved, fit)
            view = as_used(moved, self.view(tape, moved))
        return moved

    def learn_back(self, past: Track, raw: SuperframeView, reading: SuperframeReading) -> None:
        """Let a superframe of the past correct the place of the one before, and the phases."""
        demodulator = past.demodulator
        cells, step = demodulator.layout.cells, demodulator.profile.step(reading.level)
        weighted = demodulator.expected(reading.decoded)
        weighted = weighted * demodulator.trust(reading)
        delay = find_delay(reading.view, cells, step, weighted, FOLLOW)
        past.position += BACK_GAIN * delay * self._nominal
        past.equaliser.learn(raw, KnownCells(cells, step, weighted))

    def move(self, track: Track, fit: AlignmentFit) -> None:
        """Shift a track by a fit."""
        track.position += fit.start_delay * self._nominal
        track.ratio *= 1 + fit.drift_ppm * 1e-6

    def nudge(self, track: Track, delay: float) -> None:
        """Correct a track by the delay that a superframe had, samples at 48 kHz."""
        place, pace = track.gains()
        track.position += place * delay * self._nominal
        track.ratio *= 1 + pace * delay / SUPERFRAME
        track.age += 1
