"""Teach `cuecast.evaluate.phone_listener`, the second listener, the phones of French.

Run as ``python -m lab.recogniser.second --speech DIR --texts FILE``. The speech is that of June
Wallack for Asterisk (Debian's asterisk-core-sounds-fr-g722, CC BY-SA 3.0; its texts are in
asterisk-core-sounds-fr), placed by this project's aligner. Each recording is heard as it is, and
faster or slower, higher or lower, in noise. Every tenth recording is kept out and gives the figure
printed. Nothing is learnt from a voice that the listener judges.
"""

import argparse
import itertools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES
from codec.files.npz import write_arrays
from cuecast.evaluate import phone_listener as ear
from cuecast.evaluate.intelligibility import errors
from lab.recogniser.train import Spoken, aligned, recorded
from synth.language.text.pronounce import phonemise
from synth.language.text.sentences import read_sentences
from synth.planning.alignment.recogniser import listen, load_ear

RATIOS = ((5, 4), (6, 7), (9, 8), (5, 6), (6, 5))
"""Ratios by which recordings are resampled, which moves pitch and formants with the rate."""

_NOISE_DB = (15.0, 40.0)
"""Range of the voice's strength over noise in dB, where it is resampled."""

_LEAST_SHARE = 1e-4
"""Symbols of hama with a lower mean probability are left out."""

_HIDDEN = 256
"""Units of each hidden layer."""

_PASSES, _BATCH, _RATE, _DECAY = 8, 256, 1e-3, 1e-5
"""Passes over all frames, frames of a step, its size, and the pull of weights to 0 (Adam: D.
Kingma, J. Ba 2015)."""

_WARM_STEPS = 200
"""Steps after which the size of steps is reached."""

_DROPPED = 0.2
"""Share of hidden units that each step leaves out, and twice that of its inputs (N. Srivastava and
others 2014)."""

_UNSEEN = 0.3
"""Count of a pair of phones that the sentences do not have."""

_EVERY = 10
"""Recordings from one that is kept out to the next."""

Array = NDArray[np.float32]
Layers = dict[str, NDArray[np.float32]]


def labels(item: Spoken, count: int, ratio: float) -> NDArray[np.int64]:
    """Return the number of the phone in each frame of a recording that lasts `ratio` as long."""
    found = np.full(count, PHONE_NUMBER[PAUSE])
    for phone in item.phones:
        first, end = (
            max(0, int(np.ceil(ratio * t / ear.FRAME_S - 0.5))) for t in (phone.start, phone.end)
        )
        found[first : max(end, first + 1)] = PHONE_NUMBER[phone.symbol]
    return found


def examples(
    items: Sequence[Spoken], network: Callable[[NDArray[np.float64]], Array]
) -> Iterator[tuple[Array, NDArray[np.int64]]]:
    """Yield features and phones of each recording that is not kept out, twice."""
    rng = np.random.default_rng(5)
    for number, item in enumerate(items):
        if number % _EVERY == 0:
            continue
        features = ear.frames(item.sound, network)
        yield features, labels(item, len(features), 1.0)
        up, down = RATIOS[number % len(RATIOS)]
        sound = signal.resample_poly(item.sound, up, down)
        noise = rng.normal(size=len(sound)) * sound.std()
        sound = sound + noise * 10 ** (-rng.uniform(*_NOISE_DB) / 20)
        features = ear.frames(sound, network)
        yield features, labels(item, len(features), up / down)


def bigram() -> Array:
    """Return the logarithm of the probability of each phone after each, in the sentences."""
    counts = np.full((len(PHONES), len(PHONES)), _UNSEEN)
    for sentence in read_sentences():
        said = [s for w in phonemise(sentence) for s in (*w.phones, *([PAUSE] if w.pause else []))]
        line = [PHONE_NUMBER[symbol] for symbol in (PAUSE, *said, PAUSE)]
        np.add.at(counts, (line[:-1], line[1:]), 1)
    return np.asarray(np.log(counts / counts.sum(axis=1, keepdims=True)), dtype=np.float32)


def columns_of(features: Sequence[Array]) -> NDArray[np.int16]:
    """Return the numbers of the features that are used: symbols that occur, and mel bands."""
    mel = 2 * ear.BANDS
    shares = np.concatenate([np.exp(f[:, :-mel]).mean(axis=0, keepdims=True) for f in features])
    used = np.flatnonzero(shares.mean(axis=0) > _LEAST_SHARE)
    size = features[0].shape[1]
    return np.concatenate([used, np.arange(size - mel, size)]).astype(np.int16)


