"""Who speaks in a stream that is being received: verdicts on its superframes, some seconds late.

A superframe is *verified* when 24 bits agree that cover it, under a key that leads to the announced
chain, and the clock says that it arrived soon after it was on air; *forged* when a block's checks
deny it, or it is from another time; *unknown* when no more proofs can come. Specification:
spec/authentication.md, section 6.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from codec.authentication.announcement import Announcement
from codec.authentication.chain import agreeing, tag_of
from codec.authentication.checks import agree
from codec.authentication.first_edition import MESSAGE as FIRST_EDITION
from codec.authentication.first_edition import is_first_edition
from codec.authentication.layout import LAYOUTS, SUPERFRAME_S, ProofLayout, time_of
from codec.authentication.received import ArrivedSuperframe, ReceivedProofs
from codec.authentication.search import ChainSearch, KnownKey

Status = Literal["unknown", "verified", "forged"]

_FAR_STEPS = 4
"""Steps of the chain up to which all hidden bits are tried by the chain alone; beyond, the quick
tag sorts them first: it is one hash, not many."""

_OTHERS = 8
"""Superframes in a row with fields of another width after which the stream is taken to have gone
over to it: fewer may be somebody else's."""

_MISSES = 2
"""Blocks in a row with keys of nobody's after which the stream's place is looked for anew."""

_WAIT = 5
"""Blocks after which a superframe's verdict is given: its own, that of its checks, and three more
for a key that was lost."""

_LOCATING = 4
"""Spare checks where one changed superframe is looked for: 24 bits, and 24 for the many that are
tried."""

_CHANGED = "changed on its way"


@dataclass(frozen=True, slots=True)
class Verdict:
    """The final verdict on a superframe.

    Attributes
    ----------
    index : int
        As it was taken.
    status : str
        ``verified``, ``unknown`` or ``forged``.
    reason : str
        Why it is forged.
    """

    index: int
    status: Status
    reason: str = ""


