"""Hypotheses tried on the last seconds of sound, as the scheduler says, until a mark is read.

In: the ring of sound and the time; out: the mix with an accepted superframe, and its place.
Cost: `scheduler.SPEND` units of each second of sound, and the purse's payments for attempts at
outstanding places.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from watermark.audio.follow.attempt import (
    DELAYS,
    SURE_TURNED,
    AcceptedAttempt,
    AssumedSound,
    CandidateReader,
)
from watermark.audio.follow.following import SAME_PLACE, TrackFollower
from watermark.audio.follow.purse import DUE, PIECES_LOCK, RECENT_S, DecodingPurse, Ventures
from watermark.audio.follow.stretched import StretchedFollower
from watermark.audio.search.acquire import PERIOD, PLACE, Candidate
from watermark.audio.search.channel_mixes import ECHO, MID, ChannelMix, find_mix, usual_mix
from watermark.audio.search.hypotheses import STRETCH_S, ChannelHypothesis, PilotHypothesis
from watermark.audio.search.pilot_scan import Sight, rows_of
from watermark.audio.search.rotated_search import RotatedSearch
from watermark.audio.search.scheduler import PROMISING, HypothesisScheduler
from watermark.audio.search.sound_ring import SoundRing, Stretch
from watermark.audio.search.stretch_scores import StretchScores, higher_of_two, search_stretch
from watermark.audio.search.stretched_search import (
    LEAST,
    LEAST_KNOWN,
    StretchedCandidate,
    find_stretched,
)
from watermark.audio.signal.profile import HOP, SUPERFRAME, TIER_LEVELS
from watermark.audio.signal.sample_buffer import StereoBuffer
from watermark.link.superframe import ReceivedSuperframe

LEAST_GUESSED = 5.2
"""Least significance of a candidate under a hypothesis: tens of them are tried. With 5.5, and .8 in
place of `evidence.FADING`, marks are found half a second sooner, and 4 of 74 superframes of metal
behind a denoiser and of a piano whose clock drifts are lost; with 5 and .9 attempts cost more."""

Recent = Callable[[int], tuple[float, Sight] | None]
"""Gives the sight of the last rows, that many, and where they begin, if they are remembered."""

SURE_PIECES = 50.0
"""Least correlation of pilots of a candidate in pieces that promises to read the next one:
unmarked sound had less."""

WAITED_S = 3.0
"""Sound for which such a candidate waits until it is paid for."""


@dataclass(frozen=True, slots=True)
class _Pieces:
    """A candidate in pieces that is to be paid for.

    Attributes
    ----------
    candidate : StretchedCandidate
        What was found.
    guess : ChannelHypothesis
        Under which.
    mix : ChannelMix
        In which mix.
    tape : StereoBuffer or None
        That of a mix which is not the usual one.
    start, found : float
        Where the stretch began, and ended.
    """

    candidate: StretchedCandidate
    guess: ChannelHypothesis
    mix: ChannelMix
    tape: StereoBuffer | None
    start: float
    found: float


@dataclass(frozen=True, slots=True)
class HuntedMark:
    """A mark that was found.

    Attributes
    ----------
    mix : ChannelMix
        Where.
    accepted : AcceptedAttempt or None
        The superframe read; None in stretched sound, which is followed already.
    superframes : list of ReceivedSuperframe
        Read in stretched sound.
    """

    mix: ChannelMix
    accepted: AcceptedAttempt | None
    superframes: list[ReceivedSuperframe]


class HypothesisHunter:
    """Tries hypotheses.

    Parameters
    ----------
    key : int
        Seed of the layout.
    fs, channels : int
        Format of the sound.
    nominal : float
        Samples that come for one of the mark's own.
    ring : SoundRing
        The last seconds of sound.
    attempts : CandidateReader
        That reads at candidates.
    follower : TrackFollower
        That knows the superframes read already.
    stretched : StretchedFollower
        That reads sound of another duration at its pitch.
    purse : DecodingPurse
        That counts what attempts cost.
    """

    def __init__(
        self, key: int, fs: int, channels: int, nominal: float, ring: SoundRing,
        attempts: CandidateReader, follower: TrackFollower, stretched: StretchedFollower,
        purse: DecodingPurse,
    ) -> None:  # fmt: skip
        self._key, self._fs, self._nominal = key, fs, nominal
        self._ventures, self._purse = Ventures(purse), purse
        self._waiting: _Pieces | None = None
        self._ring, self._attempts = ring, attempts
        self._follower, self._stretched = follower, stretched
        self._turned, self._scheduler = RotatedSearch(key), HypothesisScheduler(channels)
        self._channels, self._count = channels, int(STRETCH_S * fs)

    def hunt(
        self, now: int, sound_s: float, tape: StereoBuffer, mix: ChannelMix, recent: Recent
    ) -> HuntedMark | None:
        """Try the hypotheses due at a time, after more sound; `tape` holds more of a mix."""
        self._scheduler.earn(sound_s)
        self._ventures.earn(sound_s)
        if now < self._count:
            return None
        if self._waiting is not None and (found := self._lock_pieces(now, tape)) is not None:
            return found
        while self._waiting is None:
            with self._purse.keeping(DUE):
                guess = self._scheduler.next(now / self._fs, self._purse.left)
            if guess is None:
                return None
            self._purse.charge(guess.cost)
            found = self._try(guess, now, tape, mix, recent)
            if found is not None:
                self._scheduler.remember(guess)
                return found
        return None

    def _try(
        self,
        guess: ChannelHypothesis,
        now: int,
        tape: StereoBuffer,
        usual: ChannelMix,
        recent: Recent,
    ) -> HuntedMark | None:
        """Search a stretch as if a hypothesis were true."""
        mix = usual_mix(self._channels)
        if guess.mix != MID:
            # What happened to the channels shows in more sound than one superframe.
            found_mix = find_mix(guess.mix, self._ring.read(now - self._count, self._count))
            if found_mix is None:
                self._purse.charge(-self._scheduler.give_back(guess))
                return None
            mix = found_mix
        count = int(guess.stretch_s * self._fs)
        start = now - count
        known = mix == usual and tape.first <= start and tape.end == now
        seen = recent(rows_of(guess.stretch_s)) if known and guess.speed == 1.0 else None
        if seen is not None and seen[0] >= tape.first:
            stretch = Stretch(tape, self._nominal, *seen)
        else:
            stretch = self._ring.stretch(mix, start, count, tape if known else None)
        if guess.kind is PilotHypothesis.STRETCHED:
            lately = now - self._follower.last_start < RECENT_S * self._fs
            sight = stretch.see(self._key, guess.speed, guess.stretch_s)
            candidate = find_stretched(self._key, sight, least=LEAST_KNOWN if lately else LEAST)
            score = 0.0 if candidate is None else candidate.score
            self._scheduler.note(guess, PROMISING * score / SURE_PIECES)
            if candidate is None:
                return None
            own = None if mix == usual else stretch.tape
            self._waiting = _Pieces(candidate, guess, mix, own, stretch.first, now)
            return self._lock_pieces(now, tape)
        turned = guess.kind is PilotHypothesis.TURNED
        accepted = self._try_turned(guess, stretch) if turned else self._try_plain(guess, stretch)
        return None if accepted is None else HuntedMark(mix, accepted, [])

    def _lock_pieces(self, now: int, tape: StereoBuffer) -> HuntedMark | None:
        """Try the candidate in pieces once it is paid for; give it up after a while."""
        one = self._waiting
        if one is None or (one.tape is None and one.start < tape.first):
            self._waiting = None
            return None
        if not self._purse.has(PIECES_LOCK):
            if now - one.found > WAITED_S * self._fs:
                self._waiting = None
                self._purse.untried += 1
            return None
        self._waiting = None
        sound = one.tape or tape
        if not self._stretched.lock(one.candidate, sound, one.start):
            return None
        found = self._stretched.begin(sound, self._follower.last_told)
        self._scheduler.remember(one.guess)
        return HuntedMark(one.mix, None, found)

    def _try_turned(self, guess: ChannelHypothesis, stretch: Stretch) -> AcceptedAttempt | None:
        """Try the likeliest places, and their neighbours, at phases of their own."""
        start, seen = stretch.first, stretch.see(self._key, guess.speed, guess.stretch_s)
        evidence, first = self._scheduler.evidence(guess), start / self._nominal
        likely = self._turned.find(seen, guess.steps, evidence, first)
        self._scheduler.note(guess, max((one.significance for one in likely), default=0.0))
        for candidate in likely:
            near = self._around(stretch, start + candidate.start * self._nominal)
            for position in near if candidate.significance >= SURE_TURNED else near[:1]:
                if self._ventures.allows(candidate.significance):
                    accepted = self._attempts.read_turned(
                        stretch.tape, position, candidate, self._ventures
                    )
                    if accepted is not None:
                        return accepted
        return None

    def _around(self, stretch: Stretch, position: float) -> list[float]:
        """Return where a superframe begins, and its neighbours that lie whole in a stretch."""
        pace = self._nominal
        whole = (SUPERFRAME + HOP) * pace + stretch.tape.reach(pace)
        near = [position, position + SUPERFRAME * pace, position - SUPERFRAME * pace]
        first, last = stretch.first, stretch.end - whole
        return [at for at in near if first <= at <= last and self._follower.is_new(at, pace)]

    def _try_plain(self, guess: ChannelHypothesis, stretch: Stretch) -> AcceptedAttempt | None:
        """Try the likeliest places of a stretch, and that which all stretches point to."""
        start, pace = stretch.first, self._nominal * guess.speed
        seen = stretch.see(self._key, guess.speed, guess.stretch_s)
        scores = [
            search_stretch(self._key, seen, gain=gain, exact=guess.exact, speed=guess.clock)
            for gain in guess.gains
        ]
        likely = [
            (one.best, gain)
            for one, gain in zip(scores, guess.gains, strict=True)
            if one.best is not None
        ]
        if guess.exact:
            likely.append(self._by_evidence(guess, scores, start / pace))
        tried: list[tuple[float, float]] = []
        # An echo by itself speaks for what made it.
        least = PROMISING if guess.mix == ECHO else 0.0
        self._scheduler.note(guess, max([least, *(one.significance for one, _ in likely)]))
        for candidate, gain in sorted(likely, key=lambda one: -one[0].significance):
            position = start + candidate.start * pace
            known = any(gain == g and abs(position - at) <= SAME_PLACE for at, g in tried)
            new = self._follower.is_new(position, pace) and not known
            if candidate.significance < LEAST_GUESSED or not new:
                continue
            if not self._ventures.allows(candidate.significance):
                continue
            tried.append((position, gain))
            sound = AssumedSound(pace * guess.clock, TIER_LEVELS * gain)
            accepted = self._attempts.read(
                stretch.tape, position, candidate, sound, self._ventures, delays=DELAYS[:1]
            )
            if accepted is not None:
                return accepted
        return None

    def _by_evidence(
        self, guess: ChannelHypothesis, scores: list[StretchScores], start: float
    ) -> tuple[Candidate, float]:
        """Return the place with the most evidence of all stretches, and its gain."""
        first = round(start / PLACE) + scores[0].first
        odd = first % 2
        peaks = np.concatenate([higher_of_two(one.peaks[:, odd:]) for one in scores])
        evidence = self._scheduler.evidence(guess)
        row, place, significance = evidence.add(peaks, (first + odd) // 2, PERIOD // 2)
        gain, pair = divmod(row, len(scores[0].peaks))
        candidate = scores[gain].candidate(pair, odd + 2 * place, significance)
        return candidate, guess.gains[gain]
