"""Superframes that were on air before a lock: read as the purse pays, handed out in their order.

In: a track that was locked onto and the tape before it; out: superframes of the past, then those
read since. Specification: spec/audio-carrier.md, W37.
"""

from dataclasses import dataclass, field

from watermark.audio.follow.purse import CELLS, ELSEWHERE, LOST, PAST, VIEW, DecodingPurse
from watermark.audio.follow.track import Track, received
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.signal.profile import SUPERFRAME
from watermark.audio.signal.sample_buffer import StereoBuffer
from watermark.link.superframe import ReceivedSuperframe

UNREADABLE = 6
"""Superframes in a row that cannot be read before the past is left alone."""


@dataclass(slots=True)
class _Past:
    """The job of reading it.

    Attributes
    ----------
    track : Track
        The last superframe that was looked at.
    first : float
        Where the earliest may begin.
    until : float
        Place of the tape's end up to which the rest is waited for.
    failed : int
        Superframes that failed since the last one that was read.
    read : list of ReceivedSuperframe
        In their order.
    later : list of ReceivedSuperframe
        Those read since the lock, which are handed out after the past.
    """

    track: Track
    first: float
    until: float
    failed: int = 0
    read: list[ReceivedSuperframe] = field(default_factory=list)
    later: list[ReceivedSuperframe] = field(default_factory=list)

    @property
    def ended(self) -> bool:
        """Whether nothing is left to be read."""
        track = self.track
        return self.failed >= UNREADABLE or track.position - SUPERFRAME * track.ratio < self.first


class PastReader:
    """Reads what was on air before a lock.

    Parameters
    ----------
    fs : int
        Rate of the sound, Hz.
    reader : TrackReader
        That reads superframes.
    purse : DecodingPurse
        That pays for them.
    """

    def __init__(self, fs: int, reader: TrackReader, purse: DecodingPurse) -> None:
        self._fs, self._reader, self._purse = fs, reader, purse
        self._past: _Past | None = None

    @property
    def unread(self) -> bool:
        """Whether some of it is still to be read."""
        return self._past is not None

    def start(self, track: Track, first: float, until: float) -> None:
        """Begin before a track, back to a first place; wait for it until the tape ends at one."""
        self._past = _Past(track, first, until)

    def hold(self, found: list[ReceivedSuperframe]) -> list[ReceivedSuperframe]:
        """Keep superframes until those before the lock are read; return them if nothing is."""
        if self._past is None:
            return found
        self._past.later += found
        return []

    def end(self) -> list[ReceivedSuperframe]:
        """Read no more of it; hand out what was read since."""
        past, self._past = self._past, None
        return [] if past is None else [*past.read, *past.later]

    def read(self, tape: StereoBuffer, *, whole: bool = False) -> list[ReceivedSuperframe]:
        """Read as the purse pays; with `whole` read all now.

        Behind one that failed there may have been no mark: the next ones are read in brief.
        """
        while (past := self._past) is not None:
            if past.ended or (not whole and tape.end > past.until):
                return self.end()
            with self._purse.keeping(0.0 if whole else PAST):
                if not whole and not self._purse.has(VIEW + CELLS):
                    return []
            # What fails is tried further with some of what is kept from those that do not.
            with self._purse.keeping(0.0 if whole else LOST):
                self._read_before(tape, past)
        return []

    def _read_before(self, tape: StereoBuffer, job: _Past) -> None:
        """Read the superframe before those that were looked at."""
        past = job.track
        self._purse.charge(CELLS)
        past.position -= SUPERFRAME * past.ratio
        raw = self._reader.view(tape, past)
        reading = self._reader.read(tape, past, raw, due=False, brief=job.failed > 0)
        if reading.decoded.l0 is None and not job.failed:
            for moved in self._reader.elsewhere(tape, past, raw):
                if not self._purse.affords(ELSEWHERE):
                    break
                again = self._reader.view(tape, moved)
                reading = self._reader.read(tape, moved, again, due=False)
                if reading.decoded.l0 is not None:
                    job.track = past = moved
                    raw = again
                    break
        job.failed = 0 if reading.decoded.l0 is not None else job.failed + 1
        if not job.failed:
            job.read.insert(0, received(past, reading, self._fs))
            self._reader.learn_back(past, raw, reading)
