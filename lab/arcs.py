"""Solve the arcs of strokes: the least change of the usual one that passes no third placement.

For every key and every next one the pointing tip's path is followed in the picture's plane as the
synthesiser will lead it, in quick and in slow strokes; arcs are tried on a grid. How near is too
near says `codec.analysis.passing`.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from codec.analysis.passing import limits_mm
from codec.cuer.layout import HAND_MARKERS, longest_finger_tip
from codec.cuer.movement import FLOWING
from codec.cues.score import PLACEMENTS, SHAPES
from synth.motion.body.body import Body
from synth.motion.body.reach import key_poses
from synth.motion.body.shapes import all_shapes
from synth.motion.rules.gesture import ARC
from synth.motion.rules.movement import law

FloatArray = NDArray[np.float64]

_TRIED = np.array(list(itertools.product(np.arange(-66, 19, 6), np.arange(-48, 49, 6)))) / 100.0
"""Outwards and upwards, per mm of way."""

_STROKES_S, _FROM_REST_S = (0.2, 0.45), (0.55, 0.7)
"""Lengths of strokes."""

_MOMENTS = 40
"""Points of a path that are looked at."""

_FORMED = 0.45
"""Part of a change of fingers up to which they show the old shape, and from whose rest on the new
one."""

_WANTED_MM, _NEEDED_MM = 10.0, 3.0
"""How much farther from a third placement than its limit a path should stay, and has to."""

_PER_BEND, _PER_NEEDED = 20.0, 6.0
"""Millimetres of wanted distance that a change of the arc by 1 is worth, and a needed one."""

_CUT = ((0.0, 0.0), (0.2, 0.0), (0.0, 0.2))
"""Parts of the way that are left out at its beginning and at its end, where strokes overlap and the
hand comes from where it goes to, or goes back."""

_WRIST_ANGLES = 3
"""Angles of the hand that are the wrist's and the forearm's."""


def solve_arcs(body: Body, wrist: FloatArray, forearm: FloatArray) -> NDArray[np.int8]:
    """Return the arcs of a cuer.

    Parameters
    ----------
    body : Body
    wrist, forearm : ndarray, shapes (9, 6, 3) and (9, 6, 6)
        As `synth.motion.body.reach.solve_reach` gives them.

    Returns
    -------
    ndarray of int8, shape (54, 54, 2)
        From key to key (6 shape + placement): how far the middle of a stroke lies outwards and
        upwards of the straight way, hundredths of a mm per mm of way; x to the cuer's left.
    """
    n = len(PLACEMENTS)
    shape, placement = (grid.ravel() for grid in np.mgrid[0 : len(SHAPES), 0:n])
    angles, arm = key_poses(wrist, forearm, shape, placement)
    place = arm[:, 3:]
    tips = np.empty((len(SHAPES), len(angles), 3))
    for number, fingers in enumerate(all_shapes()):
        bent = angles.copy()
        bent[:, _WRIST_ANGLES:] = fingers[_WRIST_ANGLES:]
        at = HAND_MARKERS.index(longest_finger_tip(number))
        tips[number] = body.hand(bent, arm)[:, at] - place
    goal = tips[shape, np.arange(len(shape))] + place
    goal = goal.reshape(len(SHAPES), n, 3)
    limit = limits_mm(goal)
    usual = np.rint(100.0 * np.array(ARC[:2])).astype(np.int8)
    arcs = np.tile(usual, (len(shape), len(shape), 1))
    for before, after in itertools.product(range(len(shape)), repeat=2):
        if placement[before] != placement[after] and _cues(before, n) and _cues(after, n):
            margin = _margins(before, after, place, tips, goal, limit)
            worth = (
                np.maximum(0.0, _WANTED_MM - margin)
                + _PER_NEEDED * np.maximum(0.0, _NEEDED_MM - margin)
                + _PER_BEND * np.linalg.norm(_TRIED - ARC[:2], axis=1)
            )
            arcs[before, after] = np.rint(100.0 * _TRIED[worth.argmin()])
    return arcs


def _cues(key: int, n: int) -> bool:
    """Return whether a key occurs: the closed fist rests, the other shapes cue."""
    return (key < n) == (key % n == 0)


def _margins(
    before: int,
    after: int,
    place: FloatArray,
    tips: FloatArray,
    goal: FloatArray,
    limit: FloatArray,
) -> FloatArray:
    """Return how much farther than its limit the nearest third placement stays, for each arc."""
    n = len(PLACEMENTS)
    thirds = [p for p in range(1, n) if p not in (before % n, after % n)]
    way = place[after] - place[before]
    rests = before % n == 0 or after % n == 0
    least = np.full(len(_TRIED), np.inf)
    rule, progress = FLOWING, law("minimum-jerk")
    for length_s in _FROM_REST_S if rests else _STROKES_S:
        apart = min(1.0, length_s / rule.stroke_s)
        times = np.linspace(0.0, length_s + apart * rule.turn_end_s, _MOMENTS)

        def gone(begin_s: float, end_s: float) -> FloatArray:
            first, last = apart * begin_s, length_s + apart * end_s  # noqa: B023
            part = np.clip((times - first) / (last - first), 0.0, 1.0)  # noqa: B023
            return np.asarray(progress(part**rule.power))

        moved = gone(0.0, 0.0)
        turned = gone(rule.turn_begin_s, rule.turn_end_s)
        shaped = gone(rule.fingers_begin_s, rule.fingers_end_s)
        middle = 0.5 if before // n == after // n else _FORMED
        for key, shown in ((before, shaped <= middle), (after, shaped >= 1.0 - middle)):
            shape = key // n
            if shape == 0 or not shown.any():
                continue
            p, q = moved[shown, None], turned[shown, None]
            path = place[before] + p * way
            path = path + tips[shape, before] + q * (tips[shape, after] - tips[shape, before])
            bulge = 4.0 * p * (1.0 - p) * np.linalg.norm(way)
            for early, late in _CUT:
                cut = path + (early * (1.0 - p) ** 2 - late * p**2) * way
                tip = cut[None, :, :2] + bulge[None] * _TRIED[:, None]
                for third in thirds:
                    away = np.linalg.norm(tip - goal[shape, third, :2], axis=2).min(axis=1)
                    least = np.minimum(least, away - limit[shape, third])
    return least
