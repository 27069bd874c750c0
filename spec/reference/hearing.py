"""A receiver of sound as spec/hearing.md describes it, written from that text, in numpy.

Of spec/audio-carrier.md it needs sections 4 to 6 and 10.

A whole recording in, superframes out. Slow on purpose: nothing is kept from one attempt to another.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from spec.reference import audio_carrier as carrier
from spec.reference.hearing_view import (
    FRAMES,
    HOP,
    LENGTH,
    Array,
    View,
    concentration,
    converted,
    fitted,
    layout,
    soft,
    spectra,
    standing,
    units,
    views,
)
from spec.reference.list_decoder import decode

STRETCH, PLACE = 4 * LENGTH, 2
"""(A4) Samples that are searched at once, and between two places."""
STEPS = 5
"""(A4) Steps of pilots."""
OFFSETS = (0.0, 0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875)
"""(A4) Parts of a doubling by which a gain may have moved all steps, in the order tried."""
DEVIATION = 8.0
"""(A5) Standard deviation of the correlation of 128 pilots with unmarked sound."""
SUMS = ((1, 1.0), (2, 0.7), (3, 0.57))
"""(A5) Superframes whose scores are added, and weights of the sums."""
LEAST_SCORE, CANDIDATES, APART = 4.8, 6, 24
"""(A5) Least score, most candidates, and samples between two of a profile."""
PULL_IN = (
    (np.arange(-2.5, 2.51, 0.5), 1e-6 * np.arange(-80, 81, 40.0)),
    (np.arange(-0.75, 0.76, 0.25), 1e-6 * np.arange(-40, 41, 20.0)),
)
"""(A6) Delays and drifts tried around a candidate."""
STEADY = 3e-5
"""(A6) Deviation of a first clock that is taken for 0."""
LISTS = ((8, 8), (32, 8), (512, 4))
"""(A9) Paths, and levels at which so many are followed."""
SECOND_PATHS, SECOND_LOOKED = (8, 512), 64
"""(A11) Paths for L1, and the likeliest of which the check is asked."""
FOLLOW = np.arange(-1.0, 1.01, 0.25)
"""(A12) Delays tried with decoded bits."""
BESIDE = (np.arange(-24.0, 24.1, 1.5), np.zeros(1))
"""(A13) Delays at which the pilots of a superframe that failed are sought."""
LEAST_BESIDE = 4.5
"""(A13) Their least score in deviations."""
MOST_MISSES = 6
"""(A13) Superframes in a row that may fail."""


@dataclass(frozen=True)
class Candidate:
    """A place where a superframe may start, and by how much a gain moved the steps there."""

    score: float
    profile: str
    start: float
    offset: float


@dataclass
class Place:
    """(A3) Where a superframe is expected: start, and samples per sample of the mark."""

    start: float
    ratio: float = 1.0
    age: int = 0

    def correct(self, delay: float) -> None:
        """(A12) Follow the delay that a superframe had, as a line through all so far would."""
        n = self.age + 2
        self.start += max(2 * (2 * n - 1) / (n * (n + 1)), 0.2) * delay
        self.ratio *= 1 + max(6 / (n * (n + 1)), 0.02) * delay / LENGTH
        self.age += 1


@dataclass(frozen=True)
class Heard:
    """A superframe that was read; `effort` is the number of paths that it took."""

    profile: str
    start: float
    l0: bytes
    l1: bytes | None
    effort: int


def search(mid: Array, first: int, key: int, offsets: tuple[float, ...]) -> Iterator[Candidate]:
    """(A4, A5) Yield the candidates of a stretch from `first` on: of each offset the best first."""
    pilots = layout("standard", key).pilots
    count = STRETCH // HOP
    projected = []
    for begin in range(first, first + HOP, PLACE):
        found = spectra(mid, begin + HOP * np.arange(-1.0, count))
        projected.append(View(found[1:], units(found)).projections(pilots))
    for offset in offsets:
        scores = []
        for name in carrier.PROFILES:
            pattern = layout(name, key).expected
            for tier in range(STEPS):
                step = 2 ** (1.875 + tier + offset)
                values = np.stack([soft(one, pilots, step) for one in projected], axis=1)
                starts = count - FRAMES + 1
                single = sum(values[f : f + starts] @ pattern[f] for f in range(FRAMES))
                scores += summed(np.reshape(single, -1) / DEVIATION, name, first, offset)
        scores.sort(key=lambda one: -one.score)
        yield from distinct(scores)


def summed(single: Array, name: str, first: int, offset: float) -> list[Candidate]:
    """(A5) Return the best places of one profile and step, by one, two and three superframes."""
    found = []
    period = LENGTH // PLACE
    for many, weight in SUMS:
        count = len(single) - (many - 1) * period
        total = weight * np.sum([single[n * period :][:count] for n in range(many)], axis=0)
        for _ in range(CANDIDATES):
            i = int(total.argmax())
            found.append(Candidate(float(total[i]), name, first + PLACE * i, offset))
            total[max(i - APART // PLACE, 0) : i + APART // PLACE + 1] = -np.inf
    return found


def distinct(scores: list[Candidate]) -> list[Candidate]:
    """(A5) Return the best candidates that count and lie apart."""
    kept: list[Candidate] = []
    for one in scores:
        near = any(
            abs(one.start - other.start) <= APART and one.profile == other.profile for other in kept
        )
        if one.score >= LEAST_SCORE and not near and len(kept) < CANDIDATES:
            kept.append(one)
    return kept


class Reader:
    """Reads superframes of a profile, and learns how far its cells can be trusted."""

    def __init__(self, channels: Array, profile: str, key: int, offset: float) -> None:
        self.channels, self.layout, self.offset = channels, layout(profile, key), offset
        groups = len(self.layout.data.dither)
        prior = np.geomspace(0.5, 0.08, groups)
        self.known = np.array([prior, prior])
        self.level = 0.0

    @property
    def mid(self) -> Array:
        """The mid alone, shape (1, n)."""
        return np.asarray(np.mean(self.channels, axis=0, keepdims=True))

    def pull_in(self, place: Place) -> None:
        """(A6) Refine a candidate's place by its pilots."""
        for grid in PULL_IN:
            view = views(self.mid, place.start, place.ratio)[0]
            step = self.layout.pilot_step(self.levels(view)[0] // 4 + self.offset)
            delay, drift, _ = fitted(view, self.layout.pilots, step, self.layout.expected, *grid)
            place.start += delay
            place.ratio *= 1 + drift
        if abs(place.ratio - 1) < STEADY:
            place.ratio = 1.0

    def levels(self, view: View) -> list[int]:
        """(A7) Return the levels to try, the likeliest first."""
        projected = view.projections(self.layout.pilots)
        scores = {}
        for tier in range(-1, 4):
            step = self.layout.pilot_step(tier + self.offset)
            values = soft(projected, self.layout.pilots, step)
            scores[tier] = float((values * self.layout.expected).sum())
        ranked = sorted(scores, key=lambda tier: -scores[tier])
        return [
            level
            for tier in ranked[:2]
            for level in sorted(range(4 * tier, 4 * tier + 4), key=lambda n: abs(n - self.level))
        ]

    def step(self, level: float) -> float:
        """(W20) Return the step of data at a level, moved by the gain."""
        return self.layout.step(level + 4 * self.offset)

    def readings(self, seen: list[View], level: float) -> list[Array]:
        """(A8) Return soft values of all cells where they stand, and as if all stood in the mid."""
        each = [
            soft(v.projections(self.layout.data), self.layout.data, self.step(level)) for v in seen
        ]
        stand = [self.layout.places == n for n in range(len(each))]
        return [np.select(stand, each) if len(each) > 1 else each[0], each[0]]

    def ratios(self, values: list[Array]) -> Array:
        """(A8) Return the ratios of the coded bits."""
        aside = (self.layout.places > 0) * concentration(self.known[0])
        total = values[0] * aside * (len(self.channels) > 1) + values[1] * concentration(
            self.known[1]
        )
        return np.asarray(total.reshape(-1)[self.layout.order])

    def read(self, place: Place) -> Heard | None:
        """(A7 to A9) Read the superframe at a place; correct the place by its bits."""
        seen = views(self.channels, place.start, place.ratio)
        levels = self.levels(seen[0])
        for paths, count in LISTS:
            for level in levels[:count]:
                ratios = self.ratios(self.readings(seen, level))[: self.layout.l0_coded]
                l0 = decode(ratios, self.layout.l0, 24, paths)
                if l0 is not None:
                    return self.settle(place, seen, level, l0, paths)
        return None

    def settle(self, place: Place, seen: list[View], level: int, l0: bytes, paths: int) -> Heard:
        """(A10 to A12) Read L1, and take what the bits say about level, cells and place."""
        start, coded = place.start, self.layout.l0_coded
        bits = carrier.encode(l0, 24, coded)
        fits = {
            n: float((self.readings(seen, n)[0] * self.wanted(bits)).sum())
            for n in range(level - 2, level + 3)
        }
        self.level = max(fits, key=lambda n: (fits[n], -abs(n - level)))
        values = self.readings(seen, self.level)
        l1: bytes | None = None if self.layout.l1 else b""
        ratios = self.ratios(values)[coded:]
        for many in SECOND_PATHS:
            if l1 is None:
                l1 = decode(ratios, self.layout.l1, 16, many, SECOND_LOOKED)
        if l1:
            bits = bits + carrier.encode(l1, 16, len(ratios))
        wanted = self.wanted(bits)
        self.learn(values, wanted)
        weighted = wanted * concentration(self.known[0])
        view = standing(seen, self.layout)
        step = self.step(self.level)
        delay, _, _ = fitted(view, self.layout.data, step, weighted, FOLLOW, np.zeros(1))
        place.correct(delay)
        return Heard(self.layout.name, start, l0, l1, paths)

    def wanted(self, bits: list[int]) -> Array:
        """Return the soft values that coded bits ask for, 0 where unknown."""
        values = np.zeros(FRAMES * len(self.layout.data.dither))
        values[self.layout.order[: len(bits)]] = 1.0 - 2.0 * np.array(bits)
        return values.reshape(FRAMES, -1)

    def learn(self, values: list[Array], wanted: Array) -> None:
        """(A10) Learn each cell position's mean agreement in both readings."""
        count = np.maximum(np.abs(wanted).sum(axis=0), 1)
        for n, value in enumerate(values):
            mean = (value * wanted).sum(axis=0) / count
            self.known[n] = np.clip(0.7 * self.known[n] + 0.3 * mean, 0.02, 0.95)

    def beside(self, place: Place) -> Place | None:
        """(A13) Return where the pilots of a superframe that failed lie, if not at its place."""
        moved = replace(place, age=0)
        for grid in (BESIDE, PULL_IN[1]):
            view = views(self.mid, moved.start, moved.ratio)[0]
            step = self.layout.pilot_step(self.levels(view)[0] // 4 + self.offset)
            delay, _, score = fitted(view, self.layout.pilots, step, self.layout.expected, *grid)
            moved.start += delay
        return moved if score >= LEAST_BESIDE * DEVIATION and moved.start != place.start else None


def follow(reader: Reader, place: Place, end: int) -> Iterator[Heard | None]:
    """(A13) Yield one superframe after another from a place, None for each that failed."""
    misses = 0
    while misses < MOST_MISSES and place.start < end:
        heard = reader.read(place)
        if heard is None:
            moved = reader.beside(place)
            heard = reader.read(moved) if moved else None
            if heard is not None and moved is not None:
                place.start, place.ratio, place.age = moved.start, moved.ratio, moved.age
        misses = 0 if heard else misses + 1
        yield heard
        place.start += LENGTH * place.ratio


def hear(sound: Array, rate: int = 48000, key: int = 0) -> Iterator[Heard]:
    """Yield the superframes of a recording, shape (1 or 2, n)."""
    channels = np.stack([converted(channel, rate) for channel in sound])
    mid = channels.mean(axis=0)
    first = -LENGTH
    offsets: tuple[float, ...] = OFFSETS
    while first < len(mid):
        found = False
        for candidate in search(mid, first, key, offsets):
            reader = Reader(channels, candidate.profile, key, candidate.offset)
            place = Place(candidate.start)
            reader.pull_in(place)
            heard = reader.read(place)
            if heard is None:
                continue
            yield heard
            place.start += LENGTH * place.ratio
            end = place.start
            for one in follow(reader, place, len(mid)):
                if one is not None:
                    yield one
                    end = one.start + LENGTH
            order = sorted(OFFSETS, key=lambda o: o != candidate.offset)
            first, offsets, found = int(end), tuple(order), True
            break
        if not found:
            first, offsets = first + LENGTH, OFFSETS
