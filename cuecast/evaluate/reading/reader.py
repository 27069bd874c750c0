"""Learning to read keys from takes whose times nobody knows, and reading others.

Taught from a flat start, as recognisers of speech are (Young et al., The HTK Book, section 8.3):
the keys of a take are spread evenly over it, one normal distribution per shape and per placement is
estimated, the keys are laid anew (Viterbi), and so on. Shapes are read from the fingers, placements
from the tip that points, both also from how slow the palm is; ways between keys have one broad
distribution.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, SHAPES, Key
from codec.errors import CueError
from cuecast.evaluate.reading import _kernels
from cuecast.evaluate.reading.view import TakeView
from synth.capture.cues.between import CuerPrior, KeyExample
from synth.capture.cues.follow import ALTERNATIVES

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_SHAPES, _PLACES = len(SHAPES) - 1, len(PLACEMENTS) - 1
"""How many shapes and placements there are but for rest."""

INDEX_POINTS = (1, 6)
"""Shapes that point with the index; the others do so with the middle finger."""

_PLACE_OF = np.array([[0, 2, 3, 4, 5], [1, 2, 3, 4, 5]])
"""Number of the distribution of each pointing finger (rows: index, middle) at each placement. The
side is no point to touch: an index stands farther out there than a middle finger, by 54 mm on 64
real takes."""

_FRAME_SHARE = 0.4
"""Weight of a frame: neighbours say the same."""

_ROUNDS = 12
"""Rounds of teaching; nothing moves after eight."""

_WAY = 0.4
"""Part of each key's time that its way takes in the flat start."""

_FLOOR = 1e-4
"""Variance that every feature has at least."""

_OWN_SPREAD = 0.5
"""How much of a shape's covariance is its own; the rest is that of all."""

_PRICES = np.arange(-3.0, 2.1, 0.5)
"""Prices of a key that are tried: that counts which gives as many keys as were asked for."""

_UNSEEN = -1e3
"""Log density of a key where no hand is seen."""

_LAP, _LAP_SPREAD = np.array([0.0, -1.5]), 0.7
"""Where a hand rests against the mouth, and its spread, in head's widths."""

_FINGERS_DIFFER = np.array([0.07] * 8 + [0.18, 0.12, 0.18, 0.1])
"""Spread between cuers of all shapes' features (`TakeView.fingers`) together: fingers, then thumb
and spread, which differ more (`synth.capture.cues.between`)."""

_PLACES_DIFFER = (0.10, 0.10, 0.03, 0.03, 0.036, 0.048)
"""Spread between cuers of a placement, in head's widths: side of index and of middle finger, mouth,
chin, cheek, throat."""

_SHAPE_DIFFERS, _ALL_PLACES_DIFFER = 0.05, 0.03
"""The same of a feature of one shape alone, and of all placements together."""

_TRUST = 0.7
"""Weight of an example: neighbouring keys err alike."""

_HABIT_ROUNDS = 4
"""Rounds of getting used to a cuer."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A key that was asked for.

    Attributes
    ----------
    shape : int
    places : tuple of int
        Numbers of the placements that count; several where cuers and labels differ.
    phones : tuple of str
    """

    shape: int
    places: tuple[int, ...]
    phones: tuple[str, ...]

    @property
    def finger(self) -> int:
        """The finger that points: 0 index, 1 middle finger."""
        return _finger(self.shape)


@dataclass(frozen=True, slots=True)
class ReaderTake:
    """A take and its transcript.

    Attributes
    ----------
    name : str
    view : TakeView
    asked : tuple of Asked
        In order; none repeats the one before.
    """

    name: str
    view: TakeView
    asked: tuple[Asked, ...]


@dataclass(frozen=True, slots=True)
class ReadKey:
    """A key that was read, from frame `begin` up to `end`."""

    shape: int
    place: int
    begin: int
    end: int


