"""Who speaks in a stream that is being received: verdicts on its superframes, some seconds late.

A superframe is *verified* when tags of `NEEDED_BITS` bits that cover it agree under keys that lead
to the announced chain; *forged* when a tag of which nothing is missing does not, or when the keys
are those of another time; *unknown* when no more tags can come. Specification:
spec/authentication.md, section 5.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from codec.authentication.announcement import Announcement
from codec.authentication.chain import Chain, agreeing, digest_of, tag_of
from codec.authentication.layout import (
    LAYOUTS,
    NEEDED_BITS,
    PERIOD,
    SENT_BITS,
    SUPERFRAME_S,
    ProofLayout,
    Tag,
    number_at,
    time_of,
)

Status = Literal["unknown", "verified", "forged"]

_FAR_STEPS = 4
"""Steps of the chain up to which all hidden bits are tried by the chain alone; beyond, the quick
tag sorts them first: it is one hash, not many."""


_STRIDES = (1, 3, 5, 7)
"""Every so manyth superframe is tried as a block's last one while no key is found, more seldom
after every four blocks in vain: trying costs as much as all other reception. No stride shares a
factor with the length of a block, so that each place has its turn."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is known of a superframe for good.

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
class _SeenSuperframe:
    """A superframe of the stream, and what speaks for it."""

    covered: bytes
    proof: int
    utc_s: float | None
    agreed_bits: int = 0
    denied: str = ""


@dataclass(frozen=True, slots=True)
class _Known:
    """A key of the chain: that of the block at `place` in its period; -1 is the chain's end."""

    period: int
    place: int
    key: bytes


