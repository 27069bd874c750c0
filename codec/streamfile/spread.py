"""Spreading: the bytes of a file over its superframes, where they lower the error most.

Superframes of a file need not have one size. They take one step, and for as many as the limit
allows the next wider one, so that a bit is worth the same everywhere. The score is encoded once for
all, where it is worth its bits.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS
from codec.cues.timeline import TICKS
from codec.errors import CueError
from codec.streamfile.versions import COARSE, Spread, SpreadMotion, Version
from codec.superframe.quantise import NO_RESIDUAL, STEPS, width_mm

Array = NDArray[np.float64]
Size = Callable[[bytes], int]

ScoreChoice = Literal["auto", "keep", "drop"]
"""Whether a file codes its score: where it costs little, always, or never."""

MOST_COST = 0.01
"""Greatest share that a score may add to a file's size or error."""

_CLEARLY_LESS = -0.12
"""Cost by an estimate that leaves no doubt: it takes the models for linear, and is off by .07 where
a hand rests for long."""

_FRAMES = 3, 1
"""Errors are taken of one frame in this many; then of all, if these leave a doubt."""

_DOUBT = 0.04
"""Difference of a cost from the most that leaves one: of one frame in three it is off by .03."""

_NO_ERROR_MM = 1e-6
"""Error that counts as none."""

_NEAR = 2
"""Greatest error in steps that leaves the choice as it is."""

_SPARE_PART = 250
"""Part of a file's room that may stay empty."""

_FILLINGS = 4
"""Times that a file is filled to its room, each time with the bytes that the last one left."""

_MOST_FILLINGS = 16
"""The same as long as it was filled beyond its room."""

_ROUNDS = 16
"""Times that a file is written to come near its error, at most."""

_POLISHINGS = 8
"""Times that one superframe's step is changed to come nearer still, at most."""

_KEPT = 0.003
"""Greatest relative difference between a file's error and the one that is asked for."""

_RECORD_BITS, _SCORED_RECORD_BITS = 3.0, 8.0
"""Bits that a record takes beside its payload's ideal length, about: without a score and with one
(of 8 files of real cuers, 1 to 4 and 4 to 10)."""


class Wish(Protocol):
    """The limits of a file."""

    def steps(self, version: Version) -> NDArray[np.int64]:
        """Return the steps of a version's superframes, about."""
        ...

    def written(self, version: Version) -> Spread:
        """Return the superframes of a version that keep the wish.

        Raises
        ------
        CueError
            If none do.
        """
        ...

    def more(self, one: Spread, other: Spread, take: SpreadMotion) -> float:
        """Return how much more bytes or error some superframes have than others, as a share."""
        ...

    def likely_more(self, spread: Spread, own: Version, other: Version) -> float:
        """Return the same, about: how much more than another version will have."""
        ...


def spread(take: SpreadMotion, wish: Wish, score: ScoreChoice) -> Spread:
    """Return the superframes that keep a wish, with the score or without it.

    Parameters
    ----------
    take : SpreadMotion
    wish : Wish
    score : {"auto", "keep", "drop"}

    Raises
    ------
    CueError
        If none keep it.
    """
    if score == "drop" or not take.has_score:
        return wish.written(_prepared(take.plain(), wish))
    scored = _scored(take, wish)
    if score == "keep":
        return wish.written(scored)
    bare = _prepared(take.plain(), wish)
    try:
        kept = wish.written(scored)
    except CueError:
        return wish.written(bare)
    cost = wish.likely_more(kept, scored, bare)
    if cost > _CLEARLY_LESS:
        without = wish.written(bare)
        cost = wish.more(kept, without, take)
    return replace(kept if cost <= MOST_COST else without, cost=cost)


def _more(error_mm: float, other_mm: float) -> float:
    return error_mm / max(other_mm, _NO_ERROR_MM) - 1


def _prepared(version: Version, wish: Wish) -> Version:
    """Choose the coding of superframes at about the right step."""
    version.prepare(COARSE)
    step = int(np.median(wish.steps(version)))
    if abs(step - COARSE) > _NEAR:
        version.prepare(step, width_mm(min(step, STEPS - 2)))
    return version


def _scored(take: SpreadMotion, wish: Wish) -> Version:
    """Return the motion with its score, learning from past superframes if worth it."""
    learning = _prepared(take.scored(learning=True), wish)
    if learning.clearly_gains:
        return learning
    step = learning.prepared
    fixed = take.scored(learning=False)
    fixed.prepare(step, width_mm(min(step, STEPS - 2)))
    return min(learning, fixed, key=lambda version: version.worth(step))