def asked(keys: Iterable[Key]) -> tuple[Asked, ...]:
    """Return the keys that a hand has to show: repeated keys count once."""
    line: list[Asked] = []
    for key in keys:
        others = ALTERNATIVES.get(key.phones[-1], ())
        names = dict.fromkeys((key.placement, *others))
        one = Asked(key.shape, tuple(PLACEMENT_NUMBER[name] for name in names), key.phones)
        if not line or (line[-1].shape, line[-1].places) != (one.shape, one.places):
            line.append(one)
    return tuple(line)


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution: mean (D,), inverse covariance (D, D), log volume."""

    mean: FloatArray
    precision: FloatArray
    volume: float

    def log_density(self, x: FloatArray) -> FloatArray:
        """Return log densities of rows, shape (T,), but for a constant of the dimension."""
        away = x - self.mean
        return np.asarray(-0.5 * (((away @ self.precision) * away).sum(1) + self.volume))

    @property
    def covariance(self) -> FloatArray:
        """Covariance (D, D)."""
        return np.asarray(np.linalg.inv(self.precision))


def _normal(mean: FloatArray, covariance: FloatArray) -> Normal:
    covariance = covariance + _FLOOR * np.eye(len(mean))
    precision = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    return Normal(mean, precision, float(np.linalg.slogdet(covariance)[1]))


def _normal_of(x: FloatArray) -> Normal:
    if len(x) < 2:
        raise CueError("too few takes to teach a reader: a shape or placement is never seen")
    return _normal(x.mean(0), np.atleast_2d(np.cov(x.T)))


@dataclass(frozen=True, slots=True)
class CueReader:
    """A fitted model of shapes 1 to 8 and placements 1 to 5.

    Attributes
    ----------
    shapes, places : tuple of Normal
        Of fingers, and of the pointing tip, numbered by `_PLACE_OF`.
    slow, way_speed, way, rest : Normal
        Of the palm's speed in keys and on ways; of fingers and tips on ways, and at rest.
    enter : ndarray of float64, shape (40,)
        Log of how often each key is used, and the price of any.
    """

    shapes: tuple[Normal, ...]
    places: tuple[Normal, ...]
    slow: Normal
    way_speed: Normal
    way: Normal
    rest: Normal
    enter: FloatArray

    def densities(self, seen: TakeView) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log densities of keys (T, 8, 5), of ways and of rest, both (T,)."""
        shape = np.stack([one.log_density(seen.fingers) for one in self.shapes], axis=1)
        place = np.stack(
            [
                [self.places[number].log_density(seen.tips[:, at]) for number in numbers]
                for numbers, at in zip(_PLACE_OF, (slice(0, 2), slice(2, 4)), strict=True)
            ]
        )
        finger = [_finger(shape) for shape in SHAPES[1:]]
        key = shape[:, :, None] + place[finger].transpose(2, 0, 1)
        slow = self.slow.log_density(seen.speed)
        key = key + slow[:, None, None]
        way = self.way_speed.log_density(seen.speed) + self.way.log_density(_posture(seen))
        rest = np.where(seen.shown, self.rest.log_density(_posture(seen)) + slow, 0.0)
        key[~seen.shown], way = _UNSEEN, np.where(seen.shown, way, 0.1 * _UNSEEN)
        return _FRAME_SHARE * key, _FRAME_SHARE * way, _FRAME_SHARE * rest

    def align(self, take: ReaderTake) -> IntArray:
        """Return the state of each frame: 0 and last are rest, odd ones ways, others keys."""
        key, way, rest = self.densities(take.view)
        columns = [rest]
        for one in take.asked:
            places = [place - 1 for place in one.places]
            columns += [way, key[:, one.shape - 1, places].max(axis=1)]
        columns += [way, rest]
        line = np.empty(len(way), dtype=np.int64)
        skip = np.arange(len(columns)) % 2 == 1
        _kernels.aligned(np.ascontiguousarray(np.stack(columns, axis=1)), skip, line)
        return line

    def read(self, seen: TakeView) -> list[ReadKey]:
        """Return the keys that a take shows, in order."""
        return _keys(*self.densities(seen), self.enter)

    def used_to(self, views: Sequence[TakeView]) -> "CueReader":
        """Return the reader after she has read a cuer for a while, without a transcript.

        At first she allows for what sets cuers apart; each key that she reads leaves less of that.
        """
        fingers = _prior(self.shapes, _FINGERS_DIFFER, [_SHAPE_DIFFERS] * _SHAPES)
        tips = _prior(self.places, [_ALL_PLACES_DIFFER] * 2, _PLACES_DIFFER)
        shown: tuple[list[KeyExample], list[KeyExample]] = [], []
        reader = self
        for _ in range(1 + _HABIT_ROUNDS):
            shapes = _moved(self.shapes, fingers, shown[0], reader.shapes)
            places = _moved(self.places, tips, shown[1], reader.places)
            # Ways and rests lie among the keys, and move with them.
            shift = np.concatenate([_shift(self.shapes, shapes), _shift(self.places, places)])
            reader = replace(
                self,
                shapes=shapes,
                places=places,
                way=replace(self.way, mean=self.way.mean + shift),
                rest=replace(self.rest, mean=self.rest.mean + shift),
            )
            shown = _examples((one, reader.read(one)) for one in views)
        return reader


