"""A track that is followed: the superframes before a place that was found, and those after it.

In: a tape and a place where a superframe was accepted; out: superframes, in their order, and where
the next one is expected. The place of each is predicted, and corrected by the bits that were
decoded. Cost: two views and a fit for a superframe that is read; what one that fails may cost is
the purse's affair. Specification: spec/audio-carrier.md, W36 and W37.
"""

from dataclasses import replace

import numpy as np

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.attempt import AcceptedAttempt
from watermark.audio.follow.demodulate import SuperframeReading
from watermark.audio.follow.equaliser import KnownCells
from watermark.audio.follow.fit import find_delay, search_fit
from watermark.audio.follow.past import PastReader
from watermark.audio.follow.purse import DUE, ELSEWHERE, FOLLOWED, LOCKED_IN, LOST, DecodingPurse
from watermark.audio.follow.recurrence import REMEMBERED
from watermark.audio.follow.track import Track, as_used, received
from watermark.audio.follow.track_reader import FOLLOW, YOUNG, TrackReader
from watermark.audio.signal.profile import HOP, SUPERFRAME
from watermark.audio.signal.sample_buffer import StereoBuffer
from watermark.link.superframe import ReceivedSuperframe

LOCK_IN = (
    (np.arange(-1.0, 1.1, 0.25), np.arange(-60.0, 61.0, 20.0)),
    (np.arange(-0.4, 0.5, 0.2), np.arange(-20.0, 21.0, 10.0)),
)
"""Delays and drifts tried with the decoded bits of the first superframe, from coarse to fine."""

SAME_PLACE, SAME_CLOCK = 1.0, 2e-4
"""A search that ends within these samples of the place expected, or of another candidate, and with
a ratio that differs by a smaller part from the expected one, has found nothing new."""


PIECES_LATER = 4800
"""Samples of sound after a superframe that are looked at where it may lie in pieces."""

LATEST_S = 4.0
"""Sound after a lock; past superframes that are still unread at its end are left out."""


