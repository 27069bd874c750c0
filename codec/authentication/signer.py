"""Proof fields of a stream that is being sent: the broadcaster's side."""

from codec.authentication.announcement import SigningKey
from codec.authentication.chain import sent_bits, tag_of
from codec.authentication.checks import checks_of
from codec.authentication.layout import LAYOUTS, ProofLayout, join, number_at
from codec.errors import CueError


class Signer:
    """Gives each superframe its proof field, in order of the time on air.

    Parameters
    ----------
    key : SigningKey
    on_air_s : float
        When superframe 0 is due on air, seconds since 1970 (UTC).
    width : int
        Bits of a field: 9, or 2 in compact superframes.
    place : int
        Number of the first superframe that is signed; programmes may begin before 0.
    after : Signer, optional
        The stream's signer until now: no number is used twice, and its superframes are covered.

    Attributes
    ----------
    number : int
        Of the next superframe on the public clock.

    Raises
    ------
    CueError
        If there are no fields of this width, or the time is before 2026.
    """

    def __init__(
        self,
        key: SigningKey,
        on_air_s: float,
        width: int,
        *,
        place: int = 0,
        after: "Signer | None" = None,
    ) -> None:
        if width not in LAYOUTS:
            raise CueError(f"proof fields of {width} bits: there are those of 2 and of 9")
        self._key = key
        self._layout: ProofLayout = LAYOUTS[width]
        self.number = round(number_at(on_air_s)) + place
        if self.number < 0:
            raise CueError(f"on air at {on_air_s:.0f} s since 1970: keys begin in 2026")
        self._sent: dict[int, bytes] = {}
        self._period = -1
        self._keys: tuple[bytes, ...] = ()
        if after is not None:
            self.number = max(self.number, after.number)
            self._sent, self._period, self._keys = after._sent, after._period, after._keys
            if after._layout is not self._layout:
                self._sent, self._period = {}, -1
        self._block = -1
        self._checks: list[int] = []

    def take(self, covered: bytes) -> int:
        """Return the field of the next superframe.

        Parameters
        ----------
        covered : bytes
            All of the superframe that is to be proved; the field itself is not part of it.
        """
        layout = self._layout
        block, place = divmod(self.number, layout.block)
        begin, key = block * layout.block, self._key_of(block)
        self._sent[self.number] = covered
        self.number += 1
        if block != self._block:
            self._block = block
            self._sent = {n: sent for n, sent in self._sent.items() if n >= begin - layout.block}
            tags = self._tags(key, begin - layout.block, begin, begin + layout.block)
            self._checks = checks_of(tags, layout.checks)
        quick = begin + layout.quick
        tags = self._tags(key, quick, min(quick, self.number - 1) + 1, begin + layout.block)
        proof = join(self._checks, tags.get(0, 0), sent_bits(key))
        return proof >> layout.width * (layout.block - 1 - place) & (1 << layout.width) - 1

    def _key_of(self, block: int) -> bytes:
        period, place = divmod(block, self._layout.blocks)
        if period != self._period:
            self._period, self._keys = period, self._key.keys(period, self._layout.width)
        return self._keys[place]

    def _tags(self, key: bytes, first: int, stop: int, end: int) -> dict[int, int]:
        """Return the tags of those that were sent, by their distance from `first`."""
        return {
            number - first: tag_of(self._key.channel, key, end - number, self._sent[number])
            for number in range(first, stop)
            if number in self._sent
        }
