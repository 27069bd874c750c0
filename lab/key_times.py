"""Measure how long a key needs: the tables of `synth.planning.prosody.key_times`.

``python -m lab.key_times`` prints when the virtual cuer begins to show a key, counted
from the key's start, and until when she shows the one before it, in ms, for all pairs of
placements: least-squares figures over random keys at a hurried pace.
"""

import itertools
import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import Classes, shown_keys
from codec.cues.cueing import PLACEMENT_OF, SHAPE_OF, cue
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, Key, Phone, Score
from synth.motion.rules.gesture import GestureSynthesiser

_RATE_HZ = 50.0
"""Frames per second."""

_KEYS, _RUNS = 600, 6
"""Keys of a score, and scores."""

_LENGTHS_S = (0.16, 0.18, 0.2, 0.22)
"""Lengths of keys: those of dense text."""

_USUAL_S = 0.18
"""Length to which the tables belong."""

_FORMS = (0.6, 0.28, 0.12)
"""Shares of consonant with vowel, consonant alone and vowel alone, as in French."""

_OUTLIER_S = 0.04
"""Seconds between a moment and the one that it was mistaken for."""

Pair = tuple[str, str, bool]
"""From which placement (``same``) to which, and whether the shape changes."""


def drill(rng: np.random.Generator) -> Score:
    """Return a score of random keys."""
    phones: list[Phone] = []
    time_s = 1.0
    for _ in range(_KEYS):
        length = float(rng.choice(_LENGTHS_S))
        consonant, vowel = str(rng.choice(list(SHAPE_OF))), str(rng.choice(list(PLACEMENT_OF)))
        form = int(rng.choice(3, p=_FORMS))
        alone = bool(phones) and phones[-1].symbol in SHAPE_OF
        symbols = [[consonant, vowel], [consonant], [consonant] if alone else [vowel]][form]
        edges = np.linspace(time_s, time_s + length, len(symbols) + 1).round(4).tolist()
        phones += [Phone(s, *pair) for s, *pair in zip(symbols, edges, edges[1:], strict=False)]
        time_s += length
    return Score(tuple(phones), tuple(cue(phones)))


Moment = tuple[Pair, int, float, float]
"""Pair, phones of the key to which the hand goes, the interval's length and the moment, seconds."""


def moments(score: Score, seed: int) -> Iterator[tuple[Moment, Moment]]:
    """Yield, for each pair of keys, when the second begins to be shown and the first ends."""
    cuer = GestureSynthesiser(rate_hz=_RATE_HZ, seed=seed)
    markers = cuer.markers(score, 0.0, int(_RATE_HZ * (score.phones[-1].end + 1.0)))
    shown = shown_keys(markers, score, Classes(cuer.targets()[0]), rate_hz=_RATE_HZ)
    for one, other in itertools.pairwise(shown):
        pair = pair_of(one.key, other.key)
        if pair is None or not one.held_s or not other.held_s:
            continue
        start, phones = other.key.start, len(other.key.phones)
        yield (
            (pair, phones, start - one.key.start, other.start_s - start),
            (pair, phones, start - one.key.start, one.start_s + one.held_s - start),
        )


def pair_of(one: Key, other: Key) -> Pair | None:
    """Return the pair of two keys, None for a key that is repeated."""
    turned = one.shape != other.shape
    if one.placement != other.placement:
        return one.placement, other.placement, turned
    return ("same", other.placement, True) if turned else None


def fitted(found: list[Moment]) -> tuple[dict[Pair, float], float]:
    """Return the moment of each pair at `_USUAL_S`, and the addition of a second phone, seconds."""
    pairs = sorted({item[0] for item in found})
    rows = np.zeros((len(found), len(pairs) + 2))
    rows[np.arange(len(found)), [pairs.index(item[0]) for item in found]] = 1
    rows[:, -2] = [item[1] - 1 for item in found]
    rows[:, -1] = [item[2] - _USUAL_S for item in found]
    wanted = np.array([item[3] for item in found])
    kept: NDArray[np.bool_] = np.ones(len(found), dtype=bool)
    for _ in range(4):
        solved, *_rest = np.linalg.lstsq(rows[kept], wanted[kept], rcond=None)
        kept = np.abs(wanted - rows @ solved) < _OUTLIER_S
    return dict(zip(pairs, solved[:-2].tolist(), strict=True)), float(solved[-2])


def main() -> int:
    """Print the tables; return the exit status."""
    found = [
        both
        for run in range(_RUNS)
        for both in moments(drill(np.random.default_rng([run, 17])), run)
    ]
    for name, number in (("begins", 0), ("ends", 1)):
        table, second = fitted([both[number] for both in found])
        print(f"{name}: a second phone {1000 * second:+.0f} ms")
        for turned in (True, False):
            print("  shape changes" if turned else "  same shape")
            for origin in ("same", *list(PLACEMENT_NUMBER)[1:]):
                row = [table.get((origin, to, turned)) for to in PLACEMENTS[1:]]
                print(f"    {origin:7}", *(f"{1000 * (x or 0.0):5.0f}" for x in row))
    return 0


if __name__ == "__main__":
    sys.exit(main())
