"""Lines of keys laid through a take: the likeliest one, and how likely each key is.

A line of keys and ways between them is laid through the frames by dynamic programming (Viterbi
1967); how likely each key is follows from all lines together (forward and backward sums). The
frames of a line's keys serve to learn the cuer's looks.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import PLACEMENT_NUMBER
from synth.capture.cues import _kernels
from synth.capture.cues.appearance import ANYBODYS, KEYS, POINTS_WITH, KeyAppearance, KeyExamples
from synth.capture.cues.between import KeyExample
from synth.capture.cues.features import READ_HZ, HandFeatures
from synth.capture.cues.lattice import COMES_FROM, END_OF, KEY_OF, SHAPE_OF, Lattice, lattice

FloatArray = NDArray[np.float64]

# How often French uses each shape and placement: see below.
_SHAPE_USE = np.array([0.152, 0.105, 0.209, 0.070, 0.298, 0.131, 0.009, 0.027])
_PLACE_USE = np.array([0.539, 0.159, 0.136, 0.030, 0.137])
"""How often French uses each shape and placement, by the frequency of words (Lexique 3.83)."""

_SHORT = -1.7
"""Price of a side that falls short, for how rarely a hand stops on its way there. At a third of it
64 takes of a real cuer are read as well (-3 costs .01), but mouth and chin of others, whose hands
arrive, are taken for it: of 885 keys of constructed cuers 10 more are right so, of 59 in rendered
pictures 2 more."""

_ELSEWHERE = -1.0
"""Price of a side that falls short from where the hand did not come."""

_SAME_SHAPE, _SAME_AT_SIDE = -0.5, -0.4
"""Prices of two keys of one shape in a row, and more if the first is at the side: fingers that form
the next shape ahead of the hand look like a key of their own."""

_NEVER = -50.0
"""Price of what does not happen: a key that follows itself, the one short of its place."""

_REST_USE = 0.14
"""How often the hand rests, of all keys."""

_EDGE = -3.0
"""Price of a line that begins or ends at a key, not at rest."""

_LIKELY = 0.05
"""Least probability of candidates for a held key that looks are learnt from."""

_PIECE_S, _MARGIN_S = 30.0, 4.0
"""Seconds that are searched at once, and those on either side that are not kept."""


def prices(looks: KeyAppearance) -> FloatArray:
    """Return the price of going from one state to another, (S, S): how rarely it is used."""
    keys = np.outer(_SHAPE_USE, _PLACE_USE).ravel()
    use = np.concatenate([[_REST_USE], keys / keys.sum()])
    eager = np.where(np.arange(len(use)) > 0, looks.eagerness, 0.0)
    enter = (np.log(use) + eager)[KEY_OF] + np.where(COMES_FROM > 0, _SHORT, 0.0)
    shape, place = np.array(KEYS)[KEY_OF].T
    same = (shape[:, None] == shape) & (shape > 0)
    from_side = same & (place == PLACEMENT_NUMBER["side"])[:, None]
    # The place of a state that falls short is where it is, so it is none that one comes from.
    placed = np.where(COMES_FROM > 0, -1, place)
    elsewhere = (COMES_FROM > 0) & (placed[:, None] != COMES_FROM)
    itself = (KEY_OF[:, None] == KEY_OF) & ~np.eye(len(KEY_OF), dtype=np.bool_)
    return np.asarray(
        enter
        + _SAME_SHAPE * same
        + _SAME_AT_SIDE * from_side
        + _ELSEWHERE * elsewhere
        + _NEVER * itself
    )


@dataclass(frozen=True, slots=True)
class KeyRun:
    """Frames `begin` to `end` that hold key number `state`, with a probability.

    `short` if the hand was not quite there.
    """

    state: int
    begin: int
    end: int
    probability: float
    short: bool = False


@dataclass(frozen=True, slots=True)
class FramePiece:
    """Frames that are worked on together; those from `core` on count, up to `until`."""

    seen: HandFeatures
    first: int
    core: int
    until: int

    def line(self, looks: KeyAppearance) -> "LikelyLine":
        """Return the best line of keys by some looks."""
        densities = lattice(self.seen, looks)
        states, value = likeliest(densities, looks)
        return LikelyLine(self, states, nearness(densities, looks), value)


@dataclass(frozen=True, slots=True)
class LikelyLine:
    """A line of keys through a piece of T frames.

    `states` (T,) are held, -1 on the way; `near` (T, 41) says how likely each key is at hand and
    `value` how likely the line is, as a logarithm.
    """

    piece: FramePiece
    states: NDArray[np.int64]
    near: FloatArray
    value: float

    def runs(self) -> list[KeyRun]:
        """Return the keys held within the core of the piece."""
        piece, found = self.piece, []
        for state, a, b in _runs(self.states):
            begin, end = piece.first + a, piece.first + b
            if piece.core <= begin < piece.until:
                key = int(KEY_OF[state])
                likely = float(self.near[a:b, key].max())
                found.append(KeyRun(key, begin, end, likely, bool(COMES_FROM[state])))
        return found

    def examples(self, looks: KeyAppearance) -> KeyExamples:
        """Return what each held key showed, as each of the keys that it may be."""
        fingers, places, stances = list[KeyExample](), list[KeyExample](), list[KeyExample]()
        seen, first = self.piece.seen, self.piece.first
        for run in self.runs():
            at = np.arange(run.begin - first, run.end - first)
            at = at[seen.shown[at]]
            if not run.state or not len(at):
                continue
            # The stillest frame decides what the key may be; each candidate gives an example with
            # its probability as weight, from its most typical frame.
            slow = at[seen.speed[at].argmin()]
            for key in np.flatnonzero(self.near[slow] > _LIKELY):
                shape, place = KEYS[key]
                weight = float(self.near[slow, key])
                if not shape:
                    continue
                own = seen.fingers[at]
                best = _unlike(own, looks.fingers[shape], looks.fingers_sd[shape]).argmin()
                fingers.append(KeyExample(shape, own[best], weight))
                if run.short and key == run.state:
                    continue
                tips = seen.tips[at, POINTS_WITH[shape]]
                best = _unlike(tips, looks.places[place], looks.places_sd[place]).argmin()
                places.append(KeyExample(place, tips[best], weight))
                stances.append(KeyExample(place, seen.stance[at[best]], weight))
        return KeyExamples(tuple(fingers), tuple(places), tuple(stances))


def _unlike(x: FloatArray, mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Return squared distances (T,) in spreads."""
    return np.asarray((((x - mean) / spread) ** 2).sum(1))


