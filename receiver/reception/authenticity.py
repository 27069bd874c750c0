"""Whether the cues come from the broadcaster that the viewer trusts; what may be drawn of them.

Superframes as received go in, those that may be drawn come out: all of them at once where the
viewer only wants a notice, only verified ones, some seconds later, where he wants no others.
Specification: spec/authentication.md, section 6.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

from codec.authentication.announcement import Announcement
from codec.authentication.layout import number_at
from codec.authentication.verifier import Status, Verdict, Verifier
from codec.errors import BitstreamError
from codec.superframe.checks import proof_of, proved
from receiver.reception.events import SUPERFRAME_S, AuthenticityChanged, Event

_ON_GRID_S = 0.1
"""Most seconds between a superframe and the public clock's grid of the last one."""

_LONGEST_GAP = 64
"""Superframes that may be missing within a run; after more of them the blocks begin anew."""

_UNSIGNED = 4
"""Superframes in a row without a proof after which the cues count as unsigned."""


@dataclass(frozen=True, slots=True)
class Trust:
    """Whom the viewer trusts, and what he wants of others.

    Attributes
    ----------
    announcement : Announcement
    only_verified : bool
        Draw nothing else.
    clock : callable
        Gives the time at which a superframe at a position on the programme's clock was on air,
        seconds since 1970; None where nobody knows: that of the first keys then counts.
    tolerance_s : float
        How far the time on air by the keys may be from the clock's. Whoever can hold a programme
        back may forge it if he holds it back for less than this.
    likely_s : tuple of float
        Times at which a recording without a clock may have been on air, seconds since 1970: if one
        of them is right within an hour, it is verified sooner.

    Examples
    --------
    >>> from codec import SigningKey
    >>> key = SigningKey("Chaîne 1", bytes(32))
    >>> Trust(key.announce(1_800_000_000.0, days=1), only_verified=True).announcement.name
    'Chaîne 1'
    """

    announcement: Announcement
    only_verified: bool = False
    clock: Callable[[float], float | None] = lambda position_s: None
    tolerance_s: float = 60.0
    likely_s: tuple[float, ...] = ()


def _read(l0: bytes) -> tuple[bytes, tuple[int, int] | None]:
    """Return the bytes of a superframe that a proof covers, and its proof if it has one."""
    try:
        proof = proof_of(l0)
    except BitstreamError:
        return l0, None
    return (l0, None) if proof is None else (proved(l0), proof)


@dataclass(frozen=True, slots=True)
class Passed:
    """A superframe that may be drawn."""

    l0: bytes | None
    l1: bytes | None
    on_air_s: float


