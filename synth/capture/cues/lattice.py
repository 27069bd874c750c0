"""How well each frame agrees with every key that may be held, and every way between two keys.

A held key has its shape and placement, and little speed. A key at the side that follows another
placement is often shown short of it, on the line between the two: such states stand beside the keys
themselves. On the way each finger is somewhere
between where the two shapes have it, and the tip near the straight line between the two
placements; fingers and hand need not keep step. Heavy tails (Student's t) let single features fail.
All are log densities of the same features, so that holds and ways can be weighed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, SHAPES
from synth.capture.cues.appearance import KEYS, POINTS_WITH, KeyAppearance
from synth.capture.cues.features import N_FEATURES, HandFeatures

FloatArray = NDArray[np.float64]

_SIDE = PLACEMENT_NUMBER["side"]

_SHORT_OF_SIDE = tuple(PLACEMENT_NUMBER[name] for name in ("mouth", "chin", "throat"))
"""Placements that often leave the side unreached."""

_SHORT = tuple(
    (shape, len(PLACEMENTS) + number)
    for shape in SHAPES[1:]
    for number in range(len(_SHORT_OF_SIDE))
)
"""Shape and number of the place of each state short of the side."""

SHAPE_OF = np.array([shape for shape, _ in (*KEYS, *_SHORT)])
"""Shape of each state."""

_PLACE = np.array([place for _, place in (*KEYS, *_SHORT)])

KEY_OF = np.array([*range(len(KEYS)), *(KEYS.index((shape, _SIDE)) for shape, _ in _SHORT)])
"""Number of the key that each state shows."""

COMES_FROM = np.array(
    [0] * len(KEYS) + [_SHORT_OF_SIDE[place - len(PLACEMENTS)] for _, place in _SHORT]
)
"""Placement before a state short of the side; 0 of the keys themselves."""

_SHORT_PART, _SHORT_SPREAD = 0.5, 0.17
"""How much of the way to the side is made in the mean, and its deviation: parts of the way.
Tried on 64 takes of one real cuer, as the speeds and the slack below."""

FRAME_SHARE = 0.3
"""Neighbouring frames are alike: each counts as this part of an observation."""

_FREEDOM = 7.0
"""Degrees of freedom of the heavy-tailed distribution of a held key's features."""

_FINGERS_FREEDOM = 4.0
"""The same of its fingers, all together: a hand that is read amiss is so in many features."""

_FINGERS_TOGETHER = np.array(
    [
        [1.00, 0.35, 0.30, 0.28, -0.12, 0.19, 0.23],
        [0.35, 1.00, 0.41, 0.37, -0.13, 0.25, 0.09],
        [0.30, 0.41, 1.00, 0.47, -0.09, 0.24, 0.12],
        [0.28, 0.37, 0.47, 1.00, -0.08, 0.23, 0.11],
        [-0.12, -0.13, -0.09, -0.08, 1.00, -0.10, -0.06],
        [0.19, 0.25, 0.24, 0.23, -0.10, 1.00, 0.10],
        [0.23, 0.09, 0.12, 0.11, -0.06, 0.10, 1.00],
    ]
)
"""Correlation of what fingers are off their shape: a palm that turns away shortens all of them.
Half of that of one real cuer; with the correlation of either half of 64 takes of hers the other
half's keys were recognised better, with the whole of it less so."""

_APART = np.linalg.inv(_FINGERS_TOGETHER)
# Half the logarithm of the determinant of the correlation.
_TOGETHER_VOLUME = 0.5 * float(np.linalg.slogdet(_FINGERS_TOGETHER)[1])

_SLACK_S, _SLACK_PRICE = 0.07, 1000.0
"""Fingers may be in shape so much before or after the hand is in place; price per s²."""

_HELD_MM_S, _MOVING_MM_S = 110.0, 350.0
"""Spreads in mm/s of the hand's speed in holds and on the way."""

_FINGERS_BESIDE = 0.17
"""Spread of a finger's closure beside the range between two shapes."""

_PATH_MM, _PATH_PART, _PATH_OF_SPREAD = 25.0, 0.08, 0.25
"""How far off the straight line the hand moves: always, per length, per spread of the targets."""

_RESTING_SHAPE_SD = 1.6
"""Spread of the closures of a hand at rest, which may have any shape."""

_ANY_FINGER = (-0.5, 1.3)
"""Range of closures (0 open, 1 closed) of a hand from or to rest: wider than any shape."""

_STILL_FORMED = 1.0
"""Log likelihood that a way between the same key twice loses against holding it."""