class TrackFollower:
    """Follows a track.

    Parameters
    ----------
    fs : int
        Rate of the sound, Hz.
    nominal : float
        Tape samples per sample of the mark at its nominal rate.
    reader : TrackReader
        That reads superframes.
    purse : DecodingPurse
        That pays for those that fail.

    Attributes
    ----------
    track : Track or None
        Where the next superframe is expected; None where nothing is followed.
    doubted : SuperframeReading or None
        The next superframe as it was read in vain where it seems to lie in pieces.
    past : PastReader
        Reads what was on air before the lock.
    last_start, last_told : float
        Places of the last superframe that was read, and that was handed out.
    """

    def __init__(self, fs: int, nominal: float, reader: TrackReader, purse: DecodingPurse) -> None:
        self._fs, self._nominal, self._reader, self._purse = fs, nominal, reader, purse
        self.track: Track | None = None
        self.last_start = self.last_told = -np.inf
        self.doubted: SuperframeReading | None = None
        self._errors = self._counted = 0
        self.past = PastReader(fs, reader, purse)

    @property
    def ber_estimate(self) -> float | None:
        """Share of wrong bits before decoding, None before the first superframe."""
        return self._errors / self._counted if self._counted else None

    @property
    def misses(self) -> float:
        """Superframes in a row that failed; infinite where nothing is followed."""
        return np.inf if self.track is None else self.track.misses

    def is_new(self, position: float, pace: float) -> bool:
        """Whether a superframe lies behind all that were read."""
        return position >= self.last_start + 0.5 * SUPERFRAME * pace

    def note(self, found: list[ReceivedSuperframe]) -> list[ReceivedSuperframe]:
        """Note where superframes were that another follower read."""
        for superframe in found:
            self.last_told = superframe.position_s * self._fs
            if superframe.l0 is not None:
                self.last_start = self.last_told
        return found

    def lock(self, tape: StereoBuffer, accepted: AcceptedAttempt) -> list[ReceivedSuperframe]:
        """Take a track that was found; where it agrees with the one before, that one goes on."""
        track = accepted.track
        self._correct(tape, track, accepted.raw, accepted.reading, wide=True)
        reading = self._reader.complete(tape, track, accepted.reading)
        # Which channels the cells stand in must be known before the past is read.
        self._reader.settle_pair(tape, track, reading)
        known = self.track
        if known is not None and known.demodulator is track.demodulator:
            # How many superframes lie between the tracks, and where the old one's clock puts this
            # one.
            steps = round((track.position - known.position) / (SUPERFRAME * known.ratio))
            expected = known.ratio * (1 + known.bend) ** steps
            due = known.position + steps * SUPERFRAME * expected
            delay = (track.position - due) / self._nominal
            # A clock that drifted: keep its bend. Otherwise the old track goes on, with the new
            # place.
            if abs(track.ratio / expected - 1) > SAME_CLOCK:
                if abs(delay) <= SAME_PLACE:
                    track.bend = known.bend
                    track.bent(expected)
            elif abs(delay) <= SAME_PLACE:
                track = replace(
                    known,
                    position=due,
                    level=track.level,
                    misses=0,
                    equaliser=track.equaliser,
                    offset=track.offset,
                    pair=track.pair,
                )
                self._reader.nudge(track, delay)
        before = self.past.end()
        # Superframes before this one, back to the last that was handed out, are read afterwards.
        first = tape.first + (HOP if tape.first else -HOP) * track.ratio
        first = max(first, self.last_told + 0.5 * SUPERFRAME * track.ratio)
        until = tape.end + LATEST_S * self._fs
        self.doubted, self.track = None, track
        self.past.start(replace(track, bend=0.0), first, until)
        self.past.hold([self._deliver(track, reading)])
        return [*before, *self.past.read(tape)]

    def complete(self, tape: StereoBuffer) -> bool:
        """Whether the next superframe has arrived, with all that is around it if it is doubted."""
        track = self.track
        if track is None:
            return False
        end = track.position + (SUPERFRAME + HOP) * track.ratio + tape.reach(track.ratio)
        return end + (PIECES_LATER * track.ratio if self.doubted else 0) <= tape.end

    def doubts(self, tape: StereoBuffer) -> bool:
        """Whether a superframe soon after the lock cannot be read briefly: a lock onto pieces.

        It is then waited for as long as reading it in pieces takes.
        """
        track = self.track
        if track is None or track.misses or track.age >= YOUNG or self.doubted:
            return False
        raw = self._reader.view(tape, track)
        reading = self._reader.read(tape, track, raw, due=True, brief=True)
        self.doubted = reading if reading.decoded.l0 is None else None
        return self.doubted is not None

    def follow(self, tape: StereoBuffer, patience: int) -> list[ReceivedSuperframe]:
        """Read the superframe that is due; note whether it arrived.

        After `patience` failures in a row they are not handed out any more.
        """
        track, self.doubted = self.track, None
        if track is None:
            return []
        # A track that is lost already must leave some of the purse to the search.
        kept = LOST if track.misses else 0.0
        raw = self._reader.view(tape, track)
        with self._purse.keeping(kept):
            reading = self._reader.read(tape, track, raw, due=True)
        if reading.decoded.l0 is not None:
            expected = track.ratio
            self._correct(tape, track, raw, reading, wide=bool(track.bend))
            if track.bend:
                track.bent(expected)
            self._reader.settle_pair(tape, track, reading)
            return self.past.hold([self._deliver(track, reading)])
        # Not where it is due: a cut may have moved the sound, or another pair of channels carries
        # it.
        for moved in self._reader.elsewhere(tape, track, raw):
            with self._purse.keeping(max(DUE, kept)):
                if not self._purse.affords(ELSEWHERE):
                    break
                raw = self._reader.view(tape, moved)
                there = moved.pair != track.pair
                again = self._reader.read(tape, moved, raw, due=there)
            if again.decoded.l0 is not None:
                self.track = moved
                self._correct(tape, moved, raw, again, wide=not there)
                if not track.misses and not there:
                    moved.bent(track.ratio)
                return self.past.hold([self._deliver(moved, again)])
        track.misses += 1
        failed = self._deliver(track, reading, told=track.misses <= patience)
        if track.misses > max(patience, REMEMBERED):
            self.track = None
        return self.past.hold([failed] if track.misses <= patience else [])

    def _correct(
        self,
        tape: StereoBuffer,
        track: Track,
        raw: SuperframeView,
        reading: SuperframeReading,
        *,
        wide: bool = False,
    ) -> None:
        """Let the decoded bits correct clock, level, phases and the cells' reliabilities."""
        demodulator = track.demodulator
        expected = demodulator.expected(reading.decoded)
        cells, step = demodulator.layout.cells, demodulator.profile.step(reading.level)
        weighted = expected * demodulator.trust(reading)
        self._purse.charge(LOCKED_IN if wide else FOLLOWED)
        if wide:
            for grid in LOCK_IN:
                view = as_used(track, self._reader.view(tape, track))
                self._reader.move(track, search_fit(view, cells, step, weighted, grid))
            raw = self._reader.view(tape, track)
        else:
            self._reader.nudge(track, find_delay(reading.view, cells, step, weighted, FOLLOW))
        track.offset += demodulator.gain_change(reading)
        track.equaliser.learn(raw, KnownCells(cells, step, weighted))
        demodulator.learn(reading)
        self._errors += int(((reading.soft * expected) < 0).sum())
        self._counted += int((expected != 0).sum())
        track.level, track.misses = reading.level, 0

    def _deliver(
        self, track: Track, reading: SuperframeReading, *, told: bool = True
    ) -> ReceivedSuperframe:
        """Hand a superframe out and move the track to the next one."""
        result = received(track, reading, self._fs)
        if reading.decoded.l0 is not None:
            self.last_start = track.position
        if told:
            self.last_told = track.position
        track.advance()
        return result
