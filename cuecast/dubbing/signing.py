"""Superframes of a programme that is being dubbed, signed with the broadcaster's key."""

from collections.abc import Callable

from codec.authentication.announcement import SigningKey
from codec.authentication.signer import Signer
from codec.errors import CueError
from codec.superframe.checks import proof_of, proved, with_proof

Source = Callable[[int], tuple[bytes, bytes]]


class Signing:
    """Signs the superframes of all carriers of one programme, each of them once.

    Parameters
    ----------
    key : SigningKey
    on_air_s : float
        When the programme's clock is at zero, seconds since 1970 (UTC).
    kept : int, optional
        How many superframes back a carrier may be behind another one; None: any.
    after : Signer, optional
        What signed until now: no number is used twice.
    """

    def __init__(
        self,
        key: SigningKey,
        on_air_s: float,
        *,
        kept: int | None = None,
        after: Signer | None = None,
    ) -> None:
        self._key, self._on_air_s, self._kept, self._after = key, on_air_s, kept, after
        self._signer: Signer | None = None
        self._signed: dict[int, tuple[bytes, int]] = {}

    @property
    def signer(self) -> Signer | None:
        """The last signer."""
        return self._after if self._signer is None else self._signer

    def source(self, source: Source, first: int) -> Source:
        """Return a source of signed superframes; the first one is on air in place `first`."""

        def signed(k: int) -> tuple[bytes, bytes]:
            l0, l1 = source(k)
            return with_proof(l0, self._proof(first + k, l0)), l1

        return signed

    def _proof(self, place: int, l0: bytes) -> int:
        covered = proved(l0)
        known = self._signed.get(place)
        if known is not None:
            if known[0] != covered:
                raise CueError("signed cues have to be the same in all carriers: give them one L0")
            return known[1]
        field = proof_of(l0)
        assert field is not None, "a superframe without a place for its proof"
        if self._signer is None:
            self._signer = Signer(
                self._key, self._on_air_s, field[1], place=place, after=self._after
            )
        elif self._signed and place != max(self._signed) + 1:
            raise CueError(f"superframe {place} is to be signed out of its turn")
        value = self._signer.take(covered)
        self._signed[place] = covered, value
        if self._kept is not None and len(self._signed) > self._kept:
            del self._signed[min(self._signed)]
        return value
