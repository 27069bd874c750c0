"""Leave a clip out: do the weights of covered cells hold for a clip that did not teach them?

In: clips; each is marked, and a voice laid over it (`announcer`) and its own sound backwards
(`other_voice`). For each clip, weights are fitted to the others by maximum likelihood of the sent
bits, and measured on it, beside the weights in use and those fitted to the clip itself. Out: bits
of information in a superframe's cells by each. Weights generalise where the left-out column is near
that of the clip's own. Run: ``python -m tests.bench.interference_weights CLIP ...``
"""

import argparse
from pathlib import Path

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from cuecast.evaluate.audio import MarkedClip, mark_clip
from cuecast.evaluate.sound_channels import find_channel
from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.interference import ALONE, InterferenceEstimator, InterferenceMask
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import STANDARD, SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer

CHANNELS = ("announcer", "other_voice")

Array = NDArray[np.float64]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=12.0, help="of each clip")
    chosen = parser.parse_args()
    cells = {
        path.stem: cells_of(mark_clip(path, "standard+none", None, 0, limit_s=chosen.seconds))
        for path in chosen.clips
    }
    print(f"bits of a superframe's {STANDARD.data_cells} cells")
    print(f"{'clip':20} {'in use':>8} {'left out':>9} {'own':>8} {'all':>8}  factors without it")
    every = fit(list(cells.values()))
    for name, own in cells.items():
        without = fit([other for key, other in cells.items() if key != name])
        figures = [information(factors, own) for factors in (ALONE, without, fit([own]), every)]
        in_use, left_out, its_own, of_all = figures
        print(
            f"{name:20} {in_use:8.1f} {left_out:9.1f} {its_own:8.1f} {of_all:8.1f}  "
            + np.array2string(without, precision=2)
        )
    print(f"fitted to all: {np.array2string(every, precision=2)}; in use: {ALONE}")


def cells_of(marked: MarkedClip) -> tuple[Array, Array, int]:
    """Clues, shape (5, n), densities of sent and other bit, (2, n), and number of superframes."""
    demodulator = Demodulator(STANDARD, 0)
    estimator = InterferenceEstimator(STANDARD, demodulator.layout, make_pilots(0))
    clues, density, count = [], [], 0
    for name in CHANNELS:
        tape = SampleBuffer()
        heard = find_channel(name)(marked.sound, marked.fs)
        tape.append(heard.mean(axis=1).astype(np.float64))
        for k in range(1, len(heard) // SUPERFRAME - 1):
            view = read_view(tape, float(k * SUPERFRAME), 1.0, make_masker())
            bits = demodulator.layout.spread(
                1.0 - 2.0 * demodulator.link.encode(*marked.payloads[k])
            )
            # The level is not announced: that of the largest likelihood of the sent bits.
            masks = [
                estimator.look(view, level, STANDARD.pilot_step(level)) for level in range(2, 11)
            ]
            mask = max(masks, key=lambda one: float(np.log(_densities(one, bits)[0]).sum()))
            carries = (bits != 0) & (mask.soft != 0)
            clues.append(mask.clues[:, carries])
            density.append(_densities(mask, bits)[:, carries])
            count += 1
    joined = np.concatenate(clues, axis=1)
    return (
        np.concatenate([joined, np.ones((1, joined.shape[1]))]),
        np.concatenate(density, axis=1),
        count,
    )


def _densities(mask: InterferenceMask, bits: Array) -> Array:
    """Densities of an untouched cell of the sent and of the other bit, shape (2, 64, groups)."""
    sent = np.where(bits > 0, mask.zero, mask.one)
    return np.stack([sent, np.where(bits > 0, mask.one, mask.zero)])


def fit(data: list[tuple[Array, Array, int]]) -> Array:
    """Factors of the clues that give the sent bits the largest likelihood."""
    clues = np.concatenate([one[0] for one in data], axis=1)
    excess = np.concatenate([one[1] for one in data], axis=1) - 1

    def loss(factors: Array) -> tuple[float, Array]:
        share = _share(factors, clues)
        sent, other = 1 + share * excess
        slope = share * (1 - share) * ((excess[0] + excess[1]) / (sent + other) - excess[0] / sent)
        return float(np.log1p(other / sent).mean()), clues @ slope / share.size

    return np.asarray(scipy.optimize.minimize(loss, ALONE, jac=True, method="L-BFGS-B").x)


def information(factors: Array, data: tuple[Array, Array, int]) -> float:
    """Bits of a superframe by factors: those sent less the surprise at them."""
    clues, density, count = data
    sent, other = 1 + _share(factors, clues) * (density - 1)
    return float((1 - np.log2(1 + other / sent)).sum() / count)


def _share(factors: Array, clues: Array) -> Array:
    return np.asarray(1 / (1 + np.exp(-np.clip(factors @ clues, -30, 30))))


if __name__ == "__main__":
    main()
