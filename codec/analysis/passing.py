"""Whether a hand on its way passes a placement closely enough to be read there: *rainbows*.

Cuers are taught that no path between two placements grazes a third one (University of Rhode
Island, Cued Speech training manual, PG-1). A placement is passed where the pointing tip comes
so near to it, in the picture's plane, that it is nearer than any other placement by `CLEAR_MM`,
from any side: within half of the remaining distance to the next one. While
fingers unfold their direction is unclear: only moments count with the hand near a shape,
and it takes `PICTURE_S` of them, so that one picture shows them whenever it is taken.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import Classes, longest_run
from codec.cues.score import PLACEMENTS

FloatArray = NDArray[np.float64]

CLEAR_MM = 8.0
"""By how many mm a placement has to be nearer than any other to be seen for certain."""

PICTURE_S = 0.04
"""Seconds of a picture, 25 a second."""

FORMED_MM = 15.0
"""Distance in mm from a shape, root mean square over the fingers' markers, within which a hand
points: half of that between the shapes of four and of five fingers, whose tips are the same."""


@dataclass(frozen=True, slots=True)
class PassedPlacement:
    """A placement that a hand passed on its way to another.

    Attributes
    ----------
    start_s : float
        When it came nearest, seconds.
    before, after, placement : str
        Where the hand came from, where it went to, and the one in between.
    away_mm, limit_mm : float
        How near the tip came, and from where on it is read there.
    """

    start_s: float
    before: str
    after: str
    placement: str
    away_mm: float
    limit_mm: float


def limits_mm(tips: FloatArray) -> FloatArray:
    """Return within what distance a tip is read at each placement, shape (9, 6), mm; 0 at rest.

    Parameters
    ----------
    tips : ndarray, shape (9, 6, 3)
        Where each shape points at each placement, mm.
    """
    places = tips[:, 1:, :2]
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=3)
    apart[:, np.arange(apart.shape[1]), np.arange(apart.shape[1])] = np.inf
    return np.concatenate([np.zeros((len(apart), 1)), 0.5 * (apart.min(axis=2) - CLEAR_MM)], axis=1)


def passed_by(
    markers: NDArray[np.floating],
    times: FloatArray,
    classes: Classes,
    *,
    placement: NDArray[np.integer],
    leave: FloatArray,
    reach: FloatArray,
) -> Iterable[PassedPlacement]:
    """Return the placements that a hand passes, one for each stroke and placement.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
        Millimetres.
    times : ndarray, shape (T,)
        Of the frames, ascending, seconds.
    classes : Classes
        Of the cuer.
    placement : ndarray of int, shape (G,)
        Where each stroke leads, index in `PLACEMENTS`; the first is where the hand is before all.
    leave, reach : ndarray, shape (G,)
        When each begins and ends, seconds. Where strokes overlap, all they lead from or to count
        as meant.
    """
    shapes, tips = classes.pointing(markers)
    frame = np.arange(len(times))
    least = round(PICTURE_S / float(np.diff(times[:2])[0])) if len(times) > 1 else 1
    best = shapes.argmin(axis=1)
    offset = tips[frame, best, None, :2] - classes.tips[best, :, :2]
    away, limit = np.linalg.norm(offset, axis=2), limits_mm(classes.tips)[best]
    under_way = [
        slice(*np.searchsorted(times, span)) for span in zip(leave[1:], reach[1:], strict=True)
    ]
    meant = np.zeros(away.shape, dtype=np.bool_)
    for stroke, here in enumerate(under_way, start=1):
        meant[here, placement[stroke - 1]] = meant[here, placement[stroke]] = True
    # Passed: a formed shape near a placement that is neither end of the stroke, for a picture at
    # least.
    near = (away < limit) & ~meant & (shapes.min(axis=1) < FORMED_MM)[:, None]
    for stroke, here in enumerate(under_way, start=1):
        for third in np.flatnonzero(near[here].any(axis=0)):
            if longest_run(near[here, third])[1] < least:
                continue
            at = here.start + int(np.where(near[here, third], away[here, third], np.inf).argmin())
            yield PassedPlacement(
                float(times[at]),
                PLACEMENTS[placement[stroke - 1]],
                PLACEMENTS[placement[stroke]],
                PLACEMENTS[third],
                float(away[at, third]),
                float(limit[at, third]),
            )
