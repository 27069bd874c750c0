"""Codec in the loop: each superframe is tried on the broadcaster's own coder before it is marked.

In: the picture and the designs of its superframes; out: for each one the least visible strength at
which both classes arrive, that of L0 and that of L1 apart. One run of the coder tries all strengths
at once: a trial copy of the picture has a random strength in every value, and the decoded copy
shows how much information each of them
leaves. The coder runs on as one stream, for its rate control has a long memory. Sources: the copy
of the receiver inside the emitter of Baras, Moreau and Dymarski, IEEE TASLP 14(5), 2006; that less
than the whole way to a lattice point may suffice: Eggers, Bäuml, Tzschoppe and Girod, "Scalar Costa
scheme for information embedding", IEEE TSP 51(4), 2003. Specification: spec/video-carrier.md, V2
and V12.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.link.link import L0_CHECK, L1_CHECK
from watermark.video.coder_trial import ODDS, SHARES, TRIED, CoderTrial, PictureCoder, TrialFinding
from watermark.video.design import Design, Strength, Way, fixed_strength
from watermark.video.fading import PatternWriter
from watermark.video.modes import Mode
from watermark.video.painting import Painter
from watermark.video.profile import COARSE, DATA, LONE, POSITIONS, STEPS, VideoProfile
from watermark.video.timing import Timing

WAYS = tuple(
    (rung, Way(fine / 20, coarse / 20))
    for rung, shares in enumerate(SHARES)
    for fine in range(round(20 * shares[0]), 21)
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
at 360 lines 1.2, 1.5, 1.9 and 2.5 lost 4, 4, 2 and 0 of 9 superframes of a flat cartoon; 1.9 and
2.5 lost none of six other films."""

HOPELESS = 1.1
"""Most information, in the same units, of a class that is given up: it rarely decodes."""

NEARLY = 0.95
"""Part of the most information that is asked where the margin is out of reach."""

Luma = NDArray[Any]
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
    firm : bool
        Whether no strength below that without a trial is taken: for a coder that stands for
        unknown ones, which may leave less.
    lone : bool
        Whether L0 may get all values, which L1 loses everywhere, where it would not arrive with
        its margin at this channel's widest step.
    together : bool
        Whether L1 is moved as far as L0 has to be, though it need not arrive: for the worst of
        several alike, on the better ones of which it does.

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
    firm: bool = False
    lone: bool = True
    together: bool = False


