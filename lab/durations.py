"""Grow the trees of `synth.planning.prosody.duration` from labelled readings.

Run as ``python -m lab.durations --labels enst-camille-data.yaml``; needs the
packages scikit-learn and PyYAML, which nothing else here does. Every tenth sentence is kept out of
the training and gives the figures printed; the trees are written to the package's asset.

Labels: enst-camille, a reading of 1001 sentences with phone durations (CC BY-SA 4.0).
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES
from codec.files.npz import write_arrays
from synth.planning.prosody.duration import ASSET, DurationTrees, features

_SAMPA = {
    "R": "ʁ", "@": "ə", "E": "ɛ", "9": "œ", "2": "ø", "O": "ɔ", "a~": "ɑ̃", "o~": "ɔ̃",
    "e~": "ɛ̃", "9~": "œ̃", "Z": "ʒ", "S": "ʃ", "H": "ɥ", "J": "ɲ", "N": "ŋ",
}  # fmt: skip
_STANDS_IN = {"ø": "œ", "ɑ": "a", "ɲ": "n", "ŋ": "n"}

_TREES = 600
"""Trees of the boosting."""

_LEAVES = 31
"""Leaves of a tree at most."""

Sentence = tuple[list[str], NDArray[np.float64]]


def read_sentences(path: Path) -> list[Sentence]:
    """Return (phones, durations in seconds) of every labelled sentence."""
    import yaml

    document: list[dict[str, Any]] = yaml.load(path.read_text("utf-8"), Loader=yaml.CSafeLoader)
    return [
        (
            [_SAMPA.get(s["lab"], s["lab"]) for s in item["segments"]],
            np.array([s["dur"] for s in item["segments"]], dtype=np.float64),
        )
        for item in document
    ]


def rank_phones(sentences: list[Sentence]) -> NDArray[np.uint8]:
    """Return each phone's rank by mean duration, the pause 0; unseen phones take a sister's."""
    seen: dict[str, list[float]] = {}
    for symbols, durations in sentences:
        for symbol, duration in zip(symbols, durations, strict=True):
            seen.setdefault(symbol, []).append(float(duration))
    del seen[PAUSE]
    rank = np.zeros(len(PHONES), dtype=np.uint8)
    for place, symbol in enumerate(sorted(seen, key=lambda s: float(np.mean(seen[s]))), 1):
        rank[PHONE_NUMBER[symbol]] = place
    for symbol, sister in _STANDS_IN.items():
        if symbol not in seen:
            rank[PHONE_NUMBER[symbol]] = rank[PHONE_NUMBER[sister]]
    return rank


def table(
    sentences: list[Sentence], rank: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return features and durations in microseconds of all phones that are not pauses."""
    rows, targets = [], []
    for symbols, durations in sentences:
        spoken = np.array([s != PAUSE for s in symbols])
        rows.append(features(symbols, rank)[spoken])
        targets.append(durations[spoken] * 1e6)
    return np.concatenate(rows), np.concatenate(targets)


def grow(x: NDArray[np.uint8], y: NDArray[np.float64], rank: NDArray[np.uint8]) -> DurationTrees:
    """Fit the trees and pack them into arrays."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    model = HistGradientBoostingRegressor(
        learning_rate=0.04,
        max_iter=_TREES,
        max_leaf_nodes=_LEAVES,
        min_samples_leaf=60,
        l2_regularization=1.0,
        early_stopping=False,
        random_state=0,
    ).fit(x, y)
    shape = (_TREES, 2 * _LEAVES - 1)
    feature, threshold, left, right = (np.zeros(shape, dtype=np.uint8) for _ in range(4))
    value = np.zeros(shape, dtype=np.int16)
    for t, (predictor,) in enumerate(model._predictors):
        nodes = predictor.nodes
        own = np.arange(len(nodes))
        leaf = nodes["is_leaf"].astype(bool)
        feature[t, own] = np.where(leaf, 0, nodes["feature_idx"])
        threshold[t, own] = np.where(leaf, 0, np.floor(nodes["num_threshold"]))
        left[t, own] = np.where(leaf, own, nodes["left"])
        right[t, own] = np.where(leaf, own, nodes["right"])
        value[t, own] = np.where(leaf, np.rint(nodes["value"]), 0)
    base = round(float(np.ravel(model._baseline_prediction)[0]))
    return DurationTrees(rank, feature, threshold, left, right, value, base)


def main() -> None:
    """Train, print the figures of the held-out sentences, write the asset."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--labels", type=Path, required=True, help="YAML file of the corpus")
    parser.add_argument("-o", "--output", type=Path, default=ASSET)
    args = parser.parse_args()
    sentences = read_sentences(args.labels)
    training = [s for i, s in enumerate(sentences) if i % 10 != 9]
    rank = rank_phones(training)
    trees = grow(*table(training, rank), rank)
    x, y = table([s for i, s in enumerate(sentences) if i % 10 == 9], rank)
    predicted = trees.predict_us(x)
    rmse_ms = float(np.sqrt(np.mean((predicted - y) ** 2))) / 1000
    print(
        f"held-out phones {len(y)}: RMSE {rmse_ms:.1f} ms, r {np.corrcoef(predicted, y)[0, 1]:.3f}"
    )
    names = ("rank", "feature", "threshold", "left", "right", "value")
    write_arrays(
        args.output,
        {name: getattr(trees, name) for name in names} | {"base_us": np.array(trees.base_us)},
    )


if __name__ == "__main__":
    main()