def learn(rows: Array, phones: NDArray[np.int64], rng: np.random.Generator) -> Layers:
    """Return the network of two hidden layers that predicts the phones best."""
    mean, spread = rows.mean(axis=0), rows.std(axis=0) + np.float32(1e-3)
    rows = (rows - mean) / spread
    sizes = (rows.shape[1], _HIDDEN, _HIDDEN, len(PHONES))
    weights = [
        (rng.normal(size=(a, b)) * np.sqrt(2 / a) * (b == _HIDDEN)).astype(np.float32)
        for a, b in itertools.pairwise(sizes)
    ]
    offsets = [np.zeros(size, np.float32) for size in sizes[1:]]
    values = [*weights, *offsets]
    moments = [(np.zeros_like(v), np.zeros_like(v)) for v in values]
    every = len(phones) // _BATCH
    for step in range(_PASSES * every):
        if step % every == 0:
            order = rng.permutation(len(phones))
        chosen = order[step % every * _BATCH :][:_BATCH]
        slopes = _slopes(rows[chosen], phones[chosen], weights, offsets, rng)
        rate = _RATE * min(1, (step + 1) / _WARM_STEPS) * (1 - step / (_PASSES * every))
        for value, (first, second), slope in zip(values, moments, slopes, strict=True):
            first += 0.1 * (slope - first)
            second += 0.001 * (slope**2 - second)
            size = np.sqrt(second / (1 - 0.999 ** (step + 1))) + 1e-8
            value -= rate * (first / (1 - 0.9 ** (step + 1)) / size + _DECAY * value)
    counts = np.bincount(phones, minlength=len(PHONES)) + 50.0
    layers = {"mean": mean, "spread": spread, "prior": np.log(counts / counts.sum())}
    layers |= {f"weights{n}": value for n, value in enumerate(weights)}
    return layers | {f"offsets{n}": value for n, value in enumerate(offsets)}


def _slopes(
    x: Array,
    phones: NDArray[np.int64],
    weights: Sequence[Array],
    offsets: Sequence[Array],
    rng: np.random.Generator,
) -> list[Array]:
    """Return the slopes of the cross entropy in all weights, then in all offsets."""
    inputs, masks = [x * _kept(x.shape, _DROPPED / 2, rng)], []
    for w, b in zip(weights[:-1], offsets[:-1], strict=True):
        h = inputs[-1] @ w + b
        masks.append((h > 0) * _kept(h.shape, _DROPPED, rng))
        inputs.append(h * masks[-1])
    z = inputs[-1] @ weights[-1] + offsets[-1]
    z = np.exp(z - z.max(axis=1, keepdims=True))
    z /= z.sum(axis=1, keepdims=True)
    z[np.arange(len(phones)), phones] -= 1
    slope = z / np.float32(len(phones))
    of_weights, of_offsets = [], []
    for number in range(len(weights) - 1, -1, -1):
        of_weights.append(inputs[number].T @ slope)
        of_offsets.append(slope.sum(axis=0))
        if number:
            slope = slope @ weights[number].T * masks[number - 1]
    return [*reversed(of_weights), *reversed(of_offsets)]


def _kept(shape: tuple[int, ...], dropped: float, rng: np.random.Generator) -> Array:
    keep = rng.random(shape, dtype=np.float32) > dropped
    return np.asarray(keep / np.float32(1 - dropped), dtype=np.float32)


def teach(found: Sequence[tuple[Array, NDArray[np.int64]]]) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of the asset."""
    columns = columns_of([features for features, _ in found])
    rows = np.concatenate([ear.around(features[:, columns]) for features, _ in found])
    layers = learn(rows, np.concatenate([phones for _, phones in found]), np.random.default_rng(0))
    asset: dict[str, NDArray[np.generic]] = {k: v.astype(np.float16) for k, v in layers.items()}
    return asset | {"columns": columns, "bigram": bigram().astype(np.float16)}


def main() -> None:
    """Write the asset of the package."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--speech", type=Path, required=True, help="folder of recordings (.g722)")
    parser.add_argument("--texts", type=Path, required=True, help="what they say (.txt.gz)")
    options = parser.parse_args()
    passages = list(recorded(options.speech, options.texts))
    items = aligned(passages, [listen(passage.samples, load_ear()) for passage in passages])
    write_arrays(ear.ASSET, teach(list(examples(items, ear.load_network()))))
    hear = ear.second_listener()
    wrong = np.zeros(2, np.int64)
    for item in items[::_EVERY]:
        wrong += errors([phone.symbol for phone in item.phones], hear(item.sound))
    print(f"{len(items)} recordings; {wrong[0] / wrong[1]:.1%} of the phones kept out are wrong")


if __name__ == "__main__":
    main()
