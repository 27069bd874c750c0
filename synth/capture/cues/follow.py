"""Where the hand shows the keys of a text, when that is known without its times.

The line of keys is laid through the frames as a whole; one that the cuer left out is left out.
Cuers differ in a few vowels: schwa and eu may be at the side or at the cheek, un at the throat or
cheek, open and closed o at chin or side. The hand decides among them. Whether it was
this text at all follows from the keys that are recognised without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import PLACEMENT_NUMBER, Key
from synth.capture.cues import _kernels
from synth.capture.cues.appearance import ANYBODYS, KEYS, KeyAppearance
from synth.capture.cues.features import READ_HZ, HandFeatures
from synth.capture.cues.lattice import lattice
from synth.capture.cues.line import nearness, pieces
from synth.capture.cues.recognise import HeldKey, arrival, own_frames, recognise_keys

FloatArray = NDArray[np.float64]

_LEFT_OUT = -4.0
"""Natural logarithm of how rarely a cuer leaves out a key."""

ALTERNATIVES = {
    "ə": ("side", "cheek"),
    "œ": ("side", "cheek"),
    "ø": ("cheek", "side"),
    "œ̃": ("throat", "cheek"),
    "ɔ": ("chin", "side"),
    "o": ("side", "chin"),
}
"""Placements of vowels that cuers, and labels, place differently; the charts' own first."""

_BAND = 300
"""Keys before and after the expected one that come into question in a frame."""

_AROUND_S = 0.1
"""Seconds about a key's moment that show how well it fits."""

_AGREES, _FEW_AGREE, _LEAST_AGREE = 0.5, 0.4, 0.3
"""Least mean probability of a believed text's keys, as a part of how sure the take is of
its own keys, how much more by the root of their number (few keys agree by chance), and at least. A
noisy film is sure of nothing, of the right text neither: on takes of a real cuer and of the same
warped to other bodies, right texts had .61 of it or more, wrong ones .50 or less."""


@dataclass(frozen=True, slots=True)
class Followed:
    """Where the keys of a text are.

    Attributes
    ----------
    held : tuple of HeldKey or None
        For each key of the text; None if it was left out. Its placement is the one that was shown.
    agreement : float
        Mean probability of the keys at their places without the text; 0 to 1.
    looks : KeyAppearance
        Of this cuer.
    sure : float
        Mean confidence of the keys that the hand shows, recognised without a text; 0 to 1.
    """

    held: tuple[HeldKey | None, ...]
    agreement: float
    looks: KeyAppearance
    sure: float = 1.0

    @property
    def believed(self) -> bool:
        """Whether the hand shows this text."""
        least = self.sure * (_AGREES + _FEW_AGREE / float(np.sqrt(len(self.held))))
        return self.agreement >= max(_LEAST_AGREE, least)


def follow_keys(
    seen: HandFeatures, keys: Sequence[Key], *, looks: KeyAppearance = ANYBODYS
) -> Followed:
    """Return where the hand shows `keys`, whose times do not count.

    Parameters
    ----------
    seen : HandFeatures
    keys : sequence of Key
        In order; at least one.
    looks : KeyAppearance
        The prior for the cuer.
    """
    alone = recognise_keys(seen, looks=looks)
    looks, own = alone.looks, [one.confidence for one in alone.held if one.shape]
    steady = seen.steady()
    hidden = ~steady.shown
    line, spare = _line(keys)
    paths = _Paths.along(steady, looks, line)
    omit = np.where(spare, 0.0, _LEFT_OUT)
    low, high = _band(steady.shown, len(line))
    at = np.empty(len(line), dtype=np.int64)
    states = np.empty(len(steady), dtype=np.int64)
    # Viterbi: keys in the text's order, each held for some frames or left out at a price, within a
    # band about an even pace.
    _kernels.follow(paths.hold, paths.way, paths.line, paths.pair, omit, low, high, at, states)
    held: list[HeldKey | None] = []
    agreement = []
    before, flow = 0, seen.flow()
    for number in np.flatnonzero(~spare)[1:-1]:
        frames = np.flatnonzero(states == number)
        if not len(frames) or hidden[frames].all():
            held.append(None)
            agreement.append(0.0)
            continue
        begin, end = int(frames[0]), int(frames[-1])
        state = paths.shown(line[number], begin, end)
        first, last = own_frames(begin, end + 1, seen)
        # The key is reached when the movement from the key before has ended.
        reach = arrival(flow, before, first, last)
        before = last
        around = round(_AROUND_S * READ_HZ)
        sure = float(paths.near[max(0, begin - around) : end + around + 1, state].max())
        agreement.append(sure)
        held.append(HeldKey(*KEYS[state], reach / seen.rate_hz, (last - 1) / seen.rate_hz, sure))
    agrees = float(np.mean(agreement)) if agreement else 0.0
    return Followed(tuple(held), agrees, looks, float(np.mean(own)) if own else 1.0)