@dataclass(frozen=True, slots=True)
class ByError:
    """The smallest superframes that keep an error together.

    Attributes
    ----------
    error_mm : float
        RMS over all markers and frames.
    count : int
        Of superframes.
    size : callable
        Bytes that a payload takes.
    """

    error_mm: float
    count: int
    size: Size

    @property
    def _most(self) -> float:
        return self.error_mm**2 * self.count * TICKS * len(MARKERS)

    def steps(self, version: Version) -> NDArray[np.int64]:
        """Return the steps of a version's superframes."""
        return self._widest(version, self._most)

    def written(self, version: Version) -> Spread:
        """Return the superframes of a version that keep the error most nearly.

        The error is that of the markers in the motion's own frames: padding does not count, and
        the metric of the search for steps is linear and knows one pose.
        """
        kept, least, best = self._most, np.inf, None
        below, above = 0.0, np.inf
        chosen = np.zeros(0, dtype=np.int64), 1.0
        seen: dict[bytes, tuple[Spread, float]] = {}
        for _ in range(_ROUNDS):
            steps = self._widest(version, kept)
            if steps.tobytes() not in seen:
                made = version.written(steps)
                seen[steps.tobytes()] = made, version.error_of(made) / self.error_mm
            made, ratio = seen[steps.tobytes()]
            if abs(ratio - 1) < least:
                best, least, chosen = made, abs(ratio - 1), (steps, ratio)
            if least < _KEPT:
                return made
            below, above = (kept, above) if ratio < 1 else (below, kept)
            # By the error's own measure at first; between limits on both sides then.
            there = below > 0 and above < np.inf
            kept = float(np.sqrt(below * above)) if there else kept / max(ratio, 0.1) ** 2
            if not there and len(seen) > 1 and ((steps == 0).all() or (steps == NO_RESIDUAL).all()):
                break
        assert best is not None
        for _ in range(_POLISHINGS):
            steps = self._nearer(version, *chosen)
            made = version.written(steps)
            ratio = version.error_of(made) / self.error_mm
            if abs(ratio - 1) >= least:
                break
            best, least, chosen = made, abs(ratio - 1), (steps, ratio)
        return best

    def _nearer(
        self, version: Version, steps: NDArray[np.int64], ratio: float
    ) -> NDArray[np.int64]:
        """Return steps with one changed such that the error comes nearest to the limit."""
        _, squares = version.at_own(steps)
        wanted = squares.sum() * (1 / ratio**2 - 1)
        moved = [np.clip(steps + way, 0, NO_RESIDUAL) for way in (-2, -1, 1, 2)]
        gains = np.stack([version.at_own(other)[1] - squares for other in moved])
        way, place = np.unravel_index(np.argmin(np.abs(gains - wanted)), gains.shape)
        result = steps.copy()
        result[place] = moved[int(way)][place]
        return result

    def more(self, one: Spread, other: Spread, _: SpreadMotion) -> float:
        """Return how many more bytes some superframes have than others, as a share."""
        return self._bytes(one) / self._bytes(other) - 1

    def likely_more(self, spread: Spread, _: Version, other: Version) -> float:
        """Return the same, about: how many more than another version will have."""
        bits, _squares = other.at_each(self.steps(other))
        return self._bytes(spread) / (bits / 8 + self.size(other.common)) - 1

    def _bytes(self, spread: Spread) -> int:
        return self.size(spread.common) + sum(map(self.size, spread.payloads))

    def _widest(self, version: Version, most: float) -> NDArray[np.int64]:
        return version.steps(lambda _, squares: float(squares.sum()) <= most, finest=False)


@dataclass(frozen=True, slots=True)
class BySize:
    """The superframes of least error that fit into a number of bytes together.

    Attributes
    ----------
    room : int
        Bytes, the common data included.
    count : int
        Of superframes.
    size : callable
        Bytes that a payload takes.
    """

    room: int
    count: int
    size: Size

    def steps(self, version: Version) -> NDArray[np.int64]:
        """Return the steps of a version's superframes, about."""
        return self._finest(version, self._spare(version))

    def _spare(self, version: Version) -> float:
        return self.count * (_SCORED_RECORD_BITS if version.common else _RECORD_BITS)

    def written(self, version: Version) -> Spread:
        """Return the superframes of a version that fit.

        Raises
        ------
        CueError
            If they do not even without coefficients.
        """
        spare, found = self._spare(version), list[Spread]()
        for filling in range(_MOST_FILLINGS):
            steps = self._finest(version, spare)
            spread = version.written(steps)
            over = sum(map(self.size, spread.payloads)) + self.size(spread.common) - self.room
            if over <= 0:
                found.append(spread)
            elif (steps == NO_RESIDUAL).all():
                break
            enough = found and filling + 1 >= _FILLINGS
            if enough or -self.room // _SPARE_PART <= over <= 0:
                break
            spare += 8.0 * over
        if not found:
            raise CueError(f"{self.room} bytes do not hold {self.count} superframes")
        return min(found, key=version.squares)

    def more(self, one: Spread, other: Spread, take: SpreadMotion) -> float:
        """Return how much more error some superframes have than others, as a share."""
        cost = 0.0
        for every in _FRAMES:
            cost = _more(*(take.error_of(spread.blocks, every) for spread in (one, other)))
            if abs(cost - MOST_COST) > _DOUBT:
                break
        return cost

    def likely_more(self, spread: Spread, own: Version, other: Version) -> float:
        """Return the same, about: how much more than another version will have."""
        _bits, squares = other.at_each(self.steps(other))
        return _more(float(np.sqrt(own.squares(spread))), float(np.sqrt(squares)))

    def _finest(self, version: Version, spare: float) -> NDArray[np.int64]:
        left = 8.0 * (self.room - self.size(version.common)) - spare
        return version.steps(lambda bits, _: float(bits.sum()) <= left, finest=True)