class PictureLoop:
    """Choose the strength of each superframe.

    Parameters
    ----------
    profile : VideoProfile
        Of the mark.
    modes : sequence of Mode
        The profile's, one for each step.
    painter : Painter
        Of patterns for the picture.
    depth : int
        Bits per sample.
    timing : Timing
        Frame rate.
    channels : sequence of TriedChannel
        All have to be survived.
    """

    def __init__(
        self,
        profile: VideoProfile,
        modes: Sequence[Mode],
        painter: Painter,
        depth: int,
        timing: Timing,
        channels: Sequence[TriedChannel],
    ) -> None:
        self._profile, self._modes, self._painter = profile, modes, painter
        self._writer = PatternWriter(painter.shape, depth, timing)
        self._trials = [CoderTrial(channel.coder, modes, timing) for channel in channels]
        self._channels = channels
        self._places: deque[int] = deque()

    def process(self, luma: Luma, design: Design | None) -> list[Strength]:
        """Take the next frame, and the design that it completed, if any.

        Returns
        -------
        list of Strength
            Those of the next superframes.
        """
        self._writer.add_frame(luma)
        if design is not None:
            choice = np.random.default_rng(design.place).choice(len(TRIED), POSITIONS, p=ODDS)
            ways = [(rung, Way(share, share)) for rung, share in TRIED]
            tried = [Strength(rung, way, way) for rung, way in ways]
            moves = design.mixed(self._modes, tried, choice)
            self._writer.add_pattern(self._painter.paint(moves, design.smooth))
            self._places.append(design.place)
            for trial in self._trials:
                trial.expect(design, choice)
        self._send(self._writer.ready())
        return self._decisions()

    def flush(self) -> list[Strength]:
        """Return the strengths of the superframes still on trial."""
        self._send(self._writer.end())
        for trial in self._trials:
            trial.flush()
        return self._decisions()

    def _send(self, frames: list[Luma]) -> None:
        for frame in frames:
            for trial in self._trials:
                trial.process(frame)

    def _decisions(self) -> list[Strength]:
        count = min(len(trial.findings) for trial in self._trials)
        return [
            self._least_visible(
                self._places.popleft(), [trial.findings.popleft() for trial in self._trials]
            )
            for _ in range(count)
        ]

    def _least_visible(self, place: int, findings: Sequence[TrialFinding | None]) -> Strength:
        """Return the strength that changes the picture least among those that suffice."""
        fixed = fixed_strength(place, self._painter.shape)
        tried = []
        for finding, channel in zip(findings, self._channels, strict=True):
            if finding is None:
                return fixed
            costs = self._costs(finding)
            strong = costs >= costs[WAYS.index((fixed.rung, fixed.first))]
            bits = np.array([finding.at(*way) for way in WAYS])
            tried.append((bits, channel, self._enough(bits, channel, place, costs, strong)))
        chosen = self._cheapest(costs, [enough for *_, enough in tried])
        others = [each for each in tried if not self._needs_all(*each[:2], chosen)]
        if len(others) == len(tried):
            return chosen
        # No more than the other channels ask for, or than without a trial, unless L0 needs it.
        least = self._cheapest(costs, [enough for *_, enough in others]) if others else fixed
        least_cost = self._cost(costs, least)
        return self._lone([each[:2] for each in tried], costs, costs >= least_cost)

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

    def _needs_all(self, bits: FloatArray, channel: TriedChannel, chosen: Strength) -> bool:
        """Whether L0 has its margin behind a channel only if it gets all values."""
        first, both = self._rates(self._profile)
        left = bits[WAYS.index((chosen.rung, chosen.first))]
        rest = bits[WAYS.index((chosen.rung, chosen.rest))]
        allowed = _up_to(channel.widest)
        if not channel.lone or bits[allowed].max() < HOPELESS * self._rates(LONE)[0]:
            return False
        return bool(left < L0_MARGIN * first and not (channel.whole and rest >= HOPELESS * both))

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
            most = bits[strong & allowed].max(initial=0.0)
            enough = enough & (bits >= min(L0_MARGIN * self._rates(LONE)[0], most))
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

    def _costs(self, finding: TrialFinding) -> FloatArray:
        """Mean square of a value's move with each of `WAYS`, up to a factor."""
        fine, coarse = finding.parts
        return np.array(
            [
                self._modes[rung].step ** 2
                * (fine * way.fine**2 + coarse * (COARSE * way.coarse) ** 2)
                for rung, way in WAYS
            ]
        )

    def _cost(self, costs: FloatArray, strength: Strength) -> float:
        """Return the same for a strength."""
        first, rest = (
            costs[WAYS.index((strength.rung, way))] for way in (strength.first, strength.rest)
        )
        return float(rest + self._profile.l0_coded / DATA * (first - rest))

    def _enough(
        self, bits: FloatArray, channel: TriedChannel, place: int, costs: FloatArray, strong: Mask
    ) -> tuple[Mask, Mask]:
        """Which ways suffice for L0 and for L1 in a channel that leaves so many bits at each.

        `strong`: those not weaker than without a trial.

        In this order: ways of L1 at which both classes arrive with their margin; if there are none,
        those that leave nearly the most, if both may still arrive; then those of L0 at which it
        arrives with its margin; at last the strongest, or any where L0 alone is asked for and would
        not arrive even so. None is asked for beyond the channel's widest step, but wider ones
        suffice as well.
        """
        first, rate = self._rates(self._profile)
        allowed, anything = _up_to(channel.widest), np.ones(len(WAYS), dtype=bool)
        least = strong if channel.firm else anything
        most = bits[allowed].max()
        if channel.whole:
            margin = OPENING_MARGIN if place == 0 else MARGIN
            wanted = min(CEILING, margin * rate)
            if most >= HOPELESS * rate:
                return least, least & (bits >= (wanted if most >= wanted else NEARLY * most))
            least = strong
        enough = least & (bits >= L0_MARGIN * first)
        if not enough[allowed].any():
            if not channel.whole and most < HOPELESS * first:
                return least, least
            enough = costs >= costs[_strongest(channel.widest)]
        return enough, enough if channel.whole or channel.together else least


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
