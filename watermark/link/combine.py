"""Several carriers of one programme together: every superframe once, however it came.

In: superframes from the receivers of sound and picture, placed on one clock; out: superframes for
the viewer. The same superframe in two carriers is one codeword seen twice: both use the same mother
code for L0 (`watermark.link.polar`), so where it failed in both, their ratios are folded onto that
code and add. Specification: spec/video-carrier.md, section 7.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link.crc import crc_bits
from watermark.link.link import L0_CHECK, Link, Rates
from watermark.link.polar import PolarCode, make_code
from watermark.link.superframe import SUPERFRAME_S, ReceivedSuperframe

CARRIERS = ("audio", "video", "a335")
"""The first of those that are being received leads: its places count for all."""

TOLERANCE_S = 0.2
"""Most that two carriers may differ about the start of the same superframe."""

MEMORY_S = 2.0
"""How long a superframe waits for its twin, and how long a carrier counts after its last one."""


@dataclass(frozen=True, slots=True)
class _CarrierSuperframe:
    carrier: str
    superframe: ReceivedSuperframe
    profile: Rates | None


class Combiner:
    """Joins the superframes of all carriers.

    Parameters
    ----------
    list_size : int
        Paths that the decoder of added ratios follows.

    Attributes
    ----------
    recovered : int
        Superframes that no carrier had alone.

    Examples
    --------
    >>> whole = ReceivedSuperframe(b"x", b"", 0.0, 1.0)
    >>> Combiner().add("audio", whole, None) == [whole]
    True
    """

    def __init__(self, *, list_size: int = 32) -> None:
        self._list_size = list_size
        self._waiting: list[_CarrierSuperframe] = []
        self._settled: deque[float] = deque(maxlen=8)
        self._last: dict[str, float] = {}
        self.recovered = 0

    def add(
        self, carrier: str, superframe: ReceivedSuperframe, profile: Rates | None
    ) -> list[ReceivedSuperframe]:
        """Take a superframe; return the superframes to hand on now.

        A superframe that failed waits for its twin while another carrier is being received. One
        that arrived whole twice is handed on twice: the later one may have more.

        Parameters
        ----------
        carrier : str
            One of `CARRIERS`.
        superframe : ReceivedSuperframe
            As its receiver gave it, placed on the clock that all carriers share.
        profile : Rates or None
            The receiver's profile; without one its ratios are not used.

        Returns
        -------
        list of ReceivedSuperframe
            At most one; with l0 = None if no carrier has it.

        Raises
        ------
        CueError
            If the carrier's name is unknown.
        """
        if carrier not in CARRIERS:
            raise CueError(f"carrier {carrier!r}: must be one of {', '.join(CARRIERS)}")
        placed = self._placed(carrier, superframe)
        if placed is None:
            return []
        self._last[carrier] = placed.position_s
        now_s = max(self._last.values())
        self._waiting = [
            seen for seen in self._waiting if now_s - seen.superframe.position_s <= MEMORY_S
        ]
        if placed.l0 is not None:
            return [self._settle(placed)]
        return self._failed(_CarrierSuperframe(carrier, placed, profile))

    def _placed(self, carrier: str, superframe: ReceivedSuperframe) -> ReceivedSuperframe | None:
        """Put a superframe onto the leading carrier's grid; None if it belongs to another one."""
        here_s = superframe.position_s
        for leader in CARRIERS[: CARRIERS.index(carrier)]:
            if abs(here_s - self._last.get(leader, -np.inf)) > MEMORY_S:
                continue
            steps = (here_s - self._last[leader]) / SUPERFRAME_S
            error_s = (steps - round(steps)) * SUPERFRAME_S
            if abs(error_s) > TOLERANCE_S:
                return None
            return replace(superframe, position_s=here_s - error_s)
        return superframe

    def _settle(self, superframe: ReceivedSuperframe) -> ReceivedSuperframe:
        self._settled.append(superframe.position_s)
        self._waiting = [s for s in self._waiting if not _same_place(s.superframe, superframe)]
        return superframe

    def _failed(self, seen: _CarrierSuperframe) -> list[ReceivedSuperframe]:
        here_s = seen.superframe.position_s
        if any(abs(here_s - settled_s) <= TOLERANCE_S for settled_s in self._settled):
            return []
        twins = [
            other
            for other in self._waiting
            if other.carrier != seen.carrier and _same_place(other.superframe, seen.superframe)
        ]
        # What failed in both carriers may decode from the sum of their soft bits.
        for twin in twins:
            found = self._together(seen, twin)
            if found is not None:
                self.recovered += 1
                return [self._settle(found)]
        others = (
            name
            for name, last_s in self._last.items()
            if name != seen.carrier and here_s - last_s <= MEMORY_S
        )
        if twins or not any(others):
            return [self._settle(seen.superframe)]
        self._waiting.append(seen)
        return []

    def _together(self, a: _CarrierSuperframe, b: _CarrierSuperframe) -> ReceivedSuperframe | None:
        if a.profile is None or b.profile is None or a.profile.l0_bytes != b.profile.l0_bytes:
            return None
        # Both carriers send one mother polar code, repeated or cut to their room: folded to its
        # length, their log-likelihood ratios add.
        codes = [_code(profile) for profile in (a.profile, b.profile)]
        if codes[0].frozen.size != codes[1].frozen.size:
            return None
        folded = [_fold(s, code) for s, code in zip((a, b), codes, strict=True)]
        size = 8 * a.profile.l0_bytes
        mother = PolarCode(codes[0].message, codes[0].frozen.size, codes[0].frozen)
        message = mother.decode(
            folded[0] + folded[1],
            accept=lambda m: bool(np.array_equal(crc_bits(m[:size], L0_CHECK), m[size:])),
            list_size=self._list_size,
        )
        if message is None:
            return None
        l0 = np.packbits(message[:size].astype(np.uint8)).tobytes()
        # L1 is not combined: take that of the richer carrier, else the other's.
        richer, poorer = sorted((a, b), key=lambda s: -(s.profile.l1_bytes if s.profile else 0))
        l1 = _second(richer) or _second(poorer)
        confidence = max(a.superframe.confidence, b.superframe.confidence)
        return replace(richer.superframe, l0=l0, l1=l1, confidence=confidence)


def _same_place(a: ReceivedSuperframe, b: ReceivedSuperframe) -> bool:
    return abs(a.position_s - b.position_s) <= TOLERANCE_S


def _code(profile: Rates) -> PolarCode:
    return make_code(8 * profile.l0_bytes + L0_CHECK, profile.l0_coded, profile.l0_mother)


def _fold(seen: _CarrierSuperframe, code: PolarCode) -> NDArray[np.float64]:
    """Ratios of the mother code's bits: those of repeated bits add."""
    if seen.superframe.ratios is None:
        return np.zeros(code.frozen.size)
    ratios = np.asarray(seen.superframe.ratios[: code.length], dtype=np.float64)
    folded = np.zeros(-(-ratios.size // code.frozen.size) * code.frozen.size)
    folded[: ratios.size] = np.clip(ratios, -20, 20)
    return np.asarray(folded.reshape(-1, code.frozen.size).sum(axis=0))


def _second(seen: _CarrierSuperframe) -> bytes | None:
    """L1 of a superframe whose L0 the carriers had only together."""
    if seen.profile is None or seen.superframe.ratios is None:
        return None
    return Link(seen.profile).second(seen.superframe.ratios)