def _keys(key: FloatArray, way: FloatArray, rest: FloatArray, enter: FloatArray) -> list[ReadKey]:
    """Return the keys of the best line through log densities (T, 8, 5), (T,) and (T,)."""
    flat = np.ascontiguousarray(key.reshape(len(key), -1))
    line = np.empty(len(way), dtype=np.int64)
    _kernels.likeliest(flat, way, rest, enter, line)
    edges = np.flatnonzero(np.diff(line, prepend=-1, append=-1))
    return [
        ReadKey(1 + (state - 1) // _PLACES, 1 + (state - 1) % _PLACES, begin, end)
        for begin, end in itertools.pairwise(edges.tolist())
        if 1 <= (state := int(line[begin])) <= flat.shape[1]
    ]


def _posture(seen: TakeView) -> FloatArray:
    return np.concatenate([seen.fingers, seen.tips[:, 2:]], axis=1)


def _finger(shape: int) -> int:
    """Return the finger that points: 0 index, 1 middle finger."""
    return int(shape not in INDEX_POINTS)


def _tip(seen: TakeView, shape: int) -> FloatArray:
    finger = _finger(shape)
    return seen.tips[:, 2 * finger : 2 * finger + 2]


def _examples(
    read: Iterable[tuple[TakeView, list[ReadKey]]],
) -> tuple[list[KeyExample], list[KeyExample]]:
    """Return the mean fingers of each key by shape, and the mean tips by `_PLACE_OF`."""
    fingers, tips = list[KeyExample](), list[KeyExample]()
    for seen, keys in read:
        for key in keys:
            at = slice(key.begin, key.end)
            fingers.append(KeyExample(key.shape - 1, seen.fingers[at].mean(0), 1.0))
            number = int(_PLACE_OF[_finger(key.shape), key.place - 1])
            tips.append(KeyExample(number, _tip(seen, key.shape)[at].mean(0), 1.0))
    return fingers, tips


def _prior(
    taught: tuple[Normal, ...], together: Sequence[float] | FloatArray, alone: Sequence[float]
) -> CuerPrior:
    """Return what sets cuers apart: spreads of each feature (D,) and of each class (C,)."""
    means, within = _means_and_spreads(taught)
    own = np.diag(np.square(alone))
    return CuerPrior(
        means,
        within,
        tuple((column,) for column in range(means.shape[1])),
        tuple(own + spread**2 for spread in together),
        _TRUST,
    )


def _means_and_spreads(normals: tuple[Normal, ...]) -> tuple[FloatArray, FloatArray]:
    return (
        np.stack([one.mean for one in normals]),
        np.sqrt([np.diag(one.covariance) for one in normals]),
    )


def _shift(before: tuple[Normal, ...], after: tuple[Normal, ...]) -> FloatArray:
    return np.asarray(
        np.mean([b.mean - a.mean for a, b in zip(before, after, strict=True)], axis=0)
    )


def _moved(
    taught: tuple[Normal, ...], prior: CuerPrior, shown: list[KeyExample], now: tuple[Normal, ...]
) -> tuple[Normal, ...]:
    """Return the distributions of one cuer: the means, and how unsure they still are."""
    means, spreads = prior.posterior(shown, *_means_and_spreads(now))
    unsure = spreads**2 - prior.within**2
    return tuple(
        _normal(mean, one.covariance + np.diag(more))
        for one, mean, more in zip(taught, means, unsure, strict=True)
    )


def teach(takes: Sequence[ReaderTake]) -> CueReader:
    """Return a reader who has learnt from takes without times.

    Raises
    ------
    CueError
        If they are too few to show every shape and placement.
    """
    lines = [_flat(take) for take in takes]
    reader = None
    for _ in range(_ROUNDS):
        reader = _estimated(takes, lines, reader)
        lines = [reader.align(take) for take in takes]
    assert reader is not None
    wanted = sum(len(take.asked) for take in takes)
    densities = [reader.densities(take.view) for take in takes]

    def unlike(price: float) -> int:
        return abs(sum(len(_keys(*d, reader.enter + price)) for d in densities) - wanted)

    return replace(reader, enter=reader.enter + min(_PRICES, key=unlike))


def _flat(take: ReaderTake) -> IntArray:
    """Return states that spread the keys evenly over the frames with a raised hand."""
    up = np.flatnonzero(take.view.raised)
    if len(up) < 2 * len(take.asked):
        up = np.arange(len(take.view))
    begin, end, count = int(up[0]), int(up[-1]) + 1, len(take.asked)
    line = np.zeros(len(take.view), dtype=np.int64)
    line[end:] = 2 * count + 2
    number, part = np.divmod(np.arange(end - begin) / (end - begin) * count, 1.0)
    line[begin:end] = 2 * number + np.where(part < _WAY, 1, 2)
    return line


def _estimated(
    takes: Sequence[ReaderTake], lines: list[IntArray], before: CueReader | None
) -> CueReader:
    fingers: list[list[FloatArray]] = [[] for _ in range(_SHAPES)]
    tips: list[list[FloatArray]] = [[] for _ in range(_PLACE_OF.max() + 1)]
    way, rest = list[FloatArray](), list[FloatArray]()
    uses = np.ones((_SHAPES, _PLACES))
    for take, line in zip(takes, lines, strict=True):
        seen, last = take.view, 2 * len(take.asked) + 2
        for number, one in enumerate(take.asked):
            at = seen.shown & (line == 2 * number + 2)
            place = one.places[0]
            uses[one.shape - 1, place - 1] += 1
            if not at.any():
                continue
            tip = _tip(seen, one.shape)[at]
            if len(one.places) > 1 and before is not None:
                own = _PLACE_OF[one.finger]
                fit = [before.places[own[p - 1]].log_density(tip).sum() for p in one.places]
                place = one.places[int(np.argmax(fit))]
            fingers[one.shape - 1].append(seen.fingers[at])
            tips[_PLACE_OF[one.finger, place - 1]].append(tip)
            between = seen.shown & (line % 2 == 1)
        way.append(_posture(seen)[between])
        rest.append(_posture(seen)[seen.shown & ((line == 0) | (line == last))])
    # Keys are where the hand is slow: left to itself, the flat start may settle on the contrary.
    speeds = np.concatenate([take.view.speed[take.view.raised] for take in takes])
    middle = np.median(speeds)
    use = np.log(np.outer(uses.sum(1), uses.sum(0)) / uses.sum() ** 2)
    return CueReader(
        shapes=_with_common(fingers),
        places=tuple(_normal_of(_joined(own)) for own in tips),
        slow=_normal_of(speeds[speeds[:, 0] < middle]),
        way_speed=_normal_of(speeds[speeds[:, 0] >= middle]),
        way=_normal_of(_joined(way)),
        rest=_rest(_joined(rest), _joined(way)),
        enter=use.ravel(),
    )


def _rest(posture: FloatArray, way: FloatArray) -> Normal:
    """Return how hands rest: low, and in any shape, should they be hardly seen to."""
    if len(posture) > 2 * posture.shape[1]:
        return _normal_of(posture)
    covariance = np.cov(way.T)
    covariance[-2:], covariance[:, -2:] = 0.0, 0.0
    covariance[-2:, -2:] = _LAP_SPREAD**2 * np.eye(2)
    return _normal(np.concatenate([way.mean(0)[:-2], _LAP]), covariance)


def _joined(parts: list[FloatArray]) -> FloatArray:
    return np.concatenate(parts) if parts else np.empty((0, 1))


def _with_common(groups: list[list[FloatArray]]) -> tuple[Normal, ...]:
    """Return a distribution per group whose covariance is half that of all."""
    every = [_joined(own) for own in groups]
    if min(map(len, every)) < 2:
        raise CueError("too few takes to teach a reader: a shape or placement is never seen")
    scatters = [(own - own.mean(0)).T @ (own - own.mean(0)) for own in every]
    common = sum(scatters, start=np.zeros_like(scatters[0])) / sum(map(len, every))
    return tuple(
        _normal(
            own.mean(0),
            _OWN_SPREAD * scatter / len(own) + (1 - _OWN_SPREAD) * common
            if len(own) > 3 * own.shape[1]
            else common,
        )
        for own, scatter in zip(every, scatters, strict=True)
    )
