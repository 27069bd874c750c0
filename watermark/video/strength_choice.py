"""Choose a superframe's strength by the information that each one leaves behind every channel.

In: bits per value at each strength, as a trial or a rehearsal shows them; out: the least visible
strength at which both classes arrive. That less than the whole way to a lattice point may suffice:
Eggers, Bäuml, Tzschoppe and Girod, "Scalar Costa scheme for information embedding", IEEE TSP 51(4),
2003. Specification: spec/video-carrier.md, V2 and V12.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from watermark.link.link import L0_CHECK, L1_CHECK
from watermark.video.coder_trial import SHARES, TrialFinding
from watermark.video.coder_windows import PictureCoder
from watermark.video.design import Design, Strength, Way, fixed_strength
from watermark.video.modes import Mode
from watermark.video.profile import COARSE, DATA, LONE, STEPS, VideoProfile

WAYS = tuple(
    (rung, Way(fine / 20, coarse / 20))
    for rung, shares in enumerate(SHARES)
    for fine in range(round(20 * shares[1]), 21)
    for coarse in range(round(20 * shares[0]), 21)
)
"""Steps and ways among which that of each class is chosen."""

MARGIN = 1.65
"""Information that is enough, in units of the message's and its checks' bits. Classes decode from
about 1.2 on; through x264 with other settings 0.8 to 1.25 times the trial's arrived."""

OPENING_MARGIN = 2.4
"""The same for a programme's first superframe: each coder starts poor in its own way, and 0.55 to
1.2 times the trial's information arrives."""

CEILING = 0.65
"""Bits per value that are enough for any rate: none holds more than one."""

L0_MARGIN = 2.5
"""The same where L0 alone is asked for: where so little is left the trial errs by more. In MPEG-2
at 360 lines, with a trial that had a picture that stands alone each second, 1.2, 1.5, 1.9 and 2.5
lost 4, 4, 2 and 0 of 9 superframes of a flat cartoon; 1.9 and 2.5 lost none of six other films."""

HOPELESS = 1.1
"""Most information, in the same units, of a class that is given up: it rarely decodes."""

HOPED = 0.3, 1.0
"""Most information, in the same units, from which on L1 that is hoped for gets any, and how much.
Where MPEG-2's trial, which is poorer than most ways on air, left .4 to .6, half of the superframes
of a rocket at 360 lines were read whole, and all of a face's; at .15 to .2 one of three."""

NEARLY = 0.95
"""Part of the most information that is asked where the margin is out of reach."""

FIRST_PART = 0.85
"""Part of each margin that is asked of a trial where a rehearsal follows, for that only
strengthens: after whole margins it cost .1, .3 and .5 of VMAF on three films."""

CORRECTION = 0.2, 2.0
"""Least and greatest factor by which a rehearsal corrects the information that a trial promises."""

SPARED = 1
"""Number of the widest step for L0 alone where L1 is too dear. Up to the widest one a jungle at
1080 lines lost .9 of VMAF, and one of 22 superframes was saved."""

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TriedChannel:
    """A channel to the viewers.

    Attributes
    ----------
    coder : PictureCoder
    whole : bool
        Whether both classes have to arrive, or L0 alone.
    widest : int
        Number of the widest step that may be taken for its sake: wide ones can be seen.
    lone : bool
        Whether L0 may get all values, which L1 loses everywhere, where it would not arrive with
        its margin at this channel's widest step.
    hoped : bool
        Whether L1 gets the information that it needs, though it need not arrive, see `HOPED`: for
        the worst of several alike, on the better ones of which it does.
    price : float
        By how much L1 may raise the cost for this channel's sake, as a factor: where it needs more,
        L0 alone has to arrive. For a worse channel than most have.
    again : PictureCoder, optional
        Another one like `coder`, on which the mark that was chosen is rehearsed.

    Examples
    --------
    >>> class Wire:
    ...     def process(self, luma):
    ...         return [luma]
    ...
    ...     def flush(self):
    ...         return []
    >>> TriedChannel(Wire(), whole=False).widest
    2
    """

    coder: PictureCoder
    whole: bool = True
    widest: int = len(STEPS) - 1
    lone: bool = True
    hoped: bool = False
    price: float = math.inf
    again: PictureCoder | None = None


