"""Sound whose duration was changed at its pitch: where its superframes lie, frame by frame.

A programme that is played faster at its own pitch is cut into pieces that overlap: within a piece
all is as it was, from piece to piece some milliseconds are left out or heard twice. So a superframe
has a few jumps at unknown places. In: sound; out: superframes. Pilots tell where one begins,
pilots and the lattice itself where each of its frames lies: the likeliest path, by dynamic
programming. Source: Verhelst and Roelands, "An overlap-add technique based on waveform similarity",
ICASSP 1993 (what such a stretch does); Viterbi, IEEE Trans. IT 13(2), 1967.
Specification: spec/audio-carrier.md, W48.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.demodulate import Demodulator, SuperframeReading
from watermark.audio.follow.equaliser import Equaliser
from watermark.audio.follow.past import UNREADABLE
from watermark.audio.follow.purse import PIECES_LOCK, PIECES_READ, SAVED
from watermark.audio.follow.stretched_path import MARGIN, REACH
from watermark.audio.follow.stretched_place import APART, FRAMES, StretchedPlace, even_start
from watermark.audio.follow.stretched_reader import ATTEMPTS, JUMPS, PathReading, PiecesReader
from watermark.audio.follow.track import Track, received
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.search.stretched_search import StretchedCandidate
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, HOP, SUPERFRAME, AudioProfile
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.superframe import ReceivedSuperframe

TEMPI = (25 / 24, 24 / 25)
"""Of films at 24 pictures a second that are played at 25, and the way back: this a single
superframe, whose jumps may be anywhere, does not show."""

MOST_BACK = 6
"""Superframes of the past that are read."""

LATEST = 2.0
"""Greatest delay of reading in superframes where the purse has to be filled first."""

Array = NDArray[np.float64]


class StretchedFollower:
    """Locks onto stretched sound and follows it.

    Parameters
    ----------
    key : int
        Seed of the layout.
    fs : int
        Rate of the sound, Hz.
    nominal : float
        Samples that come for one of the mark's own.
    reader : TrackReader
        Whose demodulators are used.
    """

    def __init__(self, key: int, fs: int, nominal: float, reader: TrackReader) -> None:
        self._fs, self._nominal, self._reader = fs, nominal, reader
        self._pieces = PiecesReader(key, nominal, reader.purse)
        self._place: StretchedPlace | None = None
        self._first: tuple[SuperframeReading, Array] | None = None
        self._demodulator: Demodulator | None = None

    @property
    def locked(self) -> bool:
        """Whether stretched sound is being followed."""
        return self._place is not None

    @property
    def position(self) -> float:
        """Where the next superframe is expected, samples of the tape; 0 without a lock."""
        return 0.0 if self._place is None else self._place.position

    @property
    def profile(self) -> AudioProfile | None:
        """The announcement of the sound locked onto, None before."""
        return None if self._demodulator is None else self._demodulator.profile

    @property
    def demodulator(self) -> Demodulator:
        """That of the profile which was locked onto."""
        assert self._demodulator is not None
        return self._demodulator

    def forget(self) -> None:
        """Give the lock up."""
        self._place = None

    @property
    def misses(self) -> float:
        """Superframes in a row that failed; infinite without a lock."""
        return np.inf if self._place is None else self._place.misses

    def lock(self, candidate: StretchedCandidate, tape: SampleBuffer, start: float) -> bool:
        """Lock onto a candidate of a stretch that starts at a place of the tape, if it is one."""
        self._demodulator = demodulator = self._reader.demodulator(candidate.profile)
        centre = candidate.places * self._nominal + start
        levels = [float(level) for level in demodulator.profile.levels_of(candidate.tier)]
        paths = self._pieces.paths(tape, centre, demodulator)
        looked_at = list[PathReading]()
        read = self._pieces.brief(paths, levels, ATTEMPTS, looked_at)
        read = read or self._pieces.again(demodulator, looked_at, due=False)
        if read is None:
            return False
        reading, places = read.reading, read.places
        heard = float(places[-1] - places[0]) / (FRAMES_PER_SUPERFRAME - 1)
        tempo = min(TEMPI, key=lambda likely: abs(likely * heard - HOP * self._nominal))
        first = even_start(places, tempo, self._nominal)
        self._place = StretchedPlace(first, tempo, tempo, first, reading.level, self._nominal)
        self._first = reading, places
        return True

    def go_on(
        self, tape: SampleBuffer, track: Track, usual: SuperframeReading
    ) -> list[ReceivedSuperframe]:
        """Lock onto the superframe after one that was read as usual, if that is in pieces.

        It is read briefly, as far as the purse pays. Whole sound can be read in pieces as well, and
        better than `usual`, read at the track in vain, at a level that may be wrong: it is in
        pieces only where the wrong bits of `usual` are nearer to chance than to those in pieces.
        """
        self._demodulator, purse = track.demodulator, self._reader.purse
        # Look for pieces around the place where the next superframe would begin at each tempo.
        for tempo in TEMPI:
            if not purse.affords(PIECES_READ):
                break
            place = StretchedPlace(
                track.position,
                tempo,
                tempo,
                track.position,
                round(track.level),
                self._nominal,
                track.position,
            )
            centre = place.position + HOP * self._nominal / tempo * FRAMES
            paths = self._pieces.paths(tape, centre, track.demodulator)
            first = [(place.piece, JUMPS[0])]
            read = self._pieces.brief(paths, place.levels, first, [], tempo)
            if read is not None:
                sent = track.demodulator.expected(read.reading.decoded)
                wrong, left = (int(np.sum(each.soft * sent < 0)) for each in (usual, read.reading))
                if wrong - left <= np.count_nonzero(sent) / 2 - wrong:
                    return []
                self._place = place
                place.learn(read.reading.level, read.places, tempo)
                self.demodulator.learn(read.reading)
                return [self._received(read.reading, even_start(read.places, tempo, self._nominal))]
        return []

    def begin(self, tape: SampleBuffer, told: float) -> list[ReceivedSuperframe]:
        """Give the superframe that was locked onto, after those before it as far as is paid for.

        Those up to the place `told`, where the last one was handed out, are left out.
        """
        assert self._place is not None
        assert self._first is not None
        (reading, places), place, found = self._first, self._place, list[ReceivedSuperframe]()
        if place.position > told + SUPERFRAME * self._nominal / 2:
            one = self._received(reading, place.position)
            found = [*self._read_back(tape, place, told), one]
        place.learn(reading.level, places, place.tempo)
        self.demodulator.learn(reading)
        return found

    def complete(self, tape: SampleBuffer) -> bool:
        """Whether the next superframe has arrived and can be paid for, or must be given up."""
        if self._place is None:
            return False
        last = self._place.position + SUPERFRAME * self._nominal / min(TEMPI)
        late = tape.end - last - (REACH + HOP + 2 * MARGIN) * self._nominal
        waits = late < LATEST * SUPERFRAME * self._nominal
        return late >= 0 and (self._reader.purse.has(PIECES_LOCK) or not waits)

    def follow(self, tape: SampleBuffer) -> list[ReceivedSuperframe]:
        """Read the superframe that is due; give the lock up after some that fail."""
        place = self._place
        if place is None:
            return []
        position = place.position
        if not self._reader.purse.affords(PIECES_READ):
            return self._miss(place)
        # Whatever this one costs, the next one is read briefly at least.
        with self._reader.purse.keeping(PIECES_READ / SAVED):
            reading, places, tempo = self._read(tape, place)
        if reading.decoded.l0 is not None:
            place.learn(reading.level, places, tempo)
            self.demodulator.learn(reading)
            if place.unstretched:
                self._place = None
            return [self._received(reading, even_start(places, place.tempo, self._nominal))]
        self._miss(place)
        return [] if self._place is None else [self._received(reading, position)]

    def _miss(self, place: StretchedPlace) -> list[ReceivedSuperframe]:
        """Go on from a superframe that was not read; give the lock up in time."""
        place.miss()
        if place.lost:
            self._place = None
        return []

    def _read_back(
        self, tape: SampleBuffer, place: StretchedPlace, told: float
    ) -> list[ReceivedSuperframe]:
        """Read superframes that were on air before one that was found; correct its tempo."""
        found: list[ReceivedSuperframe] = []
        failed, nominal = 0, SUPERFRAME * self._nominal
        oldest = tape.first + (REACH + MARGIN) * self._nominal if tape.first else -np.inf
        first = max(oldest, told + nominal / 2, -HOP * self._nominal)
        past = replace(place)
        affords = self._reader.purse.affords
        # Backwards superframe by superframe: each start and tempo place the one before it.
        while failed < UNREADABLE and past.position - nominal / past.tempo > first:
            if len(found) == MOST_BACK or not affords(PIECES_READ):
                break
            reading, places, tempo = self._read(tape, past, back=True)
            if reading.decoded.l0 is None:
                failed += 1
                past.position -= nominal / past.tempo
                continue
            failed, past.tempo = 0, tempo
            past.position = even_start(places, tempo, self._nominal)
            found.insert(0, self._received(reading, past.position))
        # Forward reading starts with the tempo that was found here.
        if found:
            place.tempo = place.assumed = past.tempo
        return found

    def _read(
        self, tape: SampleBuffer, place: StretchedPlace, *, back: bool = False
    ) -> tuple[SuperframeReading, Array, float]:
        """Read the superframe that begins at a place, or ends there; return its tempo.

        As long as little is known of the tempo, others are tried.
        """
        others = [tempo for tempo in TEMPI if abs(tempo - place.tempo) > APART]
        tempi = [place.tempo] if place.settled else [place.tempo, *others]
        levels, known = place.levels, [(place.piece, JUMPS[0])]
        attempts = ATTEMPTS if place.piece is None else [*known, *ATTEMPTS]
        looked_at = list[PathReading]()
        for n, tempo in enumerate(tempi):
            if n and not self._reader.purse.affords(PIECES_READ):
                break
            frames = FRAMES - FRAMES_PER_SUPERFRAME if back else FRAMES
            centre = place.position + HOP * self._nominal / tempo * frames
            paths = self._pieces.paths(tape, centre, self.demodulator)
            read = self._pieces.brief(paths, levels, attempts, looked_at, tempo)
            if read is not None:
                return read.reading, read.places, tempo
        read = self._pieces.again(self.demodulator, looked_at, due=not back)
        if read is not None:
            return read.reading, read.places, read.tempo
        return looked_at[0].reading, looked_at[0].places, place.tempo

    def _received(self, reading: SuperframeReading, position: float) -> ReceivedSuperframe:
        equaliser = Equaliser(self.demodulator.bands)
        track = Track(position, self._nominal, self.demodulator, reading.level, equaliser)
        return received(track, reading, self._fs)