Alternatives = tuple[int, ...]


def _line(keys: Sequence[Key]) -> tuple[list[Alternatives], NDArray[np.bool_]]:
    """Return the states that each of a line may be, rest at both ends and where a pause may be.

    Also which of them may be spared.
    """
    line: list[Alternatives] = [(0,)]
    spare = [False]
    for number, key in enumerate(keys):
        if number and key.start - keys[number - 1].end > 1e-6:
            line.append((0,))
            spare.append(True)
        line.append(_states(key))
        spare.append(False)
    return [*line, (0,)], np.array([*spare, False])


def _states(key: Key) -> Alternatives:
    """Return the states that show a key: the chart's, then those that others cue for it."""
    names = ALTERNATIVES.get(key.phones[-1], ()) if key.phones else ()
    places = (key.placement, *(n for n in names if n != key.placement and key.placement in names))
    return tuple(KEYS.index((key.shape, PLACEMENT_NUMBER[name])) for name in places)


@dataclass(frozen=True, slots=True)
class _Paths:
    """Densities along a line, T frames.

    `hold` (T, S) and `way` (T, P) are those of the states and ways that occur, `line` (N,) and
    `pair` (N, 2) say which is whose, `single` (T, 41) are the holds of all keys and `near` (T, 41)
    how likely each is at hand.
    """

    hold: NDArray[np.float32]
    way: NDArray[np.float32]
    line: NDArray[np.int64]
    pair: NDArray[np.int64]
    single: NDArray[np.float32]
    near: NDArray[np.float32]

    @classmethod
    def along(
        cls, seen: HandFeatures, looks: KeyAppearance, line: Sequence[Alternatives]
    ) -> "_Paths":
        """Return the densities, made piece by piece so that all ways are never held at once."""
        kinds = {one: number for number, one in enumerate(dict.fromkeys(line))}
        ways: dict[tuple[Alternatives, Alternatives], int] = {}
        pair = np.full((len(line), 2), -1, dtype=np.int64)
        for number, one in enumerate(line):
            for skip in range(min(2, number)):
                before = line[number - 1 - skip]
                if before != one:
                    pair[number, skip] = ways.setdefault((before, one), len(ways))
        hold = np.zeros((len(seen), len(kinds)), dtype=np.float32)
        way = np.zeros((len(seen), max(1, len(ways))), dtype=np.float32)
        single = np.zeros((len(seen), len(KEYS)), dtype=np.float32)
        near = np.zeros((len(seen), len(KEYS)), dtype=np.float32)
        for piece in pieces(seen):
            core = slice(piece.core, piece.until)
            own = slice(piece.core - piece.first, piece.until - piece.first)
            densities = lattice(piece.seen, looks)
            near[core] = nearness(densities, looks)[own]
            shown = piece.seen.shown[own]
            # What is not seen tells nothing against any key.
            single[core] = np.where(shown[:, None], densities.hold[own][:, : len(KEYS)], 0.0)
            for one, number in kinds.items():
                hold[core, number] = single[core][:, one].max(1)
            for (a, b), number in ways.items():
                way[core, number] = np.where(shown, densities.way(a, b)[own], 0.0)
        columns = np.array([kinds[one] for one in line], dtype=np.int64)
        return cls(hold, way, columns, pair, single, near)

    def shown(self, states: Alternatives, begin: int, end: int) -> int:
        """Return which of some states is held best in some frames."""
        return states[int(self.single[begin : end + 1, states].max(0).argmax())]


def _band(shown: NDArray[np.bool_], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the candidate keys of each frame, rising with their likelihood."""
    passed = np.cumsum(shown) / max(1, int(shown.sum()))
    middle = np.floor(passed * (count - 1)).astype(np.int64)
    return np.maximum(middle - _BAND, 0), np.minimum(middle + _BAND + 1, count)