def joined(parts: Sequence[KeyExamples]) -> KeyExamples:
    """Return the examples of several parts."""
    return KeyExamples(
        tuple(one for part in parts for one in part.fingers),
        tuple(one for part in parts for one in part.places),
        tuple(one for part in parts for one in part.stances),
    )


def line_value(seen: HandFeatures, looks: KeyAppearance = ANYBODYS) -> float:
    """Return the log likelihood of the best line of keys, but for a constant of the frames."""
    return likeliest(lattice(seen.steady(), looks), looks)[1]


def likeliest(densities: Lattice, looks: KeyAppearance) -> tuple[NDArray[np.int64], float]:
    """Return the held state of each frame, or -1 on the way, (T,), and the line's likelihood."""
    states = np.empty(len(densities.hold), dtype=np.int64)
    value = _kernels.likeliest(
        densities.hold, densities.shapes, densities.places, SHAPE_OF, END_OF, prices(looks),
        _EDGE, states,
    )  # fmt: skip
    return states, float(value)


def nearness(densities: Lattice, looks: KeyAppearance) -> FloatArray:
    """Return how likely each key is at hand in each frame: held, coming or just left, (T, 41)."""
    near, share = np.empty_like(densities.hold), looks.sure_share
    part = densities.scaled(share)
    _kernels.nearness(
        part.hold, part.shapes, part.places, SHAPE_OF, END_OF, share * prices(looks),
        share * _EDGE, near,
    )  # fmt: skip
    whole = near[:, : len(KEYS)].copy()
    for state in range(len(KEYS), len(KEY_OF)):
        whole[:, KEY_OF[state]] += near[:, state]
    return np.minimum(whole, 1.0)


def pieces(seen: HandFeatures) -> Iterator[FramePiece]:
    """Yield pieces of frames at `READ_HZ`; they overlap: memory does not grow with the take."""
    size, margin = round(_PIECE_S * READ_HZ), round(_MARGIN_S * READ_HZ)
    for core in range(0, len(seen), size):
        first, until = max(0, core - margin), min(core + size, len(seen))
        last = min(until + margin, len(seen))
        yield FramePiece(seen.part(slice(first, last)), first, core, until)


def _runs(states: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Return state, begin and end of each stretch that holds a key."""
    edges = np.flatnonzero(np.diff(states, prepend=-2, append=-2))
    return [
        (int(states[a]), int(a), int(b)) for a, b in itertools.pairwise(edges) if states[a] >= 0
    ]
