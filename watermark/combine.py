"""Sound and picture together: the same superframe in two carriers is one codeword seen twice.

In: what the receivers of both carriers hand out, with the log-likelihood ratios of superframes that
failed; out: superframes whose first class needed both. Both carriers use the same mother code for
L0 (`watermark.polar`), so their ratios are folded onto it and add. Specification:
spec/video-carrier.md, section 7.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.crc import crc_bits
from watermark.link import L0_CHECK, Rates
from watermark.polar import PolarCode, make_code
from watermark.received import ReceivedSuperframe

TOLERANCE_S = 0.2
"""Most that two carriers may differ about the start of the same superframe."""

MEMORY_S = 2.0
"""How long a superframe waits for its twin."""


@dataclass(frozen=True, slots=True)
class _Seen:
    superframe: ReceivedSuperframe
    profile: Rates


class Combiner:
    """Add the ratios of two carriers.

    Each receiver's superframes are put in as they come; those that could not be decoded alone are
    tried again together with their twin from the other carrier.

    Parameters
    ----------
    offset_s : float
        Start of the picture's clock on the sound's clock.
    list_size : int
        Paths that the decoder follows.

    Examples
    --------
    >>> Combiner().add("audio", ReceivedSuperframe(b"x", b"", 0.0, 1.0), None) is None
    True
    """

    def __init__(self, *, offset_s: float = 0.0, list_size: int = 8) -> None:
        self._offset_s = {"audio": 0.0, "video": offset_s}
        self._list_size = list_size
        self._waiting: deque[tuple[str, _Seen]] = deque()
        self.recovered = 0

    def add(
        self, carrier: str, superframe: ReceivedSuperframe, profile: Rates | None
    ) -> ReceivedSuperframe | None:
        """Take a superframe; return it with its L0 if only both carriers together have it.

        Parameters
        ----------
        carrier : str
            "audio" or "video".
        superframe : ReceivedSuperframe
            As its receiver gave it.
        profile : Rates or None
            The receiver's profile.

        Returns
        -------
        ReceivedSuperframe or None
            None where nothing was gained: the superframe was whole, or its twin is not there yet,
            or both together are not enough.

        Raises
        ------
        CueError
            If the carrier's name is unknown.
        """
        if carrier not in self._offset_s:
            raise CueError(f"carrier {carrier!r}: must be one of {', '.join(self._offset_s)}")
        if superframe.l0 is not None or superframe.ratios is None or profile is None:
            return None
        placed = replace(superframe, position_s=superframe.position_s + self._offset_s[carrier])
        seen = _Seen(placed, profile)
        for entry in list(self._waiting):
            name, other = entry
            if placed.position_s - other.superframe.position_s > MEMORY_S:
                self._waiting.remove(entry)
            elif name != carrier and _same_place(placed, other.superframe):
                found = self._together(seen, other)
                if found is not None:
                    self._waiting.remove(entry)
                return found
        self._waiting.append((carrier, seen))
        return None

    def _together(self, a: _Seen, b: _Seen) -> ReceivedSuperframe | None:
        codes = [_code(seen.profile) for seen in (a, b)]
        if a.profile.l0_bytes != b.profile.l0_bytes or codes[0].frozen.size != codes[1].frozen.size:
            return None
        folded = _fold(a, codes[0]) + _fold(b, codes[1])
        size = 8 * a.profile.l0_bytes
        mother = PolarCode(codes[0].message, folded.size, codes[0].frozen)
        message = mother.decode(
            folded,
            accept=lambda m: bool(np.array_equal(crc_bits(m[:size], L0_CHECK), m[size:])),
            list_size=self._list_size,
        )
        if message is None:
            return None
        self.recovered += 1
        l0 = np.packbits(message[:size].astype(np.uint8)).tobytes()
        confidence = max(a.superframe.confidence, b.superframe.confidence)
        return replace(a.superframe, l0=l0, confidence=confidence)


def _same_place(a: ReceivedSuperframe, b: ReceivedSuperframe) -> bool:
    return abs(a.position_s - b.position_s) <= TOLERANCE_S


def _code(profile: Rates) -> PolarCode:
    return make_code(8 * profile.l0_bytes + L0_CHECK, profile.l0_coded)


def _fold(seen: _Seen, code: PolarCode) -> NDArray[np.float64]:
    """Ratios of the mother code's bits: those of repeated bits add."""
    assert seen.superframe.ratios is not None
    ratios = np.asarray(seen.superframe.ratios[: code.length], dtype=np.float64)
    folded = np.zeros(-(-ratios.size // code.frozen.size) * code.frozen.size)
    folded[: ratios.size] = np.clip(ratios, -20, 20)
    return np.asarray(folded.reshape(-1, code.frozen.size).sum(axis=0))