_UNSEEN = -1e4
"""Log likelihood of frames that do not show the hand, for all but rest."""

_PLACES = range(1, len(PLACEMENTS) + len(_SHORT_OF_SIDE))

_TARGETS = ((0, 1), *((place, finger) for finger in (0, 1) for place in _PLACES))
"""Place and pointing finger of the ends of a way."""

END_OF = np.array(
    [_TARGETS.index((p, int(POINTS_WITH[s]))) if s else 0 for s, p in (*KEYS, *_SHORT)]
)
"""Number of the end of ways that each state is."""


@dataclass(frozen=True, slots=True)
class Lattice:
    """Log densities of T frames in S states: the 41 keys, then the sides that fall short.

    Attributes
    ----------
    hold : ndarray of float64, shape (T, S)
    shapes : ndarray of float64, shape (T, 9, 9)
        Of fingers and speed on the way from the first shape to the second.
    places : ndarray of float64, shape (T, E, E)
        Of the tip on the way from the first end to the second; each state has one of the ends.
    """

    hold: FloatArray
    shapes: FloatArray
    places: FloatArray

    def way(self, first: Sequence[int], second: Sequence[int]) -> FloatArray:
        """Return the best density of ways from some states to others, shape (T,)."""
        a, b = np.ix_(list(first), list(second))
        both = self.shapes[:, SHAPE_OF[a], SHAPE_OF[b]] + self.places[:, END_OF[a], END_OF[b]]
        return np.asarray(both.max((1, 2)))

    def scaled(self, share: float) -> "Lattice":
        """Return the lattice whose frames count only a part."""
        return Lattice(share * self.hold, share * self.shapes, share * self.places)


def lattice(seen: HandFeatures, looks: KeyAppearance) -> Lattice:
    """Return the densities; a hand that is not seen rests, or goes to or from rest.

    Parameters
    ----------
    seen : HandFeatures
        At `synth.capture.cues.features.READ_HZ`.
    looks : KeyAppearance
    """
    shown = seen.shown
    looks = _with_short_sides(looks)
    hold = np.full((len(seen), len(KEY_OF)), _UNSEEN)
    shapes = np.full((len(seen), len(SHAPES), len(SHAPES)), _UNSEEN)
    places = np.zeros((len(seen), len(_TARGETS), len(_TARGETS)))
    hold[:, 0] = shapes[:, 0, :] = shapes[:, :, 0] = 0.0
    at = np.flatnonzero(shown)
    if len(at):
        visible = HandFeatures(
            seen.rate_hz,
            seen.fingers[at],
            seen.tips[at],
            seen.pointers[at],
            seen.speed[at],
            seen.stance[at],
        )
        # Log densities: of a key that is held, of a way between shapes, of a way between places.
        hold[at] = FRAME_SHARE * _holds(visible, looks)
        speed = 0.5 * (visible.speed / _MOVING_MM_S) ** 2
        shapes[at] = FRAME_SHARE * (
            _shape_ways(visible.fingers, looks.fingers) - speed[:, None, None]
        )
        places[at] = FRAME_SHARE * _place_ways(visible.pointers, looks)
    return Lattice(hold, shapes, places)


def _with_short_sides(looks: KeyAppearance) -> KeyAppearance:
    """Return the looks with further places: short of the side, from each of three."""
    start = looks.places[list(_SHORT_OF_SIDE)]
    way = looks.places[_SIDE] - start
    spread = np.hypot(_SHORT_SPREAD * np.abs(way), looks.places_sd[list(_SHORT_OF_SIDE)])
    return replace(
        looks,
        places=np.concatenate([looks.places, start + _SHORT_PART * way]),
        places_sd=np.concatenate([looks.places_sd, spread]),
        stances=_between_side(looks.stances),
        stances_sd=_between_side(looks.stances_sd),
    )


def _between_side(stances: FloatArray) -> FloatArray:
    """Return values of placements (6, D) with those halfway to the side behind them."""
    halfway = 0.5 * (stances[list(_SHORT_OF_SIDE)] + stances[_SIDE])
    return np.concatenate([stances, halfway])


def _stance(stance: FloatArray, looks: KeyAppearance) -> FloatArray:
    """Return log densities of the palm's stance at each place, less those anywhere, (T, places)."""
    out = np.zeros((len(stance), len(looks.stances)))
    for x, means, spreads in zip(stance.T, looks.stances.T, looks.stances_sd.T, strict=True):
        own, wide = means[1 : len(PLACEMENTS)], spreads[1 : len(PLACEMENTS)]
        spread = np.sqrt(np.mean(wide**2) + np.var(own))
        anywhere = _tail(((x - own.mean()) / spread) ** 2, 1) - np.log(spread)
        here = _tail(((x[:, None] - means) / spreads) ** 2, 1) - np.log(spreads)
        out += here - anywhere[:, None]
    # A hand at rest may be turned in any way.
    out[:, 0] = 0.0
    return out


