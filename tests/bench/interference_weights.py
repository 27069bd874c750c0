"""Do the weights of the interference mask serve a clip that taught nothing?

In: clips, marked and put under an announcer and under another voice as `tests.bench.hunt` does;
out: the part of each clip's superframes that its information lets expect, by the weights that all
other clips teach, by those that are shipped, and by the same odds for all cells. Run:
``python -m tests.bench.interference_weights --store FOLDER CLIP ...``; with ``--believed`` for the
weights that have clues of believed bits, too.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from tests.bench.hunt import heard_of, payload_of
from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.interference import ALONE, LARGEST_ODDS, WITH_BITS
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import LEVELS, SUPERFRAME, find_profile
from watermark.audio.signal.sample_buffer import StereoBuffer

CHANNELS = ("announcer", "other_voice")

PROFILE = find_profile("standard")

THINNED = 5
"""One cell in this many teaches."""

NEEDED, SLOPE = 1.25 * PROFILE.message_bits, 40.0
"""Bits of information at which every second superframe is read, and the scale of the logistic curve
around it. Weights with the most information in the mean serve superframes that are read anyway, at
the cost of those near this limit."""

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class KnownCells:
    """Cells of some superframes.

    Attributes
    ----------
    clues : ndarray of float64, shape (n, superframes, cells)
    true, other : ndarray of float64, shape (superframes, cells)
        Densities at the true bit and at the other one, that of a covered cell being 1.
    """

    clues: Array
    true: Array
    other: Array

    def thinned(self) -> "KnownCells":
        """Return a part of the cells."""
        return KnownCells(*(x[..., ::THINNED] for x in (self.clues, self.true, self.other)))

    def read(self, weights: Array) -> float:
        """Return the part of the superframes that should be read."""
        odds = np.tensordot(weights[:-1], self.clues, 1) + weights[-1]
        share = 1 / (1 + np.exp(-np.clip(odds, -LARGEST_ODDS, LARGEST_ODDS)))
        true, other = 1 + share * (self.true - 1), 1 + share * (self.other - 1)
        bits = (1 - np.log2(1 + other / true)).mean(axis=1) * COUNT
        return float((1 / (1 + np.exp((NEEDED - bits) / SLOPE))).mean())


COUNT = Demodulator(PROFILE, 0).layout.order.size
"""Cells of a superframe that carry a bit."""


def known_cells(path: Path, channel: str, options: argparse.Namespace) -> KnownCells:
    """Look at a clip's superframes at their true places and levels."""
    heard = heard_of(path, channel, options.seconds, options.store).astype(np.float64)
    tape = StereoBuffer()
    left, right = heard[:, 0], heard[:, -1]
    tape.append_pair((left + right) / 2, (left - right) / 2)
    demodulator = Demodulator(PROFILE, 0)
    layout, parts = demodulator.layout, list[Array]()
    for number in range(len(heard) // SUPERFRAME - 1):
        view = read_view(tape, number * SUPERFRAME, 1.0, make_masker(), demodulator.places)
        coded = demodulator.link.encode(*payload_of(number))
        expected = layout.spread(1.0 - 2.0 * coded)
        level = max(
            range(len(LEVELS)),
            key=lambda level: float(
                (view.soft(layout.cells, PROFILE.step(level)) * expected).sum()
            ),
        )
        mask = demodulator.look(view, float(level), 0.0)
        clues = mask.clues
        if options.believed:
            believed = demodulator.link.beliefs(layout.gather(mask.ratios()))
            clues = np.concatenate([clues, mask._agreement(layout.spread(believed))])
        zero, one = layout.gather(mask.zero), layout.gather(mask.one)
        rows = [layout.gather(clue) for clue in clues]
        rows += [np.where(coded == 0, zero, one), np.where(coded == 0, one, zero)]
        parts.append(np.stack(rows))
    cells = np.stack(parts, axis=1)
    return KnownCells(cells[:-2], cells[-2], cells[-1])


def taught(clips: list[list[KnownCells]], start: Array) -> Array:
    """Weights by which most superframes of some clips should be read, each counting alike."""
    thin = [one.thinned() for clip in clips for one in clip]

    def loss(weights: Array) -> float:
        return -float(np.mean([one.read(weights) for one in thin]))

    tolerances = {"maxiter": 4, "xtol": 0.02, "ftol": 1e-5}
    return np.asarray(scipy.optimize.minimize(loss, start, method="Powell", options=tolerances).x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="clip")
    parser.add_argument("--seconds", type=float, default=24.0, help="marked sound")
    parser.add_argument("--store", type=Path, required=True, help="folder of marked clips")
    parser.add_argument("--believed", action="store_true", help="clues of believed bits, too")
    options = parser.parse_args()
    shipped = WITH_BITS if options.believed else ALONE
    clips = [[known_cells(path, name, options) for name in CHANNELS] for path in options.clips]
    even = [np.append(np.zeros(shipped.size - 1), odds) for odds in np.arange(-2.0, 0.6, 0.25)]
    for n, (path, clip) in enumerate(zip(options.clips, clips, strict=True)):
        others = clips[:n] + clips[n + 1 :]
        same = max(even, key=lambda w: sum(one.read(w) for other in others for one in other))
        learnt = taught(others, shipped)
        parts = [100 * np.mean([one.read(w) for one in clip]) for w in (learnt, shipped, same)]
        print(
            f"{path.stem:20.20} {parts[0]:5.1f} % by the others' weights {np.round(learnt, 1)}, "
            f"{parts[1]:5.1f} by those shipped, {parts[2]:5.1f} without clues",
            flush=True,
        )


if __name__ == "__main__":
    main()
