"""The audio receiver: a programme in blocks in, superframes out, from wherever one tunes in.

Searching: `PilotSearch` proposes places; a place counts when the link's check accepts what is read
there. Locked: the place of each next superframe is predicted, and corrected by the bits that were
decoded. A superframe that fails starts a new search beside the prediction, so that a splice is
found while a mere gap is bridged. Specification: section 7.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.audio.acquire import DECIMATION, Candidate, PilotSearch
from watermark.audio.align import Fit, find_delay, read_view, search_fit
from watermark.audio.demodulate import Demodulator, Reading
from watermark.audio.layout import make_pilots
from watermark.audio.masking import make_masker
from watermark.audio.mix import check_format, mid_of
from watermark.audio.profile import (
    FS,
    HOP,
    LEVELS,
    PILOT_STEPS,
    PROFILES,
    SLOT_FRAMES,
    SUPERFRAME,
    Profile,
)
from watermark.audio.resampling_tape import Tape
from watermark.link.superframe import ReceivedSuperframe

TRIED_LEVELS = 6
"""Levels at which a candidate is tried: those of its tier and one on either side."""

MAX_MISSES = 6
"""Superframes in a row that may fail before the lock of a lone carrier is given up."""

REMEMBERED = 16
"""Failed superframes after which a lock that was given up is forgotten: while the sound is too poor
for the search, a superframe at the old place may still be read."""

POLARITY_S = {1: 4.0, -1: 2.0}
"""How long the sound is searched as it is and with all its signs turned, in turn."""

HISTORY_S = 2.0
"""Sound that is kept, enough to search again from a superframe that failed."""


PULL_IN = (
    (np.arange(-2.5, 2.6, 0.5), np.arange(-80.0, 81.0, 40.0)),
    (np.arange(-0.75, 0.8, 0.25), np.arange(-40.0, 41.0, 20.0)),
)
"""Delays in samples and drifts in ppm tried around a candidate, from coarse to fine."""

LOCK_IN = (
    (np.arange(-1.0, 1.1, 0.25), np.arange(-60.0, 61.0, 20.0)),
    (np.arange(-0.4, 0.5, 0.2), np.arange(-20.0, 21.0, 10.0)),
)
"""Delays and drifts tried with the decoded bits of the first superframe, from coarse to fine."""

FOLLOW = 0.3
"""Delay tried on either side with the decoded bits of each following superframe, samples."""

SAME_PLACE = 1.0
"""A search that ends within so many samples of the place expected has found nothing new."""

LEAST_DELAY_GAIN, LEAST_PACE_GAIN = 0.2, 0.02
"""Parts of a measured delay by which an old lock corrects place and, per superframe, clock."""


@dataclass(slots=True)
class _Track:
    """Where the next superframe is expected and how it is written.

    Attributes
    ----------
    position : float
        Start on the tape, in samples.
    ratio : float
        Tape samples per sample of the mark.
    demodulator : Demodulator
        Of the profile.
    level : int
        Level of the superframe before.
    misses : int
        Superframes in a row that failed.
    age : int
        Superframes that corrected the place after the first.
    """

    position: float
    ratio: float
    demodulator: Demodulator
    level: int
    misses: int = 0
    age: int = 0

    def gains(self) -> tuple[float, float]:
        """Parts of the next delay by which place and clock are corrected.

        Those of a line through all places so far, until the loop is narrow enough: its memory then
        bridges superframes that fail. Source: expanding-memory filter, Morrison, "Introduction to
        Sequential Smoothing and Prediction", 1969.
        """
        n = self.age + 2
        place, pace = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1))
        return max(place, LEAST_DELAY_GAIN), max(pace, LEAST_PACE_GAIN)


class AudioReceiver:
    """Receives superframes, block by block; any split into blocks gives the same output.

    Parameters
    ----------
    fs : int
        Rate of the programme in Hz: 32000, 44100 or 48000.
    channels : int
        1 to 6, see `AudioEmbedder`.
    key : int
        Seed of the layout that the embedder used.

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

    def __init__(self, fs: int, channels: int, *, key: int = 0) -> None:
        check_format(fs, channels)
        self._fs, self._channels, self._key = fs, channels, key
        self._nominal = fs / FS
        self._quantum = SLOT_FRAMES * HOP * fs // FS
        self._demodulators: dict[int, Demodulator] = {}
        self._masker = make_masker()
        self._tape = Tape()
        self._polarity = 1
        self._now = 0
        self._track: _Track | None = None
        self._search: PilotSearch | None = PilotSearch(key)
        self._origin = 0.0
        self._searched = 0
        self._last_start = -np.inf
        self._errors = self._counted = 0
        self._profile: Profile | None = None
        self.first_lock_s: float | None = None
        self.patience = MAX_MISSES

    @property
    def locked(self) -> bool:
        """Whether superframes are being followed."""
        return self._track is not None and self._track.misses <= self.patience

    @property
    def profile(self) -> Profile | None:
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
        x = np.asarray(block, dtype=np.float64)
        if x.ndim != 2 or x.shape[1] != self._channels:
            raise CueError(f"block of shape {x.shape}, expected (n, {self._channels})")
        self._tape.append(self._polarity * mid_of(x))
        found: list[ReceivedSuperframe] = []
        while self._now + self._quantum <= self._tape.end:
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
        while (candidate := self._next_candidate()) is not None:
            found += self._try(candidate)
        while self._track is not None and self._complete(self._track):
            found += self._follow(self._track)
        if self._track is None and self._searched_s > POLARITY_S[self._polarity]:
            self._turn()
        self._tape.forget(self._now - int(HISTORY_S * self._fs))
        return found

    # Searching

    def _next_candidate(self) -> Candidate | None:
        """Run the search over the sound that has arrived, up to its next candidate."""
        step = DECIMATION * self._nominal
        while self._search is not None:
            count = self._search.needed
            start = self._origin + self._searched * step
            if start + count * step + self._tape.reach(step) > self._now:
                return None
            self._searched += count
            candidate = self._search.process(self._tape.read(start, step, count))
            if candidate is not None:
                return candidate
        return None

    def _start_search(self, origin: float) -> None:
        self._search = PilotSearch(self._key)
        self._origin, self._searched = origin, 0

    @property
    def _searched_s(self) -> float:
        return self._searched * DECIMATION / FS

    def _turn(self) -> None:
        """Look for a sound whose polarity was inverted on its way, or no longer for one."""
        self._polarity = -self._polarity
        self._tape.samples = -self._tape.samples
        self._start_search(self._now - SUPERFRAME * self._nominal)

    def _try(self, candidate: Candidate) -> list[ReceivedSuperframe]:
        """Decode at a candidate's place, and lock there if the check accepts it."""
        position = self._origin + candidate.start * self._nominal
        if position < self._last_start + 0.5 * SUPERFRAME * self._nominal:
            return []
        demodulator = self._demodulator(candidate.profile)
        ratio = self._nominal * (1 + candidate.clock_ppm * 1e-6)
        profile = demodulator.profile
        own = profile.levels_of(candidate.tier)
        track = _Track(position, ratio, demodulator, own.start + 1)
        self._pull_in(track, candidate)
        levels = sorted(range(len(LEVELS)), key=lambda level: abs(level - own.start - 1.4))
        levels = levels[:TRIED_LEVELS]
        for delay in (0.0, 0.5, -0.5):
            moved = replace(track, position=track.position + delay * self._nominal)
            reading = self._read(moved, levels, due=False)
            if reading.decoded.l0 is not None:
                return [self._lock(moved, reading)]
        return []

    def _lock(self, track: _Track, reading: Reading) -> ReceivedSuperframe:
        """Take a track that was found; where it agrees with the one before, that one goes on."""
        self._correct(track, reading, wide=True)
        known = self._track
        if known is not None and known.demodulator is track.demodulator:
            steps = round((track.position - known.position) / (SUPERFRAME * known.ratio))
            due = known.position + steps * SUPERFRAME * known.ratio
            delay = (track.position - due) / self._nominal
            if abs(delay) <= SAME_PLACE:
                track = replace(known, position=due, level=track.level, misses=0)
                self._nudge(track, delay)
        self._search = None
        self._track = track
        self._profile = track.demodulator.profile
        if self.first_lock_s is None:
            self.first_lock_s = self._now / self._fs
        return self._deliver(track, reading)

    def _demodulator(self, number: int) -> Demodulator:
        """Demodulator of a profile; what it learnt is kept for the next lock."""
        if number not in self._demodulators:
            profile = list(PROFILES.values())[number]
            self._demodulators[number] = Demodulator(profile, self._key)
        return self._demodulators[number]

    def _pull_in(self, track: _Track, candidate: Candidate) -> None:
        """Refine a candidate's place by its pilots."""
        pilots, step = make_pilots(self._key), PILOT_STEPS[candidate.tier]
        expected = pilots.expected(candidate.profile)
        for grid in PULL_IN:
            view = read_view(self._tape, track.position, track.ratio, self._masker)
            self._move(track, search_fit(view, pilots.cells, step, expected, grid))

    def _move(self, track: _Track, fit: Fit) -> None:
        """Shift a track by a fit."""
        track.position += fit.start_delay * self._nominal
        track.ratio *= 1 + fit.drift_ppm * 1e-6

    def _nudge(self, track: _Track, delay: float) -> None:
        """Correct a track by the delay that a superframe had, samples at 48 kHz."""
        place, pace = track.gains()
        track.position += place * delay * self._nominal
        track.ratio *= 1 + pace * delay / SUPERFRAME
        track.age += 1

    # Following

    def _complete(self, track: _Track) -> bool:
        end = track.position + (SUPERFRAME + HOP) * track.ratio + self._tape.reach(track.ratio)
        return end <= self._now

    def _read(self, track: _Track, levels: list[int], *, due: bool) -> Reading:
        view = read_view(self._tape, track.position, track.ratio, self._masker)
        return track.demodulator.read(view, levels, due=due)

    def _follow(self, track: _Track) -> list[ReceivedSuperframe]:
        """Read the superframe that is due; note whether it arrived."""
        view = read_view(self._tape, track.position, track.ratio, self._masker)
        levels = track.demodulator.likely_levels(view, track.level)
        reading = track.demodulator.read(view, levels)
        if reading.decoded.l0 is not None:
            self._search = None
            self._correct(track, reading)
            return [self._deliver(track, reading)]
        track.misses += 1
        if self._search is None:
            self._start_search(track.position)
        failed = self._deliver(track, reading)
        if track.misses > max(self.patience, REMEMBERED):
            self._track = None
        return [failed] if track.misses <= self.patience else []

    def _correct(self, track: _Track, reading: Reading, *, wide: bool = False) -> None:
        """Let the decoded bits correct the clock, the level and the cells' reliabilities."""
        demodulator = track.demodulator
        expected = demodulator.expected(reading.decoded)
        cells, step = demodulator.layout.cells, demodulator.profile.step(reading.level)
        weighted = expected * demodulator.reliability.weights(reading.clues)
        if wide:
            for grid in LOCK_IN:
                view = read_view(self._tape, track.position, track.ratio, self._masker)
                self._move(track, search_fit(view, cells, step, weighted, grid))
        else:
            delay = find_delay(reading.view, cells, step, weighted, FOLLOW)
            self._nudge(track, delay)
        demodulator.learn(reading)
        self._errors += int(((reading.soft * expected) < 0).sum())
        self._counted += int((expected != 0).sum())
        track.level, track.misses = reading.level, 0

    def _deliver(self, track: _Track, reading: Reading) -> ReceivedSuperframe:
        """Hand a superframe out and move the track to the next one."""
        agreement = reading.soft * track.demodulator.expected(reading.decoded)
        known = np.count_nonzero(agreement) or 1
        result = ReceivedSuperframe(
            l0=reading.decoded.l0,
            l1=reading.decoded.l1,
            position_s=track.position / self._fs,
            confidence=float(np.clip(agreement.sum() / known, 0.0, 1.0)),
            ber_estimate=float((agreement < 0).sum() / known),
            ratios=reading.llr,
        )
        if reading.decoded.l0 is not None:
            self._last_start = track.position
        track.position += SUPERFRAME * track.ratio
        return result
