"""The audio receiver: a programme in blocks in, superframes out, from wherever one tunes in.

Searching: `PilotSearch` proposes places; a place counts when the link's check accepts what is read
there. Where it finds nothing, guesses about what happened to the sound are tried on its last
seconds, as a scheduler says (`watermark.audio.follow.hunting`). Locked: the place of each next
superframe is predicted, and corrected by the bits that were decoded. A superframe that fails starts
a new search beside the prediction, so that a splice is found while a mere gap is bridged. What was
heard before the lock is then read, too. Specification: spec/audio-carrier.md, W35 to W42 and W47.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.attempt import AcceptedAttempt, AssumedSound, CandidateReader
from watermark.audio.follow.following import TrackFollower
from watermark.audio.follow.hunting import HypothesisHunter
from watermark.audio.follow.purse import (
    DUE,
    FAILED_BEFORE_GUESSING,
    LOST,
    ON_CREDIT,
    SEARCH,
    DecodingPurse,
    Ventures,
)
from watermark.audio.follow.recurrence import PlacedCandidate, Recurrences
from watermark.audio.follow.stretched import StretchedFollower
from watermark.audio.follow.stretched_place import MAX_MISSES
from watermark.audio.follow.track import Track
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.search.acquire import Candidate
from watermark.audio.search.channel_mixes import ChannelMix, usual_mix
from watermark.audio.search.pilot_scan import DECIMATION, LOW_REACH, Sight
from watermark.audio.search.sliding_search import PilotSearch
from watermark.audio.search.sound_ring import SoundRing
from watermark.audio.signal.mix import check_format
from watermark.audio.signal.profile import FS, HOP, SLOT_FRAMES, SUPERFRAME, AudioProfile
from watermark.audio.signal.sample_buffer import StereoBuffer
from watermark.link.inputs import checked_block
from watermark.link.superframe import ReceivedSuperframe

HISTORY_S, HUNTED_S, LONG_HISTORY_S = 2.4, 6.0, 15.0
"""Sound that is kept while superframes are read, enough to search again from one that failed;
while hunting, for hypotheses on the present mix; and then of all channels, for what may be read of
it once the sound is understood."""


class AudioReceiver:
    """Receives superframes, block by block; any split into blocks gives the same output.

    A superframe is handed out at most 0.1 s after its last frame came in, 0.2 s where it cannot be
    read briefly soon after a lock, in stretched sound 1.5 s. Those that were on air up to 13 s
    before the lock are read first, as the purse pays: the first ones after a lock may wait up to
    4 s for them.

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
        Superframes in a row that may fail; more pay where another carrier bears the same.

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
        self._guessing, self._fs, self._channels, self._key = guess, fs, channels, key
        self._nominal = fs / FS
        self._quantum = SLOT_FRAMES * HOP * fs // FS
        self._ventures = Ventures(purse := DecodingPurse())
        self._purse = purse
        self._reader = TrackReader(key, self._nominal, self._purse)
        self._stretched = StretchedFollower(key, fs, self._nominal, self._reader)
        self._attempts = CandidateReader(key, self._nominal, self._reader)
        self._ring = SoundRing(channels, self._nominal)
        self._mix = usual_mix(channels)
        self._tape, self._now = StereoBuffer(kind=np.float32), 0
        self._follower = TrackFollower(fs, self._nominal, self._reader, self._purse)
        self._recurrences = Recurrences()
        self._start_search(0.0)
        self._hunter = HypothesisHunter(
            key, fs, channels, self._nominal, self._ring, self._attempts, self._follower,
            self._stretched, self._purse,
        )  # fmt: skip
        self._profile: AudioProfile | None = None
        self.first_lock_s: float | None = None
        self.patience = MAX_MISSES

    @property
    def locked(self) -> bool:
        """Whether superframes are being followed."""
        return self._follower.misses <= self.patience or self._stretched.locked

    @property
    def profile(self) -> AudioProfile | None:
        """Profile that the signal announces, None before the first lock."""
        return self._profile

    @property
    def ber_estimate(self) -> float | None:
        """Share of wrong bits before decoding, None before the first superframe."""
        return self._follower.ber_estimate

    @property
    def untried(self) -> int:
        """Attempts at decoding left out, as the sound had not paid for them."""
        return self._purse.untried

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
        x = checked_block(block, self._channels, np.float32)
        self._ring.append(x)
        found: list[ReceivedSuperframe] = []
        while self._now + self._quantum <= self._ring.end:
            self._now += self._quantum
            found += self._step()
        return found

    def flush(self) -> list[ReceivedSuperframe]:
        """Return the superframes that the end of the programme completes.

        Returns
        -------
        list of ReceivedSuperframe
        """
        rest = HOP + 2 * self._tape.reach(DECIMATION) + 2 * self._quantum
        found = self.process(np.zeros((rest, self._channels), dtype=np.float32))
        return found + self._follower.past.read(self._tape, whole=True)

    def _step(self) -> list[ReceivedSuperframe]:
        found = list[ReceivedSuperframe]()
        sound_s = self._quantum / self._fs
        self._purse.earn(sound_s, (self._now - max(self._follower.last_start, 0.0)) / self._fs)
        self._ventures.earn(sound_s)
        self._ring.extend(self._tape, self._mix, self._now)
        if self._search is not None:
            self._purse.charge(SEARCH * sound_s)
        # In this order: new candidates of the search, places that recur in several looks, the track
        # that is followed, the track in pieces, and the past of a track just found.
        while (candidate := self._next_candidate()) is not None:
            found += self._try(candidate)
        while self._search and (again := self._recurrences.due(self._tape)):
            found += self._read(again)
        while self._follower.complete(self._tape):
            found += self._follow()
        while self._stretched.complete(self._tape):
            found += self._follow_stretched()
        found += self._follower.past.read(self._tape)
        misses = min(self._follower.misses, self._stretched.misses)
        # Only a receiver that reads nothing pays for hypotheses about a changed channel.
        if misses >= FAILED_BEFORE_GUESSING and self._guessing:
            found += self._hunt()
        # Unread past superframes pin the buffer.
        reads = self._follower.misses < FAILED_BEFORE_GUESSING
        if not self._follower.past.unread:
            for tape, long_s in ((self._tape, HUNTED_S), (self._ring, LONG_HISTORY_S)):
                tape.forget(self._now - int((HISTORY_S if reads else long_s) * self._fs))
        return found

    def _use(self, mix: ChannelMix) -> None:
        """Listen to a mix from here on, and in all of memory."""
        if mix != self._mix or self._tape.first > self._ring.first:
            self._mix, self._tape = mix, StereoBuffer(self._ring.first, np.float32)
            self._ring.extend(self._tape, self._mix, self._now)

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
        self._recurrences.forget()
        self._search: PilotSearch | None = PilotSearch(
            self._key,
            scale=2 ** (self._offset / 4),
            phases=self._equaliser.bins if self._equaliser and self._equaliser.used else None,
        )
        self._origin, self._searched = origin, 0

    def _kept(self) -> float:
        """Part of the savings that hunting leaves for superframes which are due."""
        return DUE if self._follower.misses < FAILED_BEFORE_GUESSING else 0.0

    def _try(self, candidate: Candidate) -> list[ReceivedSuperframe]:
        """Try a candidate of the usual search."""
        start = self._origin + candidate.start * self._pace
        return self._read(self._recurrences.note(PlacedCandidate(start, self._pace, candidate)))

    def _read(self, placed: PlacedCandidate) -> list[ReceivedSuperframe]:
        """Decode at a candidate's place, and lock there if the check accepts it."""
        position, candidate = placed.position, placed.candidate
        sound = AssumedSound(placed.pace, self._offset, self._equaliser)
        new = self._follower.is_new(position, sound.pace)
        likely = candidate.significance >= ON_CREDIT
        kept = self._kept() or (LOST if self._guessing and not likely else 0.0)
        with self._purse.keeping(kept):
            if not new or not self._ventures.allows(candidate.significance):
                return []
            accepted = self._attempts.read(self._tape, position, candidate, sound, self._ventures)
        return [] if accepted is None else self._lock(self._mix, accepted)

    def _recent(self, rows: int) -> tuple[float, Sight] | None:
        """Return the sight of the usual search's last rows and where they begin, if it has it."""
        if self._search is None or self._pace != self._nominal:
            return None
        recent = self._search.recent(rows)
        return recent and (self._origin + recent[0] * self._pace, recent[1])

    def _hunt(self) -> list[ReceivedSuperframe]:
        """Listen again to the last seconds under the hypotheses that are due."""
        with self._purse.keeping(self._kept()):
            sound_s = self._quantum / self._fs
            found = self._hunter.hunt(self._now, sound_s, self._tape, self._mix, self._recent)
        if found is None:
            return []
        if found.accepted is not None:
            return self._lock(found.mix, found.accepted)
        self._use(found.mix)
        return self._go_on(found.superframes)

    def _go_on(self, found: list[ReceivedSuperframe]) -> list[ReceivedSuperframe]:
        """Follow stretched sound that was locked onto, after its first superframes."""
        self._follower.track = None
        self._locked_to(self._stretched.profile)
        return self._follower.past.end() + self._follower.note(found)

    def _follow_stretched(self) -> list[ReceivedSuperframe]:
        """Read the superframe of stretched sound that is due; give the lock up where none is."""
        position = self._stretched.position
        found = self._follower.note(self._stretched.follow(self._tape))
        if not self._stretched.locked:
            self._start_search(position)
        return found

    def _lock(self, mix: ChannelMix, accepted: AcceptedAttempt) -> list[ReceivedSuperframe]:
        """Follow the mark found in a mix."""
        self._use(mix)
        self._stretched.forget()
        self._locked_to(accepted.track.demodulator.profile)
        return self._follower.lock(self._tape, accepted)

    def _locked_to(self, profile: AudioProfile | None) -> None:
        self._search, self._profile = None, profile
        if self.first_lock_s is None:
            self.first_lock_s = self._now / self._fs

    def _follow(self) -> list[ReceivedSuperframe]:
        """Read the superframe that is due; search beside the track where it failed."""
        due = self._follower.track
        if due is None or (self._guessing and self._follower.doubts(self._tape)):
            return []
        usual = self._follower.doubted
        if usual is not None and (found := self._stretched.go_on(self._tape, due, usual)):
            return self._go_on(found)
        before = replace(due)
        found = self._follower.follow(self._tape, self.patience)
        if self._follower.track is None:
            self._start_search(before.position + SUPERFRAME * before.ratio)
        elif self._follower.misses == 0:
            self._search = None
        elif self._search is None:
            self._start_search(before.position, before)
        return found
