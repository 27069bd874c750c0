"""Demodulation of one profile's superframes: a view of sound to payloads, whatever its level.

In: a `SuperframeView`; out: soft values, log-likelihood ratios and the link's result. The
level is found by trying: the one that worked last first.
Specification: spec/audio-carrier.md, W29 to W38.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from watermark.audio.follow.align import SuperframeView
from watermark.audio.follow.equaliser import band_of
from watermark.audio.follow.interference import InterferenceEstimator, InterferenceMask
from watermark.audio.follow.purse import CELLS, DecodingPurse, decoding_cost
from watermark.audio.follow.reliability import LIMITS, Reliability
from watermark.audio.follow.retries import LONGEST_LIST_SIZE, Retries
from watermark.audio.follow.smoothing import smooth
from watermark.audio.follow.standing import CellStanding
from watermark.audio.search.acquire import DEVIATION
from watermark.audio.signal.channel_choice import make_places
from watermark.audio.signal.layout import make_layout, make_pilots
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import LEVELS, TIER_LEVELS, AudioProfile
from watermark.link.link import Decoded, Link

LIST_SIZE = 8
"""Paths that the decoder follows at first."""

TRIED_LEVELS = 8
"""Levels at which a superframe is tried: those of the two tiers whose pilots fit best."""

UNTOLD = 3.0 * DEVIATION
"""Correlation of pilots below which they tell no place and hardly a level: the last one and its
neighbours are tried, too."""

NEARBY = (1.5, 2.5)
"""Deviation in frames and cells of the window of decoded bits that bear on a cell."""

SHRINK = 20.0
"""Cells that the mean of all frames counts for beside them; 10 to 40 do as well."""

SPARE_TIERS = 2
"""Tiers beyond those of the profile that a change of gain may have led to."""

GAIN_TRIAL, GAIN_WORTH = 0.25, 1.02
"""Supposed change of the gain in levels, and the least gain in agreement of the decoded bits
that confirms it."""


@dataclass(frozen=True, slots=True)
class SuperframeReading:
    """A superframe as read at one place and level.

    Attributes
    ----------
    view : SuperframeView
        Where it was read.
    level : float
        Level that was assumed; with another gain, not one of those that are written.
    clues : ndarray of float64, shape (3, 64, groups)
        See `SuperframeView.clues`.
    soft : ndarray of float64, shape (64, groups)
        Soft values.
    llr : ndarray of float64, shape (data_cells,)
        Log-likelihood ratios of the coded bits.
    decoded : Decoded
        The link's result.
    """

    view: SuperframeView
    level: float
    clues: NDArray[np.float64]
    soft: NDArray[np.float64]
    llr: NDArray[np.float64]
    decoded: Decoded


class Demodulator:
    """Reads the superframes of a profile and learns how far each cell can be trusted.

    Parameters
    ----------
    profile : AudioProfile
        How superframes are written.
    key : int
        Seed of the layout.
    purse : DecodingPurse, optional
        Pays for attempts beyond the first ones; otherwise all are made.
    """

    def __init__(self, profile: AudioProfile, key: int, purse: DecodingPurse | None = None) -> None:
        self.profile, self.purse = profile, purse or DecodingPurse(math.inf)
        self.layout = make_layout(profile, key)
        self.places = make_places(profile, key)
        self.standing = CellStanding(profile, self.layout.cells, self.places)
        self.link = Link(profile)
        self.reliability = Reliability(profile.groups)
        self._pilots = make_pilots(key)
        self._masker = make_masker()
        self._announced = self._pilots.expected(profile.number)
        self._retries = Retries(self)
        self._asked: tuple[Decoded, NDArray[np.float64]] | None = None
        self.coverage = InterferenceEstimator(profile, self.layout, self._pilots)

    @property
    def bands(self) -> int:
        """Bands of the profile, see `watermark.audio.follow.equaliser`."""
        return int(band_of(self.layout.cells)[-1]) + 1

    def likely_levels(self, view: SuperframeView, last: float, offset: float = 0.0) -> list[float]:
        """Levels to try, best first: by how well their pilots fit, then by nearness to `last`.

        A gain that moved all levels by `offset` may have moved them beyond those that are written:
        where pilots fit best at such a tier, its levels come first.
        """
        own = range(len(LEVELS) // TIER_LEVELS)
        tiers = range(-SPARE_TIERS, len(own) + SPARE_TIERS)
        lowest = self.profile.pilot_step(0)
        steps = [lowest * 2 ** (tier + offset / TIER_LEVELS) for tier in tiers]
        sums = view.agreements(self._pilots.cells, steps, self._announced)
        scores = dict(zip(tiers, sums.tolist(), strict=True))
        ranked = sorted(scores, key=lambda tier: -scores[tier])
        chosen = [tier for tier in ranked if tier in own][: TRIED_LEVELS // TIER_LEVELS]
        if ranked[0] not in own:
            chosen.insert(0, ranked[0])
        levels = [[tier * TIER_LEVELS + i + offset for i in range(TIER_LEVELS)] for tier in chosen]
        if scores[ranked[0]] < UNTOLD:
            every = (level + offset for level in range(len(LEVELS)))
            others = sorted(set(every) - set(levels[0]), key=lambda x: abs(x - last))
            levels[1:] = [others[: TRIED_LEVELS - TIER_LEVELS]]
        return [level for part in levels for level in sorted(part, key=lambda x: abs(x - last))]

    def read(
        self,
        view: SuperframeView,
        levels: list[float],
        *,
        offset: float = 0.0,
        due: bool = True,
        brief: bool = False,
    ) -> SuperframeReading:
        """Read at the first of `levels` that the link accepts; else at the first of all.

        What fails everywhere is tried again at the first few with a longer list, then with other
        weights than the learnt ones: harder where a superframe is due, not at all in brief.
        `offset` is by how much a gain moved all levels. Only the first attempts are made in any
        case, at the levels of the likeliest tier; the purse pays for all others.
        """
        clues = view.clues(self.layout.cells, self._masker)
        self.purse.charge(CELLS)
        failed: SuperframeReading | None = None
        for level, ratios in self._first(view, clues, levels):
            reading = self._read_at(view, clues, level, ratios, LIST_SIZE)
            if reading.decoded.l0 is not None:
                return self._settle(reading)
            failed = failed or reading
        assert failed is not None
        if brief:
            return failed
        for level, ratios, size in self._retries.attempts(view, clues, levels, offset, due=due):
            again = self._read_at(view, clues, level, ratios, size)
            self._retries.note(again.decoded.l0 is not None)
            if again.decoded.l0 is not None:
                return self._settle(again)
        return failed

    def _first(
        self, view: SuperframeView, clues: NDArray[np.float64], levels: list[float]
    ) -> Iterator[tuple[float, NDArray[np.float64]]]:
        """Levels and ratios of the cells: the first attempts."""
        learnt = self.reliability.cautious(clues)
        for n, level in enumerate(levels):
            if n < TIER_LEVELS:
                self.purse.charge(self.cost(LIST_SIZE))
            elif not self.purse.pays(self.cost(LIST_SIZE)):
                return
            weighted = self.weighted(view, level, learnt)
            yield level, self.standing.of_unknown(view, level) * weighted

    def cost(self, list_size: int) -> float:
        """Return the units that a decoding costs."""
        return decoding_cost(list_size, self.profile.l0_mother)

    def weighted(
        self, view: SuperframeView, level: float, weights: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return log-likelihood ratios of the cells by soft values and weights."""
        return view.soft(self.layout.cells, self.profile.step(level)) * weights

    def look(self, view: SuperframeView, level: float, offset: float) -> InterferenceMask:
        """Look for what covers a superframe; its pilots have the step of their tier."""
        tier = math.floor((level - offset) / TIER_LEVELS + 1e-6)
        pilot_step = self.profile.pilot_step(0) * 2 ** (tier + offset / TIER_LEVELS)
        return self.coverage.look(view, level, pilot_step)

    def trust(self, reading: SuperframeReading) -> NDArray[np.float64]:
        """Weights of cells whose bits are known, shape (64, groups)."""
        weights = self.reliability.weights(reading.clues)
        if reading.view.paired:
            return weights
        expected = self.expected(reading.decoded)
        known = (expected != 0) & (reading.soft != 0)
        return weights * self.standing.factors(np.where(known, reading.soft * expected, 0.0), known)

    def _read_at(
        self,
        view: SuperframeView,
        clues: NDArray[np.float64],
        level: float,
        ratios: NDArray[np.float64],
        list_size: int,
    ) -> SuperframeReading:
        soft = view.soft(self.layout.cells, self.profile.step(level))
        llr = self.layout.gather(ratios)
        decoded = self.link.decode(llr, list_size=list_size)
        return SuperframeReading(view, level, clues, soft, llr, decoded)

    def _settle(self, reading: SuperframeReading) -> SuperframeReading:
        """Move to the level at which the decoded bits fit best: L0 survives a wrong one.

        There it is decoded again only if L1 is missing.
        """
        expected = self.expected(reading.decoded)

        def soft(level: float) -> NDArray[np.float64]:
            return reading.view.soft(self.layout.cells, self.profile.step(level))

        levels = [reading.level + change for change in (0, -2, -1, 1, 2)]
        best = levels[int(self._agreements(reading, levels).argmax())]
        if best == reading.level:
            return reading
        ratios = soft(best) * self._local(soft(best), expected)
        if reading.decoded.l1 is not None:
            llr = self.layout.gather(ratios)
            return replace(reading, level=best, soft=soft(best), llr=llr)
        again = self._read_at(reading.view, reading.clues, best, ratios, LIST_SIZE)
        return reading if again.decoded.l0 is None else again

    def read_second(self, reading: SuperframeReading, view: SuperframeView) -> SuperframeReading:
        """Read the second class where only the first was accepted, with its help.

        Parameters
        ----------
        reading : SuperframeReading
            With L0 but without L1.
        view : SuperframeView
            The superframe at the place where the bits of L0 fit best.

        Returns
        -------
        SuperframeReading
            With L1, or the one that was given.
        """
        expected = self.expected(reading.decoded)
        soft = view.soft(self.layout.cells, self.profile.step(reading.level))
        learnt = self.reliability.cautious(reading.clues)
        plain = self.reliability.plain(reading.clues)
        for weights in (self._local(soft, expected), learnt, plain):
            llr = self.layout.gather(soft * weights)
            l1 = self.link.second(llr, list_size=LONGEST_LIST_SIZE)
            if l1 is not None:
                return replace(reading, decoded=self.link.complete(reading.decoded, l1))
        return reading

    def _local(
        self, soft: NDArray[np.float64], expected: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Weights by how well known cells agree around each cell of this superframe."""
        known = (expected != 0) & (soft != 0)
        agreement = np.where(known, soft * expected, 0.0)
        place = agreement.sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        near, count = (smooth(x.astype(np.float64), NEARBY) for x in (agreement, known))
        cells = 4 * np.pi * NEARBY[0] * NEARBY[1]
        r = (cells * near + SHRINK * np.clip(place, *LIMITS)) / (cells * count + SHRINK)
        r = np.clip(r, *LIMITS)
        return np.asarray(2 * r * (2 - r**2) / (1 - r**2))

    def gain_change(self, reading: SuperframeReading) -> float:
        """Levels by which the gain seems to have changed, from the decoded bits."""
        levels = [reading.level + change for change in (-GAIN_TRIAL, 0.0, GAIN_TRIAL)]
        below, here, above = self._agreements(reading, levels)
        if max(below, above) <= GAIN_WORTH * here:
            return 0.0
        return -GAIN_TRIAL if below > above else GAIN_TRIAL

    def _agreements(self, reading: SuperframeReading, levels: list[float]) -> NDArray[np.float64]:
        """Return sums of soft values at levels, each times the decoded bit, shape (levels,)."""
        steps = [self.profile.step(level) for level in levels]
        return reading.view.agreements(self.layout.cells, steps, self.expected(reading.decoded))

    def learn(self, reading: SuperframeReading) -> None:
        """Let a decoded superframe teach how far cells can be trusted."""
        self.reliability.learn(reading.soft, self.expected(reading.decoded), reading.clues)

    def expected(self, decoded: Decoded) -> NDArray[np.float64]:
        """Soft values that decoded bits ask for; 0 where unknown, shape (64, groups)."""
        if self._asked is None or self._asked[0] is not decoded:
            # Each superframe is asked for by all that corrects and learns.
            known = decoded.coded >= 0
            self._asked = decoded, self.layout.spread(np.where(known, 1 - 2.0 * decoded.coded, 0.0))
        return self._asked[1]