@dataclass(slots=True)
class Verifier:
    """Checks one stream, from any place on, against one broadcaster's announcement.

    Parameters
    ----------
    announcement : Announcement
    tolerance_s : float
        How far the time that the keys tell may be from the time at which superframes arrive, or
        from that of the first ones where no clock is given.
    likely_s : tuple of float
        Times at which superframes may have been on air, seconds since 1970: where no clock is
        given, the first key is found sooner if one of them is right.

    Attributes
    ----------
    status : str
        Of the stream: that of its last block of which the key is known.
    verified_after : int or None
        Superframes from the first one to the first time that the stream was verified.
    on_air_s : float or None
        When superframe 0 was on air by the keys, seconds since 1970 (UTC).
    """

    announcement: Announcement
    tolerance_s: float = 60.0
    likely_s: tuple[float, ...] = ()
    status: Status = "unknown"
    reason: str = ""
    verified_after: int | None = None
    _layout: ProofLayout = LAYOUTS[9]
    _seen: dict[int, _SeenSuperframe] = field(default_factory=dict)
    _open: deque[int] = field(default_factory=deque)
    _first: int | None = None
    _offset: int | None = None
    _told_offset: float | None = None
    _known: _Known | None = None
    _unsettled: set[int] = field(default_factory=set)
    _settled_until: int = 0
    _tried: int = 0

    @property
    def on_air_s(self) -> float | None:
        """When superframe 0 was on air by the keys, seconds since 1970 (UTC)."""
        return None if self._offset is None else time_of(self._offset)

    def take(
        self, index: int, covered: bytes | None, proof: tuple[int, int] | None,
        *, utc_s: float | None = None,
    ) -> list[Verdict]:  # fmt: skip
        """Take the next superframe of the stream; return verdicts in order of the indices.

        Parameters
        ----------
        index : int
            Grows with time on air; what is left out was lost.
        covered : bytes or None
            What the tags cover; None if it was lost.
        proof : (int, int) or None
            The field and its width; None if there is none.
        utc_s : float or None
            When it was on air by a clock that one trusts, seconds since 1970.
        """
        if self._first is None:
            self._first = index
        if covered is not None:
            if proof is not None and proof[1] != self._layout.width:
                self._use(LAYOUTS[proof[1]])
            value = -1 if proof is None else proof[0]
            self._seen[index] = _SeenSuperframe(covered, value, utc_s)
            self._open.append(index)
        if self._offset is None:
            self._look_for_keys(index)
        else:
            self._settle_until(index)
        verdicts = list(self._decided(index))
        self._forget(index)
        return verdicts

    def finish(self) -> list[Verdict]:
        """Return the verdicts that were still open; the stream has ended or begins anew."""
        left = [self._verdict(index) for index in self._open]
        self._seen.clear()
        self._open.clear()
        self._unsettled.clear()
        self._first = self._offset = self._known = None
        return left

    def _use(self, layout: ProofLayout) -> None:
        """Go over to fields of another width: blocks begin anew."""
        self._layout = layout
        self._offset = self._known = None
        self._unsettled.clear()

    def _window(self, begin: int, tag: Tag) -> tuple[dict[int, bytes], bool]:
        """Return what is there of a tag's superframes, by distance, and whether all of it is."""
        end = begin + self._layout.block
        there = {
            distance: self._seen[end - distance].covered
            for distance in range(tag.nearest, tag.farthest + 1)
            if end - distance in self._seen
        }
        return there, len(there) == tag.reach

    def _look_for_keys(self, index: int) -> None:
        """Try whether the last superframes were a block of this broadcaster's."""
        layout = self._layout
        stride = _STRIDES[min(self._tried // (4 * layout.block), len(_STRIDES) - 1)]
        begin = index - layout.block + 1
        if index % stride:
            return
        whole, quick, sent = self._told(begin)
        window, complete = self._window(begin, layout.quick)
        if quick is None or sent is None or not complete:
            return
        self._tried += 1
        keys = agreeing(sent, digest_of(window), layout.quick, quick)
        window, complete = self._window(begin, layout.whole)
        digest = digest_of(window)
        sure = [key for key in keys if whole == tag_of(key, digest, layout.whole)]
        utc_s = self._seen[index].utc_s
        if not sure and complete and whole is not None:
            return
        for key in sure or keys:
            found = self._locate(key, self._likely_periods(utc_s, every=bool(sure)))
            if found is not None:
                self._lock(found, begin)
                return

    def _locate(self, key: bytes, periods: Iterable[int]) -> _Known | None:
        """Return which key of which period this is."""
        width = self._layout.width
        for period in periods:
            end = self.announcement.end_of(period, width)
            chain, earlier = self.announcement.chain(period, width), key
            for place in range(self._layout.blocks):
                earlier = chain.before(earlier)
                if earlier == end:
                    return _Known(period, place, key)
        return None

    def _likely_periods(self, utc_s: float | None, *, every: bool) -> Iterable[int]:
        """Return the periods in which a block may be: about a time, or all, if there is none."""
        periods = self.announcement.periods
        if utc_s is None and every:
            return reversed(periods)
        reach_s = max(self.tolerance_s, PERIOD * SUPERFRAME_S)
        times = self.likely_s if utc_s is None else (utc_s,)
        return sorted({
            period
            for time_s in times
            for away_s in (-reach_s, 0.0, reach_s)
            for period in (int(number_at(time_s + away_s) // PERIOD),)
            if period in periods
        })  # fmt: skip

    def _lock(self, known: _Known, begin: int) -> None:
        """Begin with the first key that was found: that of the block at index `begin`."""
        layout = self._layout
        self._known, self._tried = known, 0
        self._offset = known.period * PERIOD + known.place * layout.block - begin
        if self._told_offset is None:
            self._told_offset = float(self._offset)
        block = (begin + self._offset) // layout.block
        oldest = (min(self._seen) + self._offset) // layout.block
        self._unsettled = set(range(oldest, block + 1))
        self._settled_until = block + 1
        self._check_time(begin)
        self._settle(known)

    def _check_time(self, begin: int) -> None:
        """Compare the time that a key tells with that of arrival, or of the first key."""
        assert self._offset is not None
        assert self._told_offset is not None
        utc_s = self._seen[begin].utc_s if begin in self._seen else None
        told = self._told_offset if utc_s is None else number_at(utc_s) - begin
        away_s = (self._offset - told) * SUPERFRAME_S
        late = abs(away_s) > self.tolerance_s
        self.reason = f"from another time, {away_s:+.0f} s away" if late else ""

    def _settle_until(self, index: int) -> None:
        """Learn the keys of the blocks that have ended, and check what they prove."""
        assert self._offset is not None
        layout = self._layout
        while (self._settled_until + 1) * layout.block - 1 <= index + self._offset:
            block = self._settled_until
            self._settled_until += 1
            self._unsettled.add(block)
            begin = block * layout.block - self._offset
            earlier = self._key_before(block)
            if earlier is None:
                self.status = "unknown"
                continue
            keys = self._keys_after(earlier, block, begin)
            if keys is None:
                continue
            key = next(iter(keys), None)
            if key is None:
                self.status, self.reason = "forged", "its keys are not the broadcaster's"
            else:
                self._known = _Known(earlier.period, block % layout.blocks, key)
                self._check_time(begin)
                self._settle(self._known)

    def _key_before(self, block: int) -> _Known | None:
        """Return the latest key from which that of a block can be told, None if none is given."""
        layout = self._layout
        period = block // layout.blocks
        if self._known is not None and self._known.period == period:
            return self._known
        end = self.announcement.end_of(period, layout.width)
        return None if end is None else _Known(period, -1, end)

    def _keys_after(self, earlier: _Known, block: int, begin: int) -> Iterable[bytes] | None:
        """Return the block's key as its fields say, if they do; None if too many of them are lost.

        Far from the last key that is known, a tag sorts those that are tried.
        """
        layout = self._layout
        _, quick, sent = self._told(begin)
        if sent is None:
            return None
        chain = self.announcement.chain(earlier.period, layout.width)
        steps = block % layout.blocks - earlier.place
        if steps <= _FAR_STEPS:
            key = chain.find(sent, earlier.key, steps)
            return () if key is None else (key,)
        window, complete = self._window(begin, layout.quick)
        if quick is None or not complete:
            return None
        keys = agreeing(sent, digest_of(window), layout.quick, quick)
        return (key for key in keys if chain.before(key, steps) == earlier.key)

    def _settle(self, known: _Known) -> None:
        """Check the tags of all blocks whose keys follow from this one."""
        chain = self.announcement.chain(known.period, self._layout.width)
        per_period = self._layout.blocks
        for block in sorted(self._unsettled):
            period, place = divmod(block, per_period)
            if period != known.period or place > known.place:
                continue
            self._unsettled.discard(block)
            self._check_tags(block, chain, known)

    def _check_tags(self, block: int, chain: Chain, known: _Known) -> None:
        layout = self._layout
        assert self._offset is not None
        begin = block * layout.block - self._offset
        key = chain.before(known.key, known.place - block % layout.blocks)
        end = begin + layout.block
        agreed = denied = False
        whole, quick, _ = self._told(begin)
        for tag, told in ((layout.quick, quick), (layout.whole, whole)):
            window, complete = self._window(begin, tag)
            if told is None or not window:
                continue
            if tag_of(key, digest_of(window), tag) == told:
                agreed = True
                for distance in window:
                    self._seen[end - distance].agreed_bits += tag.bits
            elif complete and not any(self._seen[end - d].denied for d in window):
                denied = True
                self._deny([end - d for d in window], sure=tag is layout.quick)
        if denied:
            self.status, self.reason = "forged", self.reason or "changed on its way"
        elif self.reason:
            self.status = "forged"
        elif agreed:
            self.status = "verified"
            if self.verified_after is None and self._first is not None:
                self.verified_after = begin + layout.block - self._first

    def _deny(self, indices: list[int], *, sure: bool) -> None:
        """Note that of these superframes one at least is not what was sent."""
        for index in indices:
            seen = self._seen[index]
            if sure or not seen.agreed_bits:
                seen.denied = "changed on its way"

    def _told(self, begin: int) -> tuple[int | None, int | None, int | None]:
        """Return whole tag, quick tag and sent bits of the key that a block's fields say."""
        layout = self._layout
        whole, both = layout.whole.bits, layout.whole.bits + layout.quick.bits
        return (
            self._bits(begin, 0, whole),
            self._bits(begin, whole, layout.quick.bits),
            self._bits(begin, both, SENT_BITS),
        )

    def _bits(self, begin: int, at: int, count: int) -> int | None:
        """Return some bits of a block's fields, None where one of the fields was lost."""
        width, value = self._layout.width, 0
        first, last = at // width, (at + count - 1) // width
        for index in range(begin + first, begin + last + 1):
            seen = self._seen.get(index)
            if seen is None or seen.proof < 0:
                return None
            value = value << width | seen.proof
        return value >> (last + 1) * width - at - count & (1 << count) - 1

    def _decided(self, index: int) -> Iterator[Verdict]:
        """Yield the verdicts that later superframes cannot change."""
        layout = self._layout
        latest = index - layout.whole.farthest - layout.block
        while self._open:
            oldest = self._open[0]
            seen = self._seen[oldest]
            ready = seen.denied or seen.agreed_bits >= NEEDED_BITS or oldest < latest
            if not ready:
                return
            self._open.popleft()
            yield self._verdict(oldest)

    def _verdict(self, index: int) -> Verdict:
        seen = self._seen[index]
        if seen.denied:
            return Verdict(index, "forged", seen.denied)
        if seen.agreed_bits < NEEDED_BITS:
            return Verdict(index, "unknown")
        return Verdict(index, "forged", self.reason) if self.reason else Verdict(index, "verified")

    def _forget(self, index: int) -> None:
        layout = self._layout
        oldest = index - 2 * layout.whole.farthest - layout.block
        for old in [k for k in self._seen if k < oldest]:
            del self._seen[old]
        if self._offset is not None:
            gone = (oldest + self._offset) // layout.block
            self._unsettled = {block for block in self._unsettled if block >= gone}
