"""Do the weights of the interference mask serve a clip that taught nothing?

In: marked clips under an announcer, made as `tests.bench.hunt` does; out: for each clip the
information in its cells, in bits of a superframe, by the weights that all other clips teach and by
those that are shipped. Run:
``python -m tests.bench.interference_weights --store FOLDER CLIP ...``.
"""

import argparse
from pathlib import Path

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from tests.bench.hunt import heard_of, payload_of
from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.interference import ALONE, LARGEST_ODDS
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import LEVELS, SUPERFRAME, TIER_LEVELS, find_profile
from watermark.audio.signal.sample_buffer import StereoBuffer

SPACING = 3
"""Of so many superframes one is looked at."""

Array = NDArray[np.float64]


def cells_of(path: Path, channel: str, seconds: float, store: Path) -> tuple[Array, Array, int]:
    """Clues of a clip's cells and densities at their true bits over those that say nothing.

    Returns
    -------
    clues : ndarray of float64, shape (4, cells)
    density : ndarray of float64, shape (2, cells)
        Of the true bit and of the other one, if the cell is untouched.
    count : int
        Superframes.
    """
    heard = heard_of(path, channel, seconds, store).astype(np.float64)
    tape = StereoBuffer()
    left, right = heard[:, 0], heard[:, -1]
    tape.append_pair((left + right) / 2, (left - right) / 2)
    profile = find_profile("standard")
    demodulator = Demodulator(profile, 0)
    clues, density, numbers = [], [], range(0, len(heard) // SUPERFRAME - 1, SPACING)
    for number in numbers:
        view = read_view(tape, number * SUPERFRAME, 1.0, make_masker(), demodulator.places)
        coded = demodulator.link.encode(*payload_of(number))
        expected = demodulator.layout.spread(1.0 - 2.0 * coded)
        cells = demodulator.layout.cells
        level = max(
            range(len(LEVELS)),
            key=lambda level: float((view.soft(cells, profile.step(level)) * expected).sum()),
        )
        step = profile.pilot_step(0) * 2.0 ** (level // TIER_LEVELS)
        mask = demodulator.coverage.look(view, float(level), step)
        known = expected != 0
        true = np.where(expected > 0, mask.zero, mask.one)
        other = np.where(expected > 0, mask.one, mask.zero)
        clues.append(mask.clues[:, known])
        density.append(np.stack([true[known], other[known]]))
    return np.concatenate(clues, axis=1), np.concatenate(density, axis=1), len(numbers)


def information(weights: Array, clues: Array, density: Array) -> Array:
    """Bits that each cell tells of its own bit, shape (cells,)."""
    odds = np.clip(weights[:-1] @ clues + weights[-1], -LARGEST_ODDS, LARGEST_ODDS)
    share = 1 / (1 + np.exp(-odds))
    true, other = 1 + share * (density - 1)
    return np.asarray(1 - np.log2(1 + other / true))


def taught(clips: list[tuple[Array, Array, int]]) -> Array:
    """Weights that give some clips the most information, each counting alike."""

    def loss(weights: Array) -> float:
        return -float(np.mean([information(weights, *clip[:2]).mean() for clip in clips]))

    return np.asarray(scipy.optimize.minimize(loss, ALONE, method="Powell").x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="clip")
    parser.add_argument("--channel", default="announcer", metavar="NAME")
    parser.add_argument("--seconds", type=float, default=24.0, help="marked sound")
    parser.add_argument("--store", type=Path, required=True, help="folder of marked clips")
    options = parser.parse_args()
    clips = [
        cells_of(path, options.channel, options.seconds, options.store) for path in options.clips
    ]
    for n, (path, clip) in enumerate(zip(options.clips, clips, strict=True)):
        others = taught(clips[:n] + clips[n + 1 :])
        bits = [information(w, *clip[:2]).sum() / clip[2] for w in (others, ALONE)]
        print(
            f"{path.stem:20.20} {bits[0]:6.1f} bits by the others' weights {np.round(others, 2)}, "
            f"{bits[1]:6.1f} by those shipped",
            flush=True,
        )


if __name__ == "__main__":
    main()