@dataclass(slots=True)
class Verifier:
    """Checks one stream, from any place on, against one broadcaster's announcement.

    Parameters
    ----------
    announcement : Announcement
    tolerance_s : float
        How far the time on air, by the keys, may be from the time of arrival by the clock; where no
        superframe has a time of arrival, from the time that the first key implies.
    likely_s : tuple of float
        Times at which superframes may have been on air, seconds since 1970: where no clock is
        given, the first key is found sooner if one of them is right.

    Attributes
    ----------
    status : str
        Of the stream: that of its last block with a known key.
    reason : str
        Why it is not verified.
    verified_after : int or None
        Superframes from the first one to the first time that the stream was verified.
    age_s : float or None
        How long ago the last superframe that was checked had been on air when it arrived; None
        without a clock.
    """

    announcement: Announcement
    tolerance_s: float = 60.0
    likely_s: tuple[float, ...] = ()
    status: Status = "unknown"
    reason: str = ""
    verified_after: int | None = None
    age_s: float | None = None
    _received: ReceivedProofs = field(default_factory=ReceivedProofs)
    _open: deque[int] = field(default_factory=deque)
    _first: int | None = None
    _last: int = 0
    _offset: int | None = None
    _first_offset: int | None = None
    _has_clock: bool = False
    _latest: dict[int, KnownKey] = field(default_factory=dict)
    _known: KnownKey | None = None
    _pending: list[int] = field(default_factory=list)
    _next: int = 0
    _misses: int = 0
    _others: int = 0
    _first_edition: bool | None = None
    _search: ChainSearch = field(init=False)

    def __post_init__(self) -> None:
        self._search = ChainSearch(self.announcement, self.tolerance_s, self.likely_s)

    @property
    def on_air_s(self) -> float | None:
        """When superframe 0 was on air by the keys, seconds since 1970 (UTC)."""
        return None if self._offset is None else time_of(self._offset)

    @property
    def _layout(self) -> ProofLayout:
        return self._received.layout

    def take(
        self,
        index: int,
        covered: bytes | None,
        proof: tuple[int, int] | None,
        *,
        utc_s: float | None = None,
    ) -> list[Verdict]:
        """Take the next superframe of the stream; return verdicts in order of the indices.

        Parameters
        ----------
        index : int
            Grows with time on air; missing numbers are lost superframes.
        covered : bytes or None
            The bytes that the tags cover; None if lost.
        proof : (int, int) or None
            The field and its width; None if there is none.
        utc_s : float or None
            When it arrived by a clock that one trusts, seconds since 1970.
        """
        if self._first is None:
            self._first = index
        self._last = index
        if covered is not None:
            self._has_clock |= utc_s is not None
            self._received.by_index[index] = ArrivedSuperframe(covered, proof, utc_s)
            self._open.append(index)
            self._follow_width(proof)
        # Locked: check blocks as they end. Otherwise look for where blocks begin, in this edition,
        # then in the first one.
        if self._offset is not None:
            self._settle_until(index)
        if self._offset is None:
            found = self._search.look(self._received, index, self._latest.get(self._layout.width))
            if found is not None:
                self._lock(found, index - self._layout.block + 1)
            elif self._first_edition is None and self._first_offset is None:
                known, width = self._received.by_index, self._layout.width
                self._first_edition = is_first_edition(known, index, width)
                self.reason = FIRST_EDITION if self._first_edition else self.reason
        verdicts = list(self._decided(index))
        self._forget(index)
        return verdicts

    def finish(self) -> list[Verdict]:
        """Return the verdicts that were still open; the stream has ended or begins anew."""
        left = [self._verdict(index) for index in self._open]
        self._received.by_index.clear()
        self._open.clear()
        self._unlock()
        self._first = None
        return left

    def _follow_width(self, proof: tuple[int, int] | None) -> None:
        """Go over to fields of another width when enough of them have come."""
        if proof is None or proof[1] == self._layout.width:
            self._others = 0
            return
        self._others += 1
        if self._others >= _OTHERS:
            self._received.layout = LAYOUTS[proof[1]]
            self._others = 0
            self._unlock()

    def _unlock(self) -> None:
        """Look for the stream's place anew; the latest key stays known."""
        self._search.restart(found=self._offset is not None)
        self._offset = self._known = None
        self._pending.clear()
        self._misses = 0

    def _lock(self, known: KnownKey, begin: int) -> None:
        """Begin with the first key that was found: that of the block at index `begin`."""
        layout = self._layout
        block = known.period * layout.blocks + known.place
        self._offset = block * layout.block - begin
        if self._first_offset is None:
            self._first_offset = self._offset
        oldest = (min(self._received.by_index) + self._offset) // layout.block
        self._pending = list(range(oldest, block + 1))
        self._next = block + 1
        self._learn(known)

    def _settle_until(self, index: int) -> None:
        """Find the keys of the blocks that have ended, and check what they prove."""
        while self._offset is not None:
            block = self._next
            if (block + 1) * self._layout.block - 1 > index + self._offset:
                return
            self._next += 1
            self._pending.append(block)
            self._settle(block, block * self._layout.block - self._offset)

    def _settle(self, block: int, begin: int) -> None:
        """Find the key of a block; without it, those of later blocks lead to it."""
        period, place = divmod(block, self._layout.blocks)
        if block not in self.announcement.blocks(self._layout.block):
            self.status, self.reason = "unknown", f"the key file holds {self.announcement.span}"
            return
        keys = self._keys_of(period, place, begin)
        if keys:
            self._misses = 0
            self._learn(KnownKey(period, place, keys[0]))
        elif keys is not None:
            self._misses += 1
            self.status, self.reason = "forged", "its keys are not the broadcaster's"
            if self._misses >= _MISSES:
                self._unlock()
        elif len(self._pending) >= _WAIT:
            self.status, self.reason = "unknown", "no proofs arrive"

    def _keys_of(self, period: int, place: int, begin: int) -> list[bytes] | None:
        """Return the block's key if its fields say one that leads to the chain; None if lost."""
        width, sent = self._layout.width, self._received.sent(begin)
        if sent is None:
            return None
        known = self._known
        if known is None or known.period != period:
            known = KnownKey(period, -1, self.announcement.end_of(period, width))
        chain, steps = self.announcement.chain(period, width), place - known.place
        if steps <= _FAR_STEPS:
            key = chain.find(sent, place, known.key, steps)
            return [] if key is None else [key]
        quick = self._received.quick(begin)
        if quick is None:
            return None
        distance = self._layout.block - self._layout.quick
        keys = agreeing(self.announcement.channel, sent, distance, quick[1], quick[0])
        return [key for key in keys if chain.before(key, place, steps) == known.key]

    def _learn(self, known: KnownKey) -> None:
        """Check all blocks whose keys follow from this one."""
        layout, self._known = self._layout, known
        latest = self._latest.get(layout.width)
        if latest is None or (known.period, known.place) > (latest.period, latest.place):
            self._latest[layout.width] = known
        chain = self.announcement.chain(known.period, layout.width)
        for block in self._pending:
            period, place = divmod(block, layout.blocks)
            if period == known.period:
                self._check(block, chain.before(known.key, known.place, known.place - place))
        self._pending.clear()

    def _check(self, block: int, key: bytes) -> None:
        """Compare the tags of a block, whose key is known, with what arrived."""
        layout, received = self._layout, self._received
        assert self._offset is not None
        begin = block * layout.block - self._offset
        before, channel = begin - layout.block, self.announcement.channel
        agreed: set[int] = set()
        denied: set[int] = set()
        changed = False
        quick = received.quick(begin)
        if quick is not None:
            changed = tag_of(channel, key, layout.block - layout.quick, quick[1]) != quick[0]
            agreed |= set() if changed else {begin + layout.quick}
        tags = {
            index - before: tag_of(channel, key, begin + layout.block - index, arrived.covered)
            for index, arrived in received.between(before, begin).items()
        }
        if any(received.checks(begin).values()):  # else nothing was sent before
            wrong = self._wrong(begin, tags)
            if wrong is not None:
                denied = {before + place for place in wrong}
                agreed |= {before + place for place in tags} - denied
        late = self._late(before, begin + layout.block)
        for index in agreed | denied:
            arrived = received.by_index[index]
            if index in agreed and not late:
                arrived.agreed, arrived.reason = True, ""
            elif not arrived.agreed:
                arrived.agreed, arrived.reason = False, late or _CHANGED
        if late or changed or denied:
            self.status, self.reason = "forged", late or _CHANGED
        elif agreed:
            self.status, self.reason = "verified", ""
            if self.verified_after is None and self._first is not None:
                self.verified_after = self._last + 1 - self._first

    def _wrong(self, begin: int, tags: dict[int, int]) -> list[int] | None:
        """Return the places of superframes of the block before that differ from those sent.

        None if too many were lost to say it.
        """
        layout, received = self._layout, self._received
        before, checks = begin - layout.block, received.checks(begin)
        missing = [place for place in range(layout.block) if place not in tags]
        whole = agree(checks, tags, missing)
        if whole is None and self._first is not None:  # the first ones may never have been sent
            lost = [place for place in missing if before + place > self._first]
            return [] if agree(checks, tags, lost) else None
        if whole is None or whole:
            return None if whole is None else []
        for index in received.between(before, begin + layout.block):
            place = index - before
            rest = {at: tag for at, tag in tags.items() if at != place}
            told = received.checks(begin, without=index)
            if agree(told, rest, set(missing) | ({place} & set(tags)), spare=_LOCATING):
                return [place] if place in tags else []
        return list(tags)

    def _late(self, first: int, stop: int) -> str:
        """Return why these superframes are from another time, "" if they are not."""
        assert self._offset is not None
        assert self._first_offset is not None
        ages = [
            arrived.utc_s - time_of(index + self._offset)
            for index, arrived in self._received.between(first, stop).items()
            if arrived.utc_s is not None
        ]
        if ages:
            self.age_s = ages[-1]
            away_s = max(ages, key=abs)
        elif self._has_clock:
            return "without a time of arrival"
        else:
            away_s = (self._first_offset - self._offset) * SUPERFRAME_S
        if abs(away_s) <= self.tolerance_s:
            return ""
        return f"from another time, {away_s:.0f} s old; {self.tolerance_s:g} s are allowed"

    def _decided(self, index: int) -> Iterator[Verdict]:
        """Yield the verdicts that later superframes cannot change."""
        latest = index - _WAIT * self._layout.block
        while self._open:
            oldest = self._open[0]
            if self._received.by_index[oldest].agreed is None and oldest > latest:
                return
            self._open.popleft()
            yield self._verdict(oldest)

    def _verdict(self, index: int) -> Verdict:
        arrived = self._received.by_index[index]
        if arrived.agreed is None:
            return Verdict(index, "unknown")
        return Verdict(index, "verified" if arrived.agreed else "forged", arrived.reason)

    def _forget(self, index: int) -> None:
        known, oldest = self._received.by_index, index - (_WAIT + 1) * self._layout.block
        for old in [at for at in known if at < oldest]:
            del known[old]
