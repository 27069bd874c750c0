"""Candidates that come again a whole number of superframes later: what chance hardly does.

Under a voice, or through coders, pilots of a superframe stand out only now and then, and the first
ones that do may not be readable. In: candidates of the usual search; out: those that lie in step
with an earlier one, as likely as they then are, and the places of superframes after these. In
unmarked sound one candidate of some thousands is in step with another by chance.
Specification: spec/audio-carrier.md, W35.
"""

from collections import deque
from dataclasses import dataclass, field, replace

from watermark.audio.search.acquire import Candidate
from watermark.audio.signal.profile import HOP, SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer

REMEMBERED = 12
"""Superframes after which a candidate is forgotten, after one in step that are tried where they
should lie, and failed ones after which a lock that was given up is forgotten: while the sound is
too poor for the search, a superframe at the old place may still be read."""

NEAR, CLOCK = 2.0, 6e-5
"""Most samples between a candidate and its place, and the greatest error of clocks as a part of
the time between two."""

IN_STEP = 7.0
"""Significance of candidates in step: their pilots leave no doubt."""


@dataclass(frozen=True, slots=True)
class PlacedCandidate:
    """A candidate and where it begins.

    Attributes
    ----------
    position : float
        Samples of the tape.
    pace : float
        Samples of the tape that come for one of the mark's own.
    candidate : Candidate
        As the search gave it, or more significant.
    """

    position: float
    pace: float
    candidate: Candidate


@dataclass(slots=True)
class Recurrences:
    """Remembers candidates and tells which of them are in step."""

    _seen: deque[PlacedCandidate] = field(default_factory=deque)
    _last: PlacedCandidate | None = None
    _left: int = 0

    def forget(self) -> None:
        """Begin anew: the sound is searched otherwise."""
        self._seen.clear()
        self._last = None

    def note(self, found: PlacedCandidate) -> PlacedCandidate:
        """Remember a candidate; return it, more significant if it is in step with another."""
        superframe = SUPERFRAME * found.pace
        while self._seen and found.position - self._seen[0].position > REMEMBERED * superframe:
            self._seen.popleft()
        in_step = any(self._in_step(one, found) for one in self._seen)
        self._seen.append(found)
        if not in_step:
            return found
        self._last, self._left = found, REMEMBERED
        return self._sure(found)

    def due(self, tape: SampleBuffer) -> PlacedCandidate | None:
        """Return the next superframe in step, if it has arrived whole."""
        last = self._last
        if last is None:
            return None
        position = last.position + SUPERFRAME * last.pace
        if position + (SUPERFRAME + HOP) * last.pace + tape.reach(last.pace) > tape.end:
            return None
        self._left -= 1
        self._last = replace(last, position=position) if self._left else None
        return self._sure(replace(last, position=position))

    @staticmethod
    def _in_step(one: PlacedCandidate, other: PlacedCandidate) -> bool:
        apart = (other.position - one.position) / other.pace
        count = round(apart / SUPERFRAME)
        beside = abs(apart - count * SUPERFRAME)
        same = one.candidate.profile == other.candidate.profile
        return same and count > 0 and beside <= NEAR + CLOCK * apart

    @staticmethod
    def _sure(found: PlacedCandidate) -> PlacedCandidate:
        sure = max(found.candidate.significance, IN_STEP)
        return replace(found, candidate=replace(found.candidate, significance=sure))
