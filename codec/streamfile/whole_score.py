"""The movements of a whole score: the source of prediction for any superframe of a file.

Where the whole line is known, a superframe's prediction takes all of it, not only its neighbours'.
Chunks of some superframes are worked out when they are asked for, in each form of movement, so that
time and memory do not grow with the file. Specification: spec/bitstream.md, section 8.1.
"""

import bisect
from collections import OrderedDict
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from codec.cues.language import Language
from codec.cues.timeline import TICKS
from codec.superframe.merging import MergedScore
from codec.superframe.resynthesis.movements import Movements, movements
from codec.superframe.resynthesis.targets import PARTS, PARTS_PER_S, Targets
from codec.superframe.resynthesis.trajectory import (
    COURSES,
    SHIFTS,
    TrajectoryProfile,
    held_keys,
    phone_weights,
)

Array = NDArray[np.float64]

_CHUNK = 16
"""Superframes that are worked out at once."""

_KEPT = 12
"""Chunks, in one form each, that are remembered."""

_BEFORE_S = 2.0
"""Seconds after which a stroke is over in all parameters, whatever its lateness."""


def kinds_of(language: Language) -> Array:
    """Return the kinds of keys, shape (keys, kinds).

    Kinds are the shapes for the hand, then the placements and the shapes for the forearm.
    """
    shapes, placements = language.n_shapes, language.n_placements
    by_shape = np.repeat(np.eye(shapes), placements, axis=0)
    return np.hstack([by_shape, np.tile(np.eye(placements), (shapes, 1)), by_shape])


_HEARD_TICKS = 25
"""Ticks around a frame whose phones have a say in the face (P7)."""


class WholeResynthesis:
    """The movements that a whole line implies.

    Parameters
    ----------
    joined : MergedScore
        The whole score.
    targets : Targets
        Of the voice.
    """

    def __init__(self, joined: MergedScore, targets: Targets) -> None:
        self._targets = targets
        self.n_shapes = joined.language.n_shapes
        self._kinds = kinds_of(joined.language)
        self._line = joined.line
        self._ends = [sounding.end for sounding in joined.line]
        self._moves = movements(joined, targets.movement, targets.places)
        self._shares = held_keys(self._moves, targets.movement, len(targets.hand))
        self._held = self._shares @ targets.moving
        exact = targets.forearm[self._moves.key]
        self._distance = np.zeros(len(exact))
        self._distance[1:] = np.linalg.norm(np.diff(exact, axis=0), axis=1)
        self._margin = max(map(abs, SHIFTS))
        self._moved: OrderedDict[tuple[int, int], Array] = OrderedDict()
        self._weighed: OrderedDict[tuple[int, int], Array] = OrderedDict()
        self._faces: OrderedDict[tuple[int, int], Array] = OrderedDict()

    def params(self, index: int, course: int = 0, shift: int = 0) -> Array:
        """Return the parameters of superframe `index`, shape (32, P)."""
        chunk, place = divmod(index, _CHUNK)
        begin = TICKS * place
        hand = self._chunk(chunk, course)[begin + self._margin + SHIFTS[shift] :][:TICKS]
        return np.concatenate([self._face(chunk)[begin : begin + TICKS], hand], axis=1)

    def _face(self, chunk: int) -> Array:
        def made() -> Array:
            first, n_frames = chunk * _CHUNK * TICKS, _CHUNK * TICKS
            begin = bisect.bisect_left(self._ends, first - _HEARD_TICKS)
            end = bisect.bisect_right(self._ends, first + n_frames + _HEARD_TICKS) + 1
            # A long phone can begin early and end late; phones follow one another.
            near = self._line[begin : max(end, begin)]
            face = self._targets.face
            return phone_weights(near, first, n_frames, len(face)) @ face

        return _kept(self._faces, (chunk, 0), made)

    def weights(self, index: int, course: int = 0, shift: int = 0) -> Array:
        """Return how far keys of each kind have a say in a superframe, shape (32, kinds).

        The kinds are those of `kinds_of`, of French 24.
        """
        chunk, place = divmod(index, _CHUNK)
        begin = TICKS * place + self._margin + SHIFTS[shift]
        return self._weights(chunk, course)[begin : begin + TICKS]

    def _weights(self, chunk: int, course: int) -> Array:
        def made() -> Array:
            first = chunk * _CHUNK * TICKS - self._margin
            some, way = self._course(first, _CHUNK * TICKS + 2 * self._margin, course)
            begins, ends = (
                np.repeat(late[[0, -1]], [self.n_shapes, len(self._kinds[0]) - self.n_shapes])
                for late in self._targets.lateness
            )
            return way.moved(self._shares[some] @ self._kinds, (begins, ends))

        return _kept(self._weighed, (chunk, course), made)

    def _course(
        self, first: int, n_frames: int, course: int = 0
    ) -> tuple[slice, TrajectoryProfile]:
        """Return the strokes that matter to some frames, and the course that they make."""
        begin, end = PARTS * first, PARTS * (first + n_frames)
        over = round(_BEFORE_S * PARTS_PER_S)
        g = max(int(np.searchsorted(self._moves.reach, begin - over)) - 1, 0)
        last = int(np.searchsorted(self._moves.leave, end + over))
        some, moves = slice(g, max(last, g + 1)), self._moves
        near = Movements(moves.key[some], moves.leave[some], moves.reach[some])
        return some, TrajectoryProfile(
            near, self._targets.movement, begin, n_frames, COURSES[course]
        )

    def _chunk(self, chunk: int, course: int) -> Array:
        def made() -> Array:
            first = chunk * _CHUNK * TICKS - self._margin
            some, way = self._course(first, _CHUNK * TICKS + 2 * self._margin, course)
            return way.moved(
                self._held[some],
                self._targets.lateness,
                distance=self._distance[some],
                arc=self._targets.moving_arc,
            )

        return _kept(self._moved, (chunk, course), made)


def _kept(
    cache: "OrderedDict[tuple[int, int], Array]", key: tuple[int, int], made: Callable[[], Array]
) -> Array:
    if key not in cache:
        cache[key] = made()
        while len(cache) > _KEPT:
            cache.popitem(last=False)
    return cache[key]
