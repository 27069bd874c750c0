"""Offline training of the format's tables (`codec.tables`); changing them changes the format.

The program that runs it is ``python -m synth.build_coding --format``.
"""

import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.coding import Coding
from codec.motion import Motion
from codec.score import Score
from codec.superframe import resynthesis_of
from codec.train_coefficients import train_coefficients
from codec.train_score import train_score
from codec.train_voice import blocks_of, near, parts_of

Array = NDArray[np.float64]

TABLES = Path(__file__).parent / "assets" / "tables.json"


def write_tables(document: dict[str, Any], path: Path = TABLES) -> None:
    """Write the tables, one row of numbers per line, through a temporary name."""
    text = json.dumps(document, separators=(",", ":")).replace("],", "],\n")
    handle, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text + "\n")
    Path(name).chmod(0o644)
    Path(name).replace(path)


def format_tables(
    coding: Coding,
    motions: Sequence[Motion],
    imprecise: Sequence[Motion],
    scores: Sequence[Score],
) -> dict[str, Any]:
    """Return the document of the format's tables.

    Parameters
    ----------
    coding : Coding
        Of the motions' voice.
    motions, imprecise : sequence of Motion
        Give the coefficients; the latter those of the loose basis.
    scores : sequence of Score
        Give phones and lengths.
    """
    residual, loose, plain = list[Array](), list[Array](), list[Array]()
    for basis, examples, found in (
        (coding.residual, motions, residual), (coding.loose, imprecise, loose)
    ):  # fmt: skip
        for motion in examples:
            blocks = blocks_of(motion)
            parts = parts_of(motion, len(blocks))
            for k, block in enumerate(blocks):
                prediction = resynthesis_of(coding, near(parts, k), k).params()
                found.append(basis.forward(block - prediction))
                plain.append(coding.plain.forward(block - coding.mean))
    coefficient = train_coefficients([
        (coding.residual, residual), (coding.loose, loose), (coding.plain, plain)
    ])  # fmt: skip
    return {"score": train_score(scores), "coefficient": coefficient}
