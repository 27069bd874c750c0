"""Proof fields of a stream that is being sent: what comes from the broadcaster's key."""

from codec.authentication.announcement import SigningKey
from codec.authentication.chain import digest_of, sent_bits, tag_of
from codec.authentication.layout import LAYOUTS, ProofLayout, Tag, join, number_at
from codec.errors import CueError


class Signer:
    """Gives each superframe its proof field, in order of the time on air.

    Parameters
    ----------
    key : SigningKey
    on_air_s : float
        When superframe 0 is due on air, seconds since 1970 (UTC). It is moved to where a block
        begins, by up to 2.6 s, with fields of 2 bits by 14 s: that is verified soonest.
    width : int
        Bits of a field: 9, or 2 in compact superframes.
    place : int
        Number of the first superframe that is signed; programmes may begin before 0.

    Attributes
    ----------
    number : int
        Of the next superframe on the public clock.

    Raises
    ------
    CueError
        If there are no fields of this width, or the time is before 2026.
    """

    def __init__(self, key: SigningKey, on_air_s: float, width: int, *, place: int = 0) -> None:
        if width not in LAYOUTS:
            raise CueError(f"proof fields of {width} bits: there are those of 2 and of 9")
        self._key = key
        self._layout: ProofLayout = LAYOUTS[width]
        block = self._layout.block
        self.number = round(number_at(on_air_s) / block) * block + place
        if self.number < 0:
            raise CueError(f"on air at {on_air_s:.0f} s since 1970: keys begin in 2026")
        self._sent: dict[int, bytes] = {}
        self._period = -1
        self._keys: list[bytes] = []
        self._whole = self._quick = 0

    def take(self, covered: bytes) -> int:
        """Return the field of the next superframe.

        Parameters
        ----------
        covered : bytes
            All of the superframe that is to be proved; the field itself is not part of it.
        """
        layout = self._layout
        block, place = divmod(self.number, layout.block)
        self._sent[self.number] = covered
        self._sent.pop(self.number - layout.whole.farthest, None)
        self.number += 1
        key = self._key_of(block)
        if place == 0:
            self._whole = self._tag(block, key, layout.whole)
        if place <= layout.block - layout.quick.nearest:
            self._quick = self._tag(block, key, layout.quick)
        proof = join(self._whole, self._quick, sent_bits(key), layout)
        shift = layout.width * (layout.block - 1 - place)
        return proof >> shift & (1 << layout.width) - 1

    def _key_of(self, block: int) -> bytes:
        layout = self._layout
        period, place = divmod(block, layout.blocks)
        if period != self._period:
            self._period, self._keys = period, self._key.keys(period, layout.width)
        return self._keys[place]

    def _tag(self, block: int, key: bytes, tag: Tag) -> int:
        """Return a tag over what was sent until now."""
        end = (block + 1) * self._layout.block
        covered = {
            distance: self._sent[end - distance]
            for distance in range(tag.nearest, tag.farthest + 1)
            if end - distance in self._sent
        }
        return tag_of(key, digest_of(covered), tag)
