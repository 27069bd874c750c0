"""The audio receiver: a programme in blocks in, superframes out, from wherever one tunes in.

Searching: `PilotSearch` proposes places; a place counts when the link's check accepts what is read
there. Where it finds nothing, guesses about what happened to the sound are tried on its last
seconds, one after another (`watermark.audio.search.hypotheses`). Locked: the place of each next
superframe is predicted, and corrected by the bits that were decoded. A superframe that fails starts
a new search beside the prediction, so that a splice is found while a mere gap is bridged. What was
heard before the lock is then read, too. Specification: spec/audio-carrier.md, W35 to W42 and W47.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.align import SuperframeView, find_delay, search_fit
from watermark.audio.follow.demodulate import SuperframeReading
from watermark.audio.follow.equaliser import Equaliser, KnownCells, path_of, score_phases
from watermark.audio.follow.stretched import StretchedFollower
from watermark.audio.follow.track import (
    FOLLOW,
    Track,
    TrackReader,
    as_used,
    likely_phases,
    received,
)
from watermark.audio.search.acquire import Candidate, PilotSearch, search_stretch
from watermark.audio.search.hypotheses import (
    STRETCH_S,
    ChannelHypothesis,
    ChannelMix,
    Stretch,
    make_guesses,
    usual_mix,
)
from watermark.audio.search.pilot_scan import DECIMATION, LOW_REACH
from watermark.audio.search.rotated_search import RotatedCandidate, RotatedSearch
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.mix import check_format
from watermark.audio.signal.profile import (
    FS,
    HOP,
    LEVELS,
    SLOT_FRAMES,
    SUPERFRAME,
    TIER_LEVELS,
    AudioProfile,
)
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer
from watermark.link.inputs import checked_block
from watermark.link.superframe import ReceivedSuperframe

TRIED_LEVELS = 6
"""Levels at which a candidate is tried: those of its tier and one on either side."""

MAX_MISSES = 6
"""Superframes in a row that may fail before the lock of a lone carrier is given up."""

REMEMBERED = 16
"""Failed superframes after which a lock that was given up is forgotten: while the sound is too poor
for the search, a superframe at the old place may still be read."""

HISTORY_S, LONG_HISTORY_S = 2.4, 10.0
"""Sound that is kept while locked, enough to search again from a superframe that failed, and while
searching, for what may be read of it once the sound is understood."""

PAUSES_S = (2.2, 2.2, 2.2, 35.0, 60.0, 130.0, 240.0)
"""Search in vain before each round of guesses; the last one is repeated. Every second round tries
all speeds; the third round begins 8 s after the start."""

GUESSES_PER_STEP = 2
"""Guesses tried for each 0.08 s that arrive."""

PATIENCE, MOST_SELDOM = 1.1, 3
"""Growth of the time between searches that are blind to phase, which overlap at first, and its
limit in stretches."""

DELAYS = (0.0, 0.5, -0.5)
"""Delays in samples at which a candidate is tried, those beside its place briefly."""

LEAST_AT_SPEED = 5.2
"""Least significance of a candidate at a guessed speed: tens of speeds are tried."""

FAILED_BEFORE_GUESSING = 3
"""Superframes in a row that fail at a known place before guesses are tried."""

TURNED_GRID = (np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), np.arange(-320.0, 321.0, 80.0))
"""Delays and drifts tried around a place whose phases are known by its pilots."""

UNREADABLE = 10
"""Superframes in a row that cannot be read before the past is left alone."""

SURE = 5.0
"""Score of a candidate's own pilots at its refined place, in deviations, from which it is tried
with all means: of 20 true ones (standard, AAC 128k) 18 have more, of 47 that unmarked sound gave, 8
had. Others are tried briefly."""

SURE_TURNED = 6.0
"""The same of candidates whose bands are turned: of 33 that unmarked sound gave, 27 had less, of
38 true ones (five clips and eight ways of turning them), one."""

LOCK_IN = (
    (np.arange(-1.0, 1.1, 0.25), np.arange(-60.0, 61.0, 20.0)),
    (np.arange(-0.4, 0.5, 0.2), np.arange(-20.0, 21.0, 10.0)),
)
"""Delays and drifts tried with the decoded bits of the first superframe, from coarse to fine."""

SAME_PLACE, SAME_CLOCK = 1.0, 2e-4
"""A search that ends within so many samples of the place expected, and with a ratio that differs by
a smaller part from what was expected, has found nothing new."""


@dataclass(frozen=True, slots=True)
class _Heard:
    """A sound that is searched, and how it was mixed."""

    tape: StereoBuffer
    mix: ChannelMix


class AudioReceiver:
    """Receives superframes, block by block; any split into blocks gives the same output.

    A superframe is handed out at most 0.1 s after its last frame came in. Those that were on air up
    to 10 s before the lock follow it, in order.

    Parameters
    ----------
    fs : int
        Rate of the programme in Hz: 32000, 44100 or 48000.
    channels : int
        1 to 6, see `AudioEmbedder`.
    key : int
        Seed of the layout that the embedder used.
    guess : bool
        Whether it is guessed what happened to the sound where no mark is found: most of the cost of
        a search in vain.

    Attributes
    ----------
    patience : int
        Superframes in a row that may fail before the lock is given up; more pay where another
        carrier bears the same ones.

    Raises
    ------
    CueError
        If the format cannot carry a mark.

    Examples
    --------
    >>> receiver = AudioReceiver(48000, 2)
    >>> receiver.process(np.zeros((4800, 2), dtype=np.float32))
    []
    >>> receiver.locked
    False
    """

    def __init__(self, fs: int, channels: int, *, key: int = 0, guess: bool = True) -> None:
        check_format(fs, channels)
        self._guessing = guess
        self._fs, self._channels, self._key = fs, channels, key
        self._nominal = fs / FS
        self._quantum = SLOT_FRAMES * HOP * fs // FS
        self._reader = TrackReader(key, self._nominal)
        self._stretched = StretchedFollower(key, fs, self._nominal, self._reader)
        self._sounds = [SampleBuffer() for _ in range(channels)]
        self._mix = usual_mix(channels)
        self._tape = StereoBuffer()
        self._now = 0
        self._track: Track | None = None
        self._start_search(0.0)
        self._turned = RotatedSearch(key)
        self._stretch = int(STRETCH_S * fs)
        self._stretch_start = 0
        self._reset_guesses()
        self._last_start = self._last_told = -np.inf
        self._errors = self._counted = 0
        self._profile: AudioProfile | None = None
        self.first_lock_s: float | None = None
        self.patience = MAX_MISSES

    @property
    def locked(self) -> bool:
        """Whether superframes are being followed."""
        usual = self._track is not None and self._track.misses <= self.patience
        return usual or self._stretched.locked

    @property
    def profile(self) -> AudioProfile | None:
        """Profile that the signal announces, None before the first lock."""
        return self._profile

    @property
    def ber_estimate(self) -> float | None:
        """Share of wrong bits before decoding, None before the first superframe."""
        return self._errors / self._counted if self._counted else None

    def process(self, block: NDArray[np.float32]) -> list[ReceivedSuperframe]:
        """Take samples and return the superframes that they complete.

        Parameters
        ----------
        block : ndarray of float32, shape (n, channels)
            The next samples of the programme, of full scale 1; any n.

        Returns
        -------
        list of ReceivedSuperframe
        """
        x = checked_block(block, self._channels)
        for channel, sound in enumerate(self._sounds):
            sound.append(x[:, channel])
        found: list[ReceivedSuperframe] = []
        while self._now + self._quantum <= self._sounds[0].end:
            self._now += self._quantum
            found += self._step()
        return found

    def flush(self) -> list[ReceivedSuperframe]:
        """Return what the end of the programme still completes.

        Returns
        -------
        list of ReceivedSuperframe
        """
        padding = HOP + 2 * self._tape.reach(DECIMATION) + 2 * self._quantum
        return self.process(np.zeros((padding, self._channels), dtype=np.float32))

    def _step(self) -> list[ReceivedSuperframe]:
        found: list[ReceivedSuperframe] = []
        self._extend()
        while (candidate := self._next_candidate()) is not None:
            found += self._try(self._heard, self._origin, self._pace, candidate, self._equaliser)
        while self._track is not None and self._complete(self._track):
            found += self._follow(self._track)
        while self._stretched.complete(self._tape):
            found += self._follow_stretched()
        lost = self._track is None or self._track.misses >= FAILED_BEFORE_GUESSING
        if lost and self._stretched.misses >= FAILED_BEFORE_GUESSING:
            found += self._guess()
        kept_s = LONG_HISTORY_S if self._track is None else HISTORY_S
        for tape in (self._tape, *self._sounds):
            tape.forget(self._now - int(kept_s * self._fs))
        return found

    # Sound

    def _extend(self) -> None:
        """Mix what has arrived."""
        skew = self._mix.skew
        known = self._now - (math.ceil(abs(skew)) + self._tape.reach(1.0) if skew else 0)
        count = known - self._tape.end
        if count > 0:
            self._mix_to(self._tape, self._mix, count)

    def _mix_to(self, tape: StereoBuffer, mix: ChannelMix, count: int) -> None:
        """Append a mix, and what is beside it."""
        beside = self._mixed(mix.side, tape.end, count) if mix.side else np.zeros(count)
        tape.append_pair(self._mixed(mix, tape.end, count), beside)

    def _mixed(self, mix: ChannelMix, start: int, count: int) -> NDArray[np.float64]:
        out = np.zeros(count)
        for channel, (weight, sound) in enumerate(zip(mix.weights, self._sounds, strict=True)):
            if weight:
                late = mix.skew if channel == 1 else 0.0
                out += weight * sound.read(start + late, 1.0, count)
        return out

    def _use(self, mix: ChannelMix) -> None:
        """Listen to another mix from here on, and to what is remembered of it."""
        if mix != self._mix:
            self._mix, self._tape = mix, StereoBuffer(self._sounds[0].first)
            self._extend()

    # Searching

    def _next_candidate(self) -> Candidate | None:
        """Run the search over the sound that has arrived, up to its next candidate."""
        step = DECIMATION * self._pace
        while self._search is not None:
            count = self._search.needed
            start = self._origin + self._searched * step
            if start + count * step + self._tape.reach(step, LOW_REACH) > self._tape.end:
                return None
            self._searched += count
            candidate = self._search.process(self._tape.read(start, step, count, LOW_REACH))
            if candidate is not None:
                return candidate
        return None

    def _start_search(self, origin: float, track: Track | None = None) -> None:
        """Search from a place on, as the sound was on a track if there is one."""
        self._pace, self._offset, self._equaliser = self._nominal, 0.0, None
        if track is not None:
            self._pace, self._offset = track.ratio, track.offset
            self._equaliser = track.equaliser
        self._search: PilotSearch | None = PilotSearch(
            self._key,
            scale=2 ** (self._offset / 4),
            phases=self._equaliser.bins if self._equaliser and self._equaliser.used else None,
        )
        self._origin, self._searched = origin, 0

    def _try(
        self, heard: _Heard, origin: float, pace: float, candidate: Candidate,
        equaliser: Equaliser | None, *, delays: tuple[float, ...] = DELAYS,
    ) -> list[ReceivedSuperframe]:  # fmt: skip
        """Decode at a candidate's place, and lock there if the check accepts it."""
        position = origin + candidate.start * pace
        if position < self._last_start + 0.5 * SUPERFRAME * pace:
            return []
        demodulator = self._reader.demodulator(candidate.profile)
        ratio = pace * (1 + candidate.clock_ppm * 1e-6)
        own = demodulator.profile.levels_of(candidate.tier)
        track = Track(
            position, ratio, demodulator, own.start + 1 + self._offset,
            equaliser or Equaliser(demodulator.bands), self._offset,
        )  # fmt: skip
        sure = self._reader.pull_in(heard.tape, track, candidate) >= SURE
        levels = sorted(range(len(LEVELS)), key=lambda level: abs(level - own.start - 1.4))
        moved_levels = [level + self._offset for level in levels[:TRIED_LEVELS]]
        for moved, whole in self._places(heard, track, moved_levels, delays if sure else ()):
            raw = self._reader.view(heard.tape, moved)
            view = as_used(moved, raw)
            reading = demodulator.read(
                view, moved_levels, offset=self._offset, due=False, brief=not whole
            )
            if reading.decoded.l0 is not None:
                return self._lock(heard.mix, moved, raw, reading)
        return []

    def _places(
        self, heard: _Heard, track: Track, levels: list[float], delays: tuple[float, ...]
    ) -> Iterator[tuple[Track, bool]]:
        """Yield a candidate's place and, if it is to be tried by all means, variants.

        With each goes whether it is worth more than a brief attempt.
        """
        if not delays:
            yield track, False
            return
        for delay in delays:
            yield replace(track, position=track.position + delay * self._nominal), delay == 0
        raw = self._reader.view(heard.tape, track)
        if raw.paired:
            # More channels than two have all cells in the mid, and may have been mixed down.
            yield replace(track, pair=False), True
        else:
            yield from ((moved, True) for moved in self._reader.lone(track, raw, levels))

    def _reset_guesses(self) -> None:
        self._guesses: Iterator[ChannelHypothesis] | None = None
        self._last_stretch = (self._mix, 0), Stretch(StereoBuffer(), self._nominal)
        self._turned_at, self._turned_every = float(self._now + self._stretch), self._stretch / 2
        self._round = 0
        self._guess_at = self._now + PAUSES_S[0] * self._fs

    def _guess(self) -> list[ReceivedSuperframe]:
        """Listen again to the last seconds: for turned bands ever again, for all else at times."""
        if self._now < self._turned_at or not self._guessing:
            return []
        if self._guesses is None:
            self._turned_at = self._now + self._turned_every
            self._turned_every = min(self._turned_every * PATIENCE, MOST_SELDOM * self._stretch)
            found = self._try_guess(ChannelHypothesis(self._mix), self._now - self._stretch)
            if not found and self._recent:
                found = self._try_guess(
                    ChannelHypothesis(self._mix, stretched=True), self._now - self._stretch
                )
            if found or self._now < self._guess_at:
                return found
            self._stretch_start = self._now - self._stretch
            sound = [tape.read(self._stretch_start, 1.0, self._stretch) for tape in self._sounds]
            self._guesses = make_guesses(
                np.stack(sound, axis=1),
                again=self._round > 0,
                thorough=self._round % 2 == 1 or self._round + 1 == len(PAUSES_S),
            )
            self._turned_at = self._now
        tried = list(islice(self._guesses, GUESSES_PER_STEP))
        for guess in tried:
            if found := self._try_guess(guess, self._stretch_start):
                return found
        if not tried:
            self._guesses = None
            self._round = min(self._round + 1, len(PAUSES_S) - 1)
            self._guess_at = self._now + PAUSES_S[self._round] * self._fs
        return []

    def _try_guess(self, guess: ChannelHypothesis, start: int) -> list[ReceivedSuperframe]:
        """Search a stretch as if a guess were true."""
        if (guess.mix, start) != self._last_stretch[0]:
            tape = StereoBuffer(start)
            self._mix_to(tape, guess.mix, self._stretch)
            self._last_stretch = (guess.mix, start), Stretch(tape, self._nominal)
        stretch = self._last_stretch[1]
        heard = _Heard(stretch.tape, guess.mix)
        low = stretch.low(guess.speed, guess.stretch_s)
        if guess.stretched:
            return self._lock_stretched(heard, low, start)
        if guess.steps:
            for turned in self._turned.find(low, guess.steps):
                if found := self._try_turned(heard, turned):
                    return found
            return []
        best = search_stretch(self._key, low)
        if best is None or best.significance < LEAST_AT_SPEED:
            return []
        pace = self._nominal * guess.speed
        return self._try(heard, start, pace, best, None, delays=(0.0,))

    @property
    def _recent(self) -> bool:
        """Whether a mark was read not long ago."""
        return self._now - self._last_start < LONG_HISTORY_S * self._fs

    def _lock_stretched(
        self, heard: _Heard, low: NDArray[np.float64], start: int
    ) -> list[ReceivedSuperframe]:
        """Lock onto sound of another duration at its pitch, if a stretch of it tells of any."""
        tape = self._tape if heard.mix == self._mix else heard.tape
        found = self._stretched.lock(low, tape, start, self._last_told, known=self._recent)
        if found is None:
            return []
        self._use(heard.mix)
        self._track = self._search = None
        self._reset_guesses()
        self._profile = self._stretched.profile
        if self.first_lock_s is None:
            self.first_lock_s = self._now / self._fs
        return self._note(found)

    def _follow_stretched(self) -> list[ReceivedSuperframe]:
        """Read the superframe of stretched sound that is due; give the lock up where none is."""
        position = self._stretched.position
        found = self._note(self._stretched.follow(self._tape))
        if not self._stretched.locked:
            self._start_search(position)
        return found

    def _note(self, found: list[ReceivedSuperframe]) -> list[ReceivedSuperframe]:
        """Note where superframes of stretched sound were."""
        for superframe in found:
            self._last_told = superframe.position_s * self._fs
            if superframe.l0 is not None:
                self._last_start = self._last_told
        return found

    def _try_turned(self, heard: _Heard, candidate: RotatedCandidate) -> list[ReceivedSuperframe]:
        """Decode at a place whose bands have phases of their own, and lock there."""
        tape = heard.tape
        position = tape.first + candidate.start * self._nominal
        if position < self._last_start + 0.5 * SUPERFRAME * self._nominal:
            return []
        demodulator = self._reader.demodulator(candidate.profile)
        profile, pilots = demodulator.profile, make_pilots(self._key)
        tier = math.log2(candidate.step / profile.pilot_step(0))
        nearest = min(max(round(tier), 0), (len(LEVELS) - 1) // TIER_LEVELS)
        offset = TIER_LEVELS * (tier - nearest)
        known = KnownCells(pilots.cells, candidate.step, pilots.expected(candidate.profile))
        equaliser = Equaliser(demodulator.bands)
        track = Track(position, self._nominal, demodulator, 0.0, equaliser, offset)
        view = self._reader.view(tape, track)
        expected = pilots.expected(candidate.profile)
        _, delay, phases = path_of(score_phases(view, known, len(pilots.cells.dither)))
        track.position += delay * self._nominal
        view = self._reader.view(tape, track).turned(Equaliser(phases.size, phases).bins)
        self._reader.move(track, search_fit(view, known.cells, known.step, expected, TURNED_GRID))
        view = self._reader.view(tape, track)
        numbers = range(nearest * TIER_LEVELS, (nearest + 1) * TIER_LEVELS)
        levels = [number + offset for number in numbers]
        for equaliser, level in likely_phases(demodulator, view, known, levels):
            moved = replace(track, level=level, equaliser=equaliser)
            brief = candidate.significance < SURE_TURNED
            used = as_used(moved, view)
            reading = demodulator.read(used, [level], offset=offset, due=False, brief=brief)
            if reading.decoded.l0 is not None:
                return self._lock(heard.mix, moved, view, reading)
        return []

    def _lock(
        self, mix: ChannelMix, track: Track, raw: SuperframeView, reading: SuperframeReading
    ) -> list[ReceivedSuperframe]:
        """Take a track that was found; where it agrees with the one before, that one goes on."""
        self._use(mix)
        self._correct(track, raw, reading, wide=True)
        reading = self._reader.complete(self._tape, track, reading)
        known = self._track
        if known is not None and known.demodulator is track.demodulator:
            steps = round((track.position - known.position) / (SUPERFRAME * known.ratio))
            expected = known.ratio * (1 + known.bend) ** steps
            due = known.position + steps * SUPERFRAME * expected
            delay = (track.position - due) / self._nominal
            if abs(track.ratio / expected - 1) > SAME_CLOCK:
                if abs(delay) <= SAME_PLACE:
                    track.bend = known.bend
                    track.bent(expected)
            elif abs(delay) <= SAME_PLACE:
                track = replace(
                    known, position=due, level=track.level, misses=0,
                    equaliser=track.equaliser, offset=track.offset, pair=track.pair,
                )  # fmt: skip
                self._reader.nudge(track, delay)
        self._search = None
        self._stretched.forget()
        self._reset_guesses()
        self._track = track
        self._profile = track.demodulator.profile
        if self.first_lock_s is None:
            self.first_lock_s = self._now / self._fs
        return [*self._read_back(track), self._deliver(track, reading)]

    def _read_back(self, track: Track) -> list[ReceivedSuperframe]:
        """Read superframes that were on air before one that was found."""
        found: list[ReceivedSuperframe] = []
        past, failed = replace(track, bend=0.0), 0
        first = self._tape.first + (HOP if self._tape.first else -HOP) * track.ratio
        first = max(first, self._last_told + 0.5 * SUPERFRAME * track.ratio)
        while failed < UNREADABLE:
            past.position -= SUPERFRAME * past.ratio
            if past.position < first:
                break
            raw = self._reader.view(self._tape, past)
            reading = self._reader.read(self._tape, past, raw, due=False)
            if reading.decoded.l0 is None:
                for moved in self._reader.elsewhere(self._tape, past, raw):
                    again = self._reader.view(self._tape, moved)
                    reading = self._reader.read(self._tape, moved, again, due=False)
                    if reading.decoded.l0 is not None:
                        past, raw = moved, again
                        break
            failed = 0 if reading.decoded.l0 is not None else failed + 1
            if not failed:
                found.insert(0, received(past, reading, self._fs))
                self._reader.learn_back(past, raw, reading)
        return found

    # Following

    def _complete(self, track: Track) -> bool:
        end = track.position + (SUPERFRAME + HOP) * track.ratio + self._tape.reach(track.ratio)
        return end <= self._tape.end

    @property
    def _heard(self) -> _Heard:
        return _Heard(self._tape, self._mix)

    def _follow(self, track: Track) -> list[ReceivedSuperframe]:
        """Read the superframe that is due; note whether it arrived."""
        raw = self._reader.view(self._tape, track)
        reading = self._reader.read(self._tape, track, raw, due=True)
        if reading.decoded.l0 is not None:
            self._search, expected = None, track.ratio
            self._correct(track, raw, reading, wide=bool(track.bend))
            if track.bend:
                track.bent(expected)
            self._reader.settle_pair(self._tape, track, reading)
            return [self._deliver(track, reading)]
        for moved in self._reader.elsewhere(self._tape, track, raw):
            raw = self._reader.view(self._tape, moved)
            there = moved.pair != track.pair
            again = self._reader.read(self._tape, moved, raw, due=there)
            if again.decoded.l0 is not None:
                self._search, self._track = None, moved
                self._correct(moved, raw, again, wide=not there)
                if not track.misses and not there:
                    moved.bent(track.ratio)
                return [self._deliver(moved, again)]
        track.misses += 1
        if self._search is None:
            self._start_search(track.position, track)
        failed = self._deliver(track, reading, told=track.misses <= self.patience)
        if track.misses > max(self.patience, REMEMBERED):
            self._track = None
            self._start_search(track.position)
        return [failed] if track.misses <= self.patience else []

    def _correct(
        self, track: Track, raw: SuperframeView, reading: SuperframeReading, *, wide: bool = False
    ) -> None:
        """Let the decoded bits correct clock, level, phases and the cells' reliabilities."""
        demodulator = track.demodulator
        expected = demodulator.expected(reading.decoded)
        cells, step = demodulator.layout.cells, demodulator.profile.step(reading.level)
        weighted = expected * demodulator.trust(reading)
        if wide:
            for grid in LOCK_IN:
                view = as_used(track, self._reader.view(self._tape, track))
                self._reader.move(track, search_fit(view, cells, step, weighted, grid))
            raw = self._reader.view(self._tape, track)
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
            self._last_start = track.position
        if told:
            self._last_told = track.position
        track.advance()
        return result
