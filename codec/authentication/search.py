"""Finds where in the broadcaster's chains a stream stands, at a cost that is bounded.

Trying costs 65536 hashes a superframe; comparing a key with the chain costs a hash for each block
since the period began. Whoever sends proofs that lead nowhere can make a receiver spend no more
than `_FIRST_HASHES` and then `_HASHES` a superframe on the latter, and ever fewer tries.
Specification: spec/authentication.md, section 6.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from codec.authentication.announcement import Announcement
from codec.authentication.chain import agreeing
from codec.authentication.layout import SUPERFRAME_S, ProofLayout, number_at
from codec.authentication.received import ReceivedProofs

_STRIDES = (1, 7, 23)
"""Every so manyth superframe is tried as a block's last one; the next stride follows after 4 and
after 16 blocks of tries in vain. No stride shares a factor with the length of a block, so that each
place has its turn."""

_FIRST_HASHES = 1 << 23
"""Hashes that a stream may cost to be compared with the chains: twice those of a year's blocks."""

_HASHES = 1 << 12
"""Hashes that each further superframe may cost."""

_DIRECT = 2
"""Blocks of the clock's time for which a single key's whole chain is computed; for any other, two
keys in a row identify the block first."""

_CANDIDATES = 2
"""Keys of a block that are looked at. Its quick tag agrees by chance under a wrong one before the
right one in one block of 512, under two in one of 400 000."""

_NEAR_S = 3600.0
"""How near a recording is likely to be to a time at which it may have been on air."""


@dataclass(frozen=True, slots=True)
class KnownKey:
    """A key of the chain: that of the block at `place` in its period; -1 is the chain's end."""

    period: int
    place: int
    key: bytes


@dataclass(slots=True)
class ChainSearch:
    """Looks for the first key of a stream.

    Parameters
    ----------
    announcement : Announcement
    tolerance_s : float
        How old a superframe may be on arrival, by the clock.
    likely_s : tuple of float
        Times at which the stream may have been on air, seconds since 1970.
    """

    announcement: Announcement
    tolerance_s: float
    likely_s: tuple[float, ...]
    _tried: int = 0
    _hashes: int = _FIRST_HASHES
    _found: dict[int, list[bytes]] = field(default_factory=dict)

    def restart(self, *, found: bool) -> None:
        """Begin anew; hashes already spent stay counted."""
        self._found.clear()
        if found:
            self._tried, self._hashes = 0, _FIRST_HASHES

    def look(
        self, received: ReceivedProofs, index: int, latest: KnownKey | None
    ) -> KnownKey | None:
        """Try whether the last superframes were a block of this broadcaster's.

        Parameters
        ----------
        received : ReceivedProofs
        index : int
            Of the last superframe.
        latest : KnownKey or None
            The latest key that is known, if any is.
        """
        layout = received.layout
        self._hashes = min(self._hashes + _HASHES, _FIRST_HASHES)
        begin = index - layout.block + 1
        by_clock = self._by_clock(received, begin)
        step = min(self._tried // (4 * layout.block), 1) + (self._tried >= 16 * layout.block)
        if by_clock == []:  # no block ends here now: who looks for other times may take his time
            step = max(step, 1)
        if index % _STRIDES[step] and begin - layout.block not in self._found:
            return None
        sent, quick = received.sent(begin), received.quick(begin)
        if sent is None or quick is None:
            return None
        self._tried += 1
        channel, distance = self.announcement.channel, layout.block - layout.quick
        keys = agreeing(channel, sent, distance, quick[1], quick[0])[:_CANDIDATES]
        if keys:
            before = begin - layout.block
            earlier = self._found.get(before, [])
            self._found = {at: kept for at, kept in self._found.items() if at > before}
            self._found[begin] = keys
            for key in keys:
                likely = (by_clock or [])[:_DIRECT]
                follows = (self._following(layout, key, one, by_clock or []) for one in earlier)
                for block in itertools.chain(likely, *follows):
                    known = KnownKey(*divmod(block, layout.blocks), key)
                    if self._leads(known, layout.width, latest):
                        return known
        return None

    def _by_clock(self, received: ReceivedProofs, begin: int) -> list[int] | None:
        """Return the blocks that this may be by the clock, the likeliest first; None without it."""
        layout, away = received.layout, self.tolerance_s / SUPERFRAME_S
        held = self.announcement.blocks(layout.block)
        for index, arrived in received.between(begin, begin + layout.block).items():
            if arrived.utc_s is not None:
                now = number_at(arrived.utc_s) - (index - begin)
                first = max(held.start, math.ceil((now - away) / layout.block))
                stop = min(held.stop, math.floor((now + away) / layout.block) + 1)
                return sorted(range(first, stop), key=lambda block: abs(now - block * layout.block))
        return None

    def _following(
        self, layout: ProofLayout, key: bytes, earlier: bytes, by_clock: list[int]
    ) -> Iterator[int]:
        """Yield the blocks whose key may lead to the one before: likely ones, then any."""
        held = self.announcement.blocks(layout.block)
        away = _NEAR_S / SUPERFRAME_S
        ranges = [range(min(by_clock), max(by_clock) + 1)] if by_clock else []
        for near in map(number_at, self.likely_s):
            ranges.append(range(*(int(n // layout.block) for n in (near - away, near + away))))
        for wanted in (*ranges, held):
            blocks = range(max(wanted.start, held.start), min(wanted.stop, held.stop))
            if not blocks or not self._afford(len(blocks)):
                continue
            for period in range(blocks[0] // layout.blocks, blocks[-1] // layout.blocks + 1):
                first = period * layout.blocks
                places = range(max(blocks[0] - first, 1), min(blocks.stop - first, layout.blocks))
                chain = self.announcement.chain(period, layout.width)
                yield from (first + place for place in chain.places(key, earlier, places))

    def _leads(self, known: KnownKey, width: int, latest: KnownKey | None) -> bool:
        """Return whether a key leads to the latest one that is known, or to the period's end."""
        chain = self.announcement.chain(known.period, width)
        late, early = (
            known,
            KnownKey(known.period, -1, self.announcement.end_of(known.period, width)),
        )
        if latest is not None and latest.period == known.period:
            late, early = sorted((known, latest), key=lambda one: one.place)[::-1]
        steps = late.place - early.place
        return self._afford(steps) and chain.before(late.key, late.place, steps) == early.key

    def _afford(self, hashes: int) -> bool:
        """Return whether `count` hashes may be spent, and spend them."""
        if hashes > self._hashes:
            return False
        self._hashes -= hashes
        return True