def _tail(squares: FloatArray, dimensions: int, freedom: float = _FREEDOM) -> FloatArray:
    return np.asarray(-0.5 * (freedom + dimensions) * np.log1p(squares / freedom))


def _holds(seen: HandFeatures, looks: KeyAppearance) -> FloatArray:
    away = (seen.fingers[:, None] - looks.fingers) / looks.fingers_sd
    squares = ((away @ _APART) * away).sum(-1)
    shape = _tail(squares, N_FEATURES, _FINGERS_FREEDOM) - _TOGETHER_VOLUME
    shape -= np.log(looks.fingers_sd).sum(-1)
    shape[:, 0] = -seen.fingers.shape[1] * np.log(_RESTING_SHAPE_SD) - 2.0
    shape = _slack(shape, seen.rate_hz)
    ends = np.concatenate([seen.tips, seen.pointers[:, 1:]], axis=1)
    gap = (ends[:, :, None] - looks.places) / looks.places_sd
    place = _tail((gap**2).sum(-1), 2) - np.log(looks.places_sd).sum(-1)
    place += _stance(seen.stance, looks)[:, None]
    finger = np.where(SHAPE_OF == 0, 2, POINTS_WITH[SHAPE_OF])
    speed = 0.5 * (seen.speed / _HELD_MM_S) ** 2 + np.log(_HELD_MM_S / _MOVING_MM_S)
    return np.asarray(shape[:, SHAPE_OF] + place[:, finger, _PLACE] - speed[:, None])


def _slack(shape: FloatArray, rate_hz: float) -> FloatArray:
    """Return the best of the densities of shapes nearby in time, less what being there costs."""
    best = shape.copy()
    for step in range(1, round(_SLACK_S * rate_hz) + 1):
        price = _SLACK_PRICE * (step / rate_hz) ** 2
        best[step:] = np.maximum(best[step:], shape[:-step] - price)
        best[:-step] = np.maximum(best[:-step], shape[step:] - price)
    return best


def _shape_ways(fingers: FloatArray, targets: FloatArray) -> FloatArray:
    """Return the densities of fingers between two shapes, (T, 9, 9)."""
    low = np.minimum(targets[:, None], targets)
    high = np.maximum(targets[:, None], targets)
    low[0], low[:, 0] = _ANY_FINGER[0], _ANY_FINGER[0]
    high[0], high[:, 0] = _ANY_FINGER[1], _ANY_FINGER[1]
    x = fingers[:, None, None]
    beside = np.maximum(0.0, np.maximum(low - x, x - high)) / _FINGERS_BESIDE
    width = np.log(high - low + 2.5 * _FINGERS_BESIDE)
    out = (_tail(beside**2, 1) - width).sum(-1)
    # A hand may come up with its shape formed, and go to rest with it.
    number = np.arange(len(SHAPES))
    formed = out[:, number, number] - _STILL_FORMED
    out[:, 0] = np.maximum(out[:, 0], formed)
    out[:, :, 0] = np.maximum(out[:, :, 0], formed)
    return np.asarray(out)


def _place_ways(pointers: FloatArray, looks: KeyAppearance) -> FloatArray:
    """Return the densities of the tip between two places, (T, targets, targets)."""
    places = [place for place, _ in _TARGETS]
    other = (pointers[:, 1] - pointers[:, 0])[:, None]
    with_index = np.array([[finger == 0] for _, finger in _TARGETS])
    ends = looks.places[places] + np.where(with_index, other, 0.0)
    first, way = ends[:, :, None], ends[:, None] - ends[:, :, None]
    length2 = (way**2).sum(-1) + 1e-6
    from_first = pointers[:, 1, None, None] - first
    part = np.clip((from_first * way).sum(-1) / length2, 0.0, 1.0)
    off2 = ((from_first - part[..., None] * way) ** 2).sum(-1)
    length = np.sqrt(length2)
    spread = looks.places_sd[places].mean(1)
    near = spread[:, None] * (1.0 - part) + spread * part
    wide = _PATH_MM + _PATH_PART * length + _PATH_OF_SPREAD * near
    return np.asarray(_tail(off2 / wide**2, 2) - np.log(wide) - np.log(length + 2.5 * wide))
