"""Proof fields of a stream that is being sent: what comes from the broadcaster's key."""

from codec.authentication.announcement import SigningKey
from codec.authentication.chain import digest_of, sent_bits, tag_of
from codec.authentication.layout import LAYOUTS, PERIOD, Layout, join, number_at
from codec.errors import CueError


class Signer:
    """Gives each superframe its proof field, in order of the time on air.

    Parameters
    ----------
    key : SigningKey
    on_air_s : float
        When superframe 0 is due on air, seconds since 1970 (UTC). It is moved to where a
        programme is verified soonest: by up to 2.6 s, with fields of 2 bits by 14 s.
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
        self._layout: Layout = LAYOUTS[width]
        block, start = self._layout.block, self._layout.start
        self.number = round((number_at(on_air_s) - start) / block) * block + start + place
        if self.number < 0:
            raise CueError(f"on air at {on_air_s:.0f} s since 1970: keys begin in 2026")
        self._sent: dict[int, bytes] = {}
        self._period = -1
        self._keys: list[bytes] = []
        self._proof = self._proof_of(self.number // block)

    def take(self, covered: bytes) -> int:
        """Return the field of the next superframe.

        Parameters
        ----------
        covered : bytes
            All of the superframe that is to be proved; the field itself is not part of it.
        """
        layout = self._layout
        block, place = divmod(self.number, layout.block)
        if place == 0:
            self._proof = self._proof_of(block)
        self._sent[self.number] = covered
        self._sent.pop(self.number - layout.whole.reach - layout.block, None)
        self.number += 1
        shift = layout.width * (layout.block - 1 - place)
        return self._proof >> shift & (1 << layout.width) - 1

    def _proof_of(self, block: int) -> int:
        layout = self._layout
        begin = block * layout.block
        period, place = divmod(begin, PERIOD)
        if period != self._period:
            self._period, self._keys = period, self._key.keys(period, layout.width)
        key = self._keys[place // layout.block]
        tags = []
        for tag in (layout.quick, layout.whole):
            covered = {
                distance: self._sent[begin - distance]
                for distance in range(1, tag.reach + 1)
                if begin - distance in self._sent
            }
            tags.append(tag_of(key, digest_of(covered), tag))
        return join(tags[0], tags[1], sent_bits(key), layout)