@dataclass(slots=True)
class TrialResult:
    """A superframe's information at each strength, by a trial or by a rehearsal after it.

    Attributes
    ----------
    place : int
        Of the superframe.
    costs : ndarray of float64, shape (len(WAYS),)
        Mean of a value's squared move times its price with each of `WAYS`, up to a factor.
    left : list of ndarray of float64, shape (2, len(WAYS))
        Bits per value of L0 and of L1 with each of them, for each channel.
    floor : Strength or None
        The one that was rehearsed: none weaker is chosen.
    """

    place: int
    costs: FloatArray
    left: list[FloatArray]
    floor: Strength | None = None

    def correct(self, rehearsed: Strength, measured: Sequence[tuple[float, float] | None]) -> None:
        """Correct each channel's information by that of L0 and L1 in a rehearsal, where known."""
        self.floor = rehearsed
        ways = rehearsed.first, rehearsed.rest
        for bits, both in zip(self.left, measured, strict=True):
            if both is None:
                continue
            for mine, way, left in zip(bits, ways, both, strict=True):
                promised = max(mine[WAYS.index((rehearsed.rung, way))], 1e-3)
                mine *= np.clip(left / promised, *CORRECTION)


class StrengthChoice:
    """The rules of the choice.

    Parameters
    ----------
    profile : VideoProfile
        Of the mark.
    modes : sequence of Mode
        The profile's, one for each step; others may follow.
    shape : tuple of int
        Height and width of the picture.
    channels : sequence of TriedChannel
        All have to be survived.
    """

    def __init__(
        self,
        profile: VideoProfile,
        modes: Sequence[Mode],
        shape: tuple[int, int],
        channels: Sequence[TriedChannel],
    ) -> None:
        self._profile, self._modes, self._shape = profile, modes, shape
        self._channels = channels
        self._price = min((channel.price for channel in channels), default=math.inf)
        self._cheaper = [
            channel
            if math.isinf(channel.price)
            else replace(channel, whole=False, widest=min(channel.widest, SPARED))
            for channel in channels
        ]

    def result(self, design: Design, findings: Sequence[TrialFinding]) -> TrialResult:
        """Gather the findings of a trial on all channels."""
        left = [np.array([each.at(*way) for way in WAYS]).T for each in findings]
        return TrialResult(design.place, self._costs(design), left)

    def least_visible(self, result: TrialResult) -> Strength:
        """Return the strength that changes the picture least among those that suffice."""
        chosen, floor = self._sufficing(result), result.floor
        # Channels that exclude one another may leave less than was rehearsed.
        weaker = floor and self._cost(result.costs, chosen) < self._cost(result.costs, floor)
        return floor if floor and weaker else chosen

    def _sufficing(self, result: TrialResult) -> Strength:
        fixed = fixed_strength(result.place, self._shape)
        costs = result.costs
        strong = self._no_weaker(fixed)
        tried = self._tried(self._channels, result, strong)
        chosen = self._cheapest(costs, [enough for *_, enough in tried])
        if math.isfinite(self._price):
            spared = self._tried(self._cheaper, result, strong)
            without = self._cheapest(costs, [enough for *_, enough in spared])
            dear = self._cost(costs, chosen) > self._price * self._cost(costs, without)
            if dear or not self._bought(result, chosen):
                tried, chosen = spared, without
        others = [each for each in tried if not self._needs_all(*each[:2], chosen, result)]
        if len(others) == len(tried):
            return chosen
        # No more than the other channels ask for, or than without a trial, unless L0 needs it.
        least = self._cheapest(costs, [enough for *_, enough in others]) if others else fixed
        least_cost = self._cost(costs, least)
        return self._lone([each[:2] for each in tried], costs, costs >= least_cost)

    def _tried(
        self, channels: Sequence[TriedChannel], result: TrialResult, strong: Mask
    ) -> list[tuple[FloatArray, TriedChannel, tuple[Mask, Mask]]]:
        """Return each channel's information and the ways that suffice for it."""
        return [
            (bits, channel, self._enough(bits, channel, result, strong))
            for bits, channel in zip(result.left, channels, strict=True)
        ]

    def _bought(self, result: TrialResult, chosen: Strength) -> bool:
        """Return whether L1 may arrive behind the channels that have a price."""
        rest = WAYS.index((chosen.rung, chosen.rest))
        least = HOPELESS * self._rates(self._profile)[1]
        return all(
            bits[1, rest] >= least
            for bits, channel in zip(result.left, self._channels, strict=True)
            if math.isfinite(channel.price)
        )

    def _cheapest(self, costs: FloatArray, masks: Sequence[tuple[Mask, Mask]]) -> Strength:
        """Return the least visible strength that suffices for all of these.

        L0 is never weaker than L1, for it has to arrive where L1 does not.
        """
        widest = max(channel.widest for channel in self._channels)
        first, rest = (np.all(each, axis=0) for each in zip(*masks, strict=True))
        allowed = _up_to(widest)
        together = STRONGER & (first & allowed)[:, None] & (rest & allowed)
        if not together.any():
            # Channels that exclude one another: the strongest that all of them allow.
            return Strength(min(channel.widest for channel in self._channels))
        part = self._profile.l0_coded / DATA
        total = np.where(together, part * costs[:, None] + (1 - part) * costs, np.inf)
        one, other = np.unravel_index(int(total.argmin()), total.shape)
        return Strength(WAYS[one][0], WAYS[one][1], WAYS[other][1])

    def _needs_all(
        self, bits: FloatArray, channel: TriedChannel, chosen: Strength, result: TrialResult
    ) -> bool:
        """Whether L0 has its margin behind a channel only if it gets all values.

        Where it was rehearsed, that is the margin of what was measured.
        """
        first, both = self._rates(self._profile)
        left = bits[0, WAYS.index((chosen.rung, chosen.first))]
        rest = bits[1, WAYS.index((chosen.rung, chosen.rest))]
        allowed = _up_to(channel.widest)
        if not channel.lone or bits[0, allowed].max() < HOPELESS * self._rates(LONE)[0]:
            return False
        margin = L0_MARGIN * _part(channel, result) if result.floor is None else MARGIN
        return bool(left < margin * first and not (channel.whole and rest >= HOPELESS * both))

    def _lone(
        self, tried: Sequence[tuple[FloatArray, TriedChannel]], costs: FloatArray, strong: Mask
    ) -> Strength:
        """Return the least visible of these strengths at which L0 in all values arrives everywhere.

        Where it does not, the one that leaves the most, up to each channel's widest step.
        """
        widest = max(channel.widest for _, channel in tried)
        strong &= _up_to(widest)
        enough = strong
        for bits, channel in tried:
            allowed = _up_to(channel.widest)
            most = bits[0, strong & allowed].max(initial=0.0)
            enough = enough & (bits[0] >= min(L0_MARGIN * self._rates(LONE)[0], most))
        if not enough.any():
            enough = strong
        rung, way = WAYS[int(np.where(enough, costs, np.inf).argmin())]
        return Strength(rung, way, way, lone=True)

    def _rates(self, profile: VideoProfile) -> tuple[float, float]:
        """Bits and their check per coded bit, of L0 and of the class that has more."""
        first = (8 * profile.l0_bytes + L0_CHECK) / profile.l0_coded
        if not profile.l1_coded:
            return first, first
        return first, max(first, (8 * profile.l1_bytes + L1_CHECK) / profile.l1_coded)

    def _costs(self, design: Design) -> FloatArray:
        fine, coarse = design.prices
        return np.array(
            [
                self._modes[rung].step ** 2
                * (fine * way.fine**2 + coarse * (COARSE * way.coarse) ** 2)
                for rung, way in WAYS
            ]
        )

    def _no_weaker(self, strength: Strength) -> Mask:
        """Which of `WAYS` move values in all cells as far as a strength does L0's."""
        mine, least = self._modes[strength.rung].step, strength.first
        steps = [self._modes[rung].step for rung, _ in WAYS]
        fine = np.multiply(steps, [way.fine for _, way in WAYS]) >= mine * least.fine
        coarse = np.multiply(steps, [way.coarse for _, way in WAYS]) >= mine * least.coarse
        return np.asarray(fine & coarse)

    def _cost(self, costs: FloatArray, strength: Strength) -> float:
        """Return the same for a strength."""
        first, rest = (
            costs[WAYS.index((strength.rung, way))] for way in (strength.first, strength.rest)
        )
        return float(rest + self._profile.l0_coded / DATA * (first - rest))

    def _enough(
        self, bits: FloatArray, channel: TriedChannel, result: TrialResult, strong: Mask
    ) -> tuple[Mask, Mask]:
        """Which ways suffice for L0 and for L1 in a channel that leaves so many bits at each.

        In this order: ways at which both classes arrive with their margin; if there are none,
        those that leave nearly the most, if L1 may still arrive; then those of L0 at which it
        arrives with its margin; those that leave nearly the most, if it may still arrive; at last
        the strongest, or any where L0 alone is asked for. None is asked for beyond the channel's
        widest step, but wider ones suffice as well; none is weaker than the rehearsed one.
        """
        first, rest = self._sufficient(bits, channel, result, strong)
        costs, floor = result.costs, result.floor
        if floor is None:
            return first, rest
        mine, others = (costs[WAYS.index((floor.rung, way))] for way in (floor.first, floor.rest))
        return first & (costs >= mine), rest & (costs >= others)

    def _sufficient(
        self, bits: FloatArray, channel: TriedChannel, result: TrialResult, strong: Mask
    ) -> tuple[Mask, Mask]:
        """Return the same, whatever was rehearsed."""
        first, rate = self._rates(self._profile)
        part = _part(channel, result)
        least = np.ones(len(WAYS), dtype=bool)
        allowed = _up_to(channel.widest)
        most = bits[:, allowed].max(axis=1)
        if channel.whole:
            margin = OPENING_MARGIN if result.place == 0 else MARGIN
            wanted = part * min(CEILING, margin * rate)
            if most[1] >= HOPELESS * rate:
                masks = [
                    least & (each >= (wanted if top >= wanted else NEARLY * top))
                    for each, top in zip(bits, most, strict=True)
                ]
                return masks[0], masks[1]
            least = strong
        enough = least & (bits[0] >= part * L0_MARGIN * first)
        if not enough[allowed].any():
            if most[0] >= HOPELESS * first:
                enough = least & (bits[0] >= NEARLY * most[0])
            elif channel.whole:
                enough = result.costs >= result.costs[_strongest(channel.widest)]
            else:
                return least, least
        if channel.whole:
            return enough, enough
        hope, wanted = (share * rate for share in HOPED)
        if channel.hoped and most[1] >= hope:
            return enough, least & (bits[1] >= min(wanted, NEARLY * most[1]))
        return enough, least


def _part(channel: TriedChannel, result: TrialResult) -> float:
    """Part of the margins that is asked of a result."""
    return FIRST_PART if channel.again is not None and result.floor is None else 1.0


def _up_to(widest: int) -> Mask:
    """Which of `WAYS` have no wider step."""
    return np.array([rung <= widest for rung, _ in WAYS])


def _strongest(widest: int) -> int:
    """Index of the strongest of `WAYS` up to a step, the whole way in all cells."""
    return WAYS.index((widest, Way()))


STRONGER = np.array(
    [
        [
            rung == other and way.fine >= weak.fine and way.coarse >= weak.coarse
            for other, weak in WAYS
        ]
        for rung, way in WAYS
    ]
)
"""Which of `WAYS` (rows) L0 may have beside L1 with another (columns): one step, and no less."""