class Gate:
    """Stands between the carriers and the timeline of one stream.

    Parameters
    ----------
    trust : Trust
    """

    def __init__(self, trust: Trust) -> None:
        self._trust = trust
        self._verifier = Verifier(trust.announcement, trust.tolerance_s, trust.likely_s)
        self._base_s: float | None = None
        self._last = -1
        self._held: dict[int, Passed] = {}
        self._counts: Counter[str] = Counter()
        self._status: Status | Literal["unsigned"] = "unknown"
        self._reason = ""
        self._bare, self._was_signed = 0, False
        self._clock_s: float | None = None
        self._downgraded_s: float | None = None
        self._verified_s: float | None = None
        self._on_air_s: float | None = None

    def take(
        self, l0: bytes | None, l1: bytes | None, on_air_s: float
    ) -> tuple[list[Passed], list[Event]]:
        """Take a superframe; return the superframes to draw now, with the state of their proofs."""
        superframe = Passed(l0, l1, on_air_s)
        passed = [] if self._trust.only_verified else [superframe]
        if l0 is None:
            return passed, []
        passed += self._begin_anew_unless_it_fits(on_air_s)
        index = self._index_at(on_air_s)
        if index <= self._last:
            return passed, []
        self._last = index
        self._held[index] = superframe
        covered, proof = _read(l0)
        self._bare = 0 if proof is not None else self._bare + 1
        self._was_signed |= proof is not None
        utc_s = self._trust.clock(on_air_s)
        self._clock_s = utc_s
        verdicts = self._verifier.take(index, covered, proof, utc_s=utc_s)
        return passed + self._released(verdicts), self._told(on_air_s + SUPERFRAME_S)

    def finish(self) -> list[Passed]:
        """Return what may still be drawn: the stream has ended."""
        return self._released(self._verifier.finish())

    def settled_s(self, now_s: float) -> float:
        """Return the time up to which all that may be drawn has come out."""
        if not self._trust.only_verified or not self._held:
            return now_s
        return min(now_s, next(iter(self._held.values())).on_air_s)

    def summary(self) -> dict[str, Any]:
        """Return the state of proofs, under the names of the command line's JSON."""
        announcement = self._trust.announcement
        on_air = None if self._on_air_s is None else datetime.fromtimestamp(self._on_air_s, UTC)
        return {
            "of": announcement.name,
            "fingerprint": announcement.fingerprint,
            "status": self._status,
            "reason": self._reason,
            "age_s": None if self._verifier.age_s is None else round(self._verifier.age_s, 1),
            "holds": announcement.span,
            "verified_s": self._verified_s,
            "downgraded_s": self._downgraded_s,
            "on_air": None if on_air is None else on_air.isoformat(timespec="seconds"),
            "superframes": {name: self._counts[name] for name in ("verified", "unknown", "forged")},
        }

    def _index_at(self, on_air_s: float) -> int:
        assert self._base_s is not None
        return round((on_air_s - self._base_s) / SUPERFRAME_S)

    def _begin_anew_unless_it_fits(self, on_air_s: float) -> list[Passed]:
        """Begin a new run of blocks where the old one's grid ends."""
        if self._base_s is not None:
            index = self._index_at(on_air_s)
            error_s = on_air_s - self._base_s - index * SUPERFRAME_S
            if abs(error_s) < _ON_GRID_S and abs(index - self._last) <= _LONGEST_GAP:
                self._base_s += 0.05 * error_s  # clocks of sender and receiver drift
                return []
        left = self.finish()
        if self._base_s is not None:  # indices go on, so that times can be compared
            self._last = max(self._last + 1, self._index_at(on_air_s)) - 1
        self._base_s = on_air_s - (self._last + 1) * SUPERFRAME_S
        return left

    def _released(self, verdicts: list[Verdict]) -> list[Passed]:
        released = []
        for verdict in verdicts:
            superframe = self._held.pop(verdict.index)
            self._counts[verdict.status] += 1
            if verdict.status == "verified":
                released.append(Passed(superframe.l0, None, superframe.on_air_s))
        return released if self._trust.only_verified else []

    def _now(self) -> tuple[Status | Literal["unsigned"], str]:
        """Return the stream's status now, and why it is not verified."""
        if self._bare >= _UNSIGNED:
            if self._was_signed:
                return "unsigned", "signed cues were replaced by unsigned ones"
            return "unsigned", f"not signed, though {self._trust.announcement.name} signs"
        announcement, status = self._trust.announcement, self._verifier.status
        now_s = self._clock_s
        if status != "unknown" or now_s is None:
            return status, self._verifier.reason
        if not announcement.first <= number_at(now_s) < announcement.until:
            date = datetime.fromtimestamp(now_s, UTC).isoformat(timespec="minutes")
            return status, f"the key file holds {announcement.span}, not at {date}"
        return status, self._verifier.reason

    def _told(self, now_s: float) -> list[Event]:
        verifier, before = self._verifier, (self._status, bool(self._reason))
        self._status, self._reason = self._now()
        if (self._status, bool(self._reason)) == before:
            return []
        if self._downgraded_s is None and self._status == "unsigned":
            self._downgraded_s = round(now_s - _UNSIGNED * SUPERFRAME_S, 3)
        if self._verified_s is None and self._status == "verified":
            self._verified_s = round(now_s, 3)
            if verifier.on_air_s is not None and self._base_s is not None:
                self._on_air_s = verifier.on_air_s - self._base_s
        return [
            AuthenticityChanged(
                now_s, self._status, self._trust.announcement.name, self._reason, verifier.age_s
            )
        ]
