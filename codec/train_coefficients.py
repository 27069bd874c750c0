"""Training of the coefficients' tables: counts of indices in example residuals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec import _kernels
from codec.quantise import Setting, quantise_rd, width_mm
from codec.range_coder import TOTAL, cumulative
from codec.tables import CLASSES, CONTEXTS, CoefficientTables, coefficient_tables_of
from codec.transform import Basis

Array = NDArray[np.float64]

_SPREAD = (0.6, 1.0, 1.5, 2.2)
"""Assumed scale of a coefficient in each context, relative to its class, before training."""

_PRIOR = 200.0
"""Weight of that assumption against counted indices."""

_STEPS = range(8, 33, 2)
_ROUNDS = 3
_INSET = 0.45
_ZERO_CELL = 0.6


def train_coefficients(examples: Sequence[tuple[Basis, Sequence[Array]]]) -> dict[str, Any]:
    """Return ``magnitude`` and ``inset`` as nested lists of integers.

    Parameters
    ----------
    examples : sequence of (Basis, sequence of ndarray of float64, shape (32 P,))
        Bases with coefficients in their scan order.
    """
    tables = laplacian_tables()
    for _ in range(_ROUNDS):
        tables = _counted(examples, coefficient_tables_of(tables))
    return tables


def _counted(
    examples: Sequence[tuple[Basis, Sequence[Array]]], tables: CoefficientTables
) -> dict[str, Any]:
    """Return the tables of indices that were chosen under `tables`."""
    counts = np.zeros((CLASSES, CONTEXTS, _kernels.ESCAPE + 1), dtype=np.int64)
    insets = np.zeros((CLASSES, 3, 2))
    for basis, blocks in examples:
        for values in blocks:
            for step in _STEPS:
                _kernels.count_coefficients(
                    values, quantise_rd(values, Setting(step), basis, tables), basis.scan_scales,
                    basis.before, step, width_mm(step), counts, insets,
                )  # fmt: skip
    weights = counts + _PRIOR * np.array(laplacian_tables()["magnitude"]) / TOTAL
    freqs = [[np.diff(cumulative(row)).tolist() for row in kind] for kind in weights]
    weight = insets[:, :, 1] + _PRIOR / 10
    inset = (insets[:, :, 0] + _PRIOR / 10 * tables.inset / 256) / weight
    points = np.rint(256 * np.clip(inset, -_INSET, _INSET)).astype(int)
    return {"magnitude": freqs, "inset": points.tolist()}


def laplacian_tables() -> dict[str, Any]:
    """Return ``magnitude`` and ``inset`` for Laplacian coefficients.

    The class says the ratio of standard deviation to step, 2**((class - 16) / 4); cells are a
    step wide, the one of zero reaches to 0.6 of a step.
    """
    magnitude, inset = [], []
    edges = np.concatenate([[0.0], np.arange(_kernels.ESCAPE) + _ZERO_CELL, [np.inf]])
    for kind in range(CLASSES):
        ratio = 2 ** ((kind - 16) / 4)
        rows = []
        for spread in _SPREAD[:CONTEXTS]:
            tail = np.exp(-edges * np.sqrt(2) / (ratio * spread))
            rows.append(np.diff(cumulative(tail[:-1] - tail[1:] + 1e-4)).tolist())
        magnitude.append(rows)
        rate = np.sqrt(2) / ratio
        centre = _ZERO_CELL + 1 / rate - 1 / np.expm1(min(rate, 50.0))
        inset.append([round(256 * min(max(0.0, 1.0 - centre), 0.49))] * 3)
    return {"magnitude": magnitude, "inset": inset}
