"""Attempts to read where a search proposes it: a candidate's place, its variants, its levels.

In: a tape and a candidate; out: the track and the reading that the link's check accepts, if any.
Cost: two views and two fits of pilots, then a list decoding at each level; only candidates that
their own pilots confirm are tried by all means.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.demodulate import TRIED_LEVELS, SuperframeReading
from watermark.audio.follow.equaliser import Equaliser, KnownCells, path_of, score_phases
from watermark.audio.follow.fit import search_fit
from watermark.audio.follow.purse import PHASES, Ventures
from watermark.audio.follow.track import Track, as_used, likely_phases
from watermark.audio.follow.track_reader import LEAST_SCORE, TrackReader
from watermark.audio.search.acquire import Candidate
from watermark.audio.search.rotated_search import RotatedCandidate
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import LEVELS, TIER_LEVELS
from watermark.audio.signal.sample_buffer import StereoBuffer

DELAYS = (0.0, 0.5, -0.5)
"""Delays in samples at which a candidate is tried, those beside its place briefly."""

TURNED_GRID = (np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), np.arange(-320.0, 321.0, 80.0))
"""Delays and drifts tried around a place whose phases are known by its pilots."""

SURE_TURNED = 6.0
"""Significance of a candidate whose bands are turned for a trial with all means: of 33 in unmarked
sound 27 had less, of 38 true ones (five clips and eight ways of turning them) one."""


@dataclass(frozen=True, slots=True)
class AcceptedAttempt:
    """Where a superframe was read.

    Attributes
    ----------
    track : Track
        The place.
    raw : SuperframeView
        The superframe there, before phases are turned.
    reading : SuperframeReading
        The accepted superframe.
    """

    track: Track
    raw: SuperframeView
    reading: SuperframeReading


@dataclass(frozen=True, slots=True)
class AssumedSound:
    """How a candidate's sound is thought to be.

    Attributes
    ----------
    pace : float
        Tape samples per sample of the mark.
    offset : float
        Levels by which a gain moved all others.
    equaliser : Equaliser or None
        Phases, where they are known.
    """

    pace: float
    offset: float = 0.0
    equaliser: Equaliser | None = None


class CandidateReader:
    """Decodes at candidates' places.

    Parameters
    ----------
    key : int
        Seed of the layout.
    nominal : float
        Tape samples per sample of the mark at its nominal rate.
    reader : TrackReader
        That reads there.
    """

    def __init__(self, key: int, nominal: float, reader: TrackReader) -> None:
        self._pilots, self._nominal, self._reader = make_pilots(key), nominal, reader

    def read(
        self, tape: StereoBuffer, position: float, candidate: Candidate, sound: AssumedSound,
        ventures: Ventures, *, delays: tuple[float, ...] = DELAYS,
    ) -> AcceptedAttempt | None:  # fmt: skip
        """Decode at a candidate that begins at a position of the tape."""
        demodulator = self._reader.demodulator(candidate.profile)
        ratio, offset = sound.pace * (1 + candidate.clock_ppm * 1e-6), sound.offset
        own = demodulator.profile.levels_of(candidate.tier)
        track = Track(
            position,
            ratio,
            demodulator,
            own.start + 1 + offset,
            sound.equaliser or Equaliser(demodulator.bands),
            offset,
        )
        with ventures.attempt(0.0, LEAST_SCORE):
            score = self._reader.pull_in(tape, track, candidate)
        if score < LEAST_SCORE:
            return None
        levels = sorted(range(len(LEVELS)), key=lambda level: abs(level - own.start - 1.4))
        moved_levels = [level + offset for level in levels[:TRIED_LEVELS]]
        for moved, whole in self._places(tape, track, moved_levels, delays):
            with ventures.attempt(score, LEAST_SCORE):
                raw = self._reader.view(tape, moved)
                view = as_used(moved, raw)
                reading = demodulator.read(
                    view, moved_levels, offset=offset, due=False, brief=not whole
                )
            if reading.decoded.l0 is not None:
                return AcceptedAttempt(moved, raw, reading)
        return None

    def _places(
        self, tape: StereoBuffer, track: Track, levels: list[float], delays: tuple[float, ...]
    ) -> Iterator[tuple[Track, bool]]:
        """Yield a candidate's place and its variants.

        With each goes whether it is worth more than a brief attempt.
        """
        for delay in delays:
            yield replace(track, position=track.position + delay * self._nominal), delay == 0
        raw = self._reader.view(tape, track)
        if raw.paired:
            # More channels than two have all cells in the mid, and may have been mixed down.
            yield replace(track, pair=False), True
        else:
            yield from ((moved, True) for moved in self._reader.lone(track, raw, levels))

    def read_turned(
        self, tape: StereoBuffer, position: float, candidate: RotatedCandidate, ventures: Ventures
    ) -> AcceptedAttempt | None:
        """Decode at a place whose bands have phases of their own."""
        demodulator = self._reader.demodulator(candidate.profile)
        profile, pilots = demodulator.profile, self._pilots
        # Levels lie in tiers of one pilot step; the rest is an offset that all levels of it share.
        tier = math.log2(candidate.step / profile.pilot_step(0))
        nearest = min(max(round(tier), 0), (len(LEVELS) - 1) // TIER_LEVELS)
        offset = TIER_LEVELS * (tier - nearest)
        known = KnownCells(pilots.cells, candidate.step, pilots.expected(candidate.profile))
        equaliser = Equaliser(demodulator.bands)
        track = Track(position, self._nominal, demodulator, 0.0, equaliser, offset)
        view = self._reader.view(tape, track)
        expected = pilots.expected(candidate.profile)
        # A filter's phase has a slope (a delay), which moves the position, and a rest, which turns
        # bands.
        _, delay, phases = path_of(score_phases(view, known, len(pilots.cells.dither)))
        track.position += delay * self._nominal
        view = self._reader.view(tape, track).turned(Equaliser(phases.size, phases).bins)
        self._reader.move(track, search_fit(view, known.cells, known.step, expected, TURNED_GRID))
        view = self._reader.view(tape, track)
        numbers = range(nearest * TIER_LEVELS, (nearest + 1) * TIER_LEVELS)
        levels = [number + offset for number in numbers]
        ventures.purse.charge(PHASES)
        # Finally measure phases for each level of the tier and decode, the likeliest first.
        for equaliser, level in likely_phases(demodulator, view, known, levels):
            moved = replace(track, level=level, equaliser=equaliser)
            brief = candidate.significance < SURE_TURNED
            used = as_used(moved, view)
            with ventures.attempt(candidate.significance, SURE_TURNED):
                reading = demodulator.read(used, [level], offset=offset, due=False, brief=brief)
            if reading.decoded.l0 is not None:
                return AcceptedAttempt(moved, view, reading)
        return None
