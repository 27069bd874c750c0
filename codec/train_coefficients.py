"""Tables of quantised coefficients."""

from typing import Any

import numpy as np

from codec.range_coder import cumulative
from codec.tables import CLASSES, CONTEXTS

_SPREAD = (0.6, 1.0, 1.5, 2.2)
"""Scale of a coefficient in each context, relative to its class."""


def laplacian_tables() -> dict[str, Any]:
    """Return ``magnitude`` and ``inset`` for Laplacian coefficients.

    The class says the ratio of standard deviation to step, 2**((class - 16) / 4); cells are a
    step wide, the one of zero reaches to 0.6 of a step.
    """
    magnitude, inset = [], []
    edges = np.concatenate([[0.0], np.arange(15) + 0.6, [np.inf]])
    for kind in range(CLASSES):
        ratio = 2 ** ((kind - 16) / 4)
        rows = []
        for spread in _SPREAD[:CONTEXTS]:
            tail = np.exp(-edges * np.sqrt(2) / (ratio * spread))
            rows.append(np.diff(cumulative(tail[:-1] - tail[1:] + 1e-4)).tolist())
        magnitude.append(rows)
        rate = np.sqrt(2) / ratio
        centre = 0.6 + 1 / rate - 1 / np.expm1(min(rate, 50.0))
        inset.append([round(256 * max(0.0, 1.0 - centre))] * 3)
    return {"magnitude": magnitude, "inset": inset}
