"""Weights of ARKit's face units from markers.

Displacements of markers come in, weights 0..1 go out: non-negative least squares on the
displacements that each unit gives the markers, with a preference for small weights that are
alike on both sides: many units move the same few markers (Lawson and Hanson 1974, chapter 23).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

_SIDES = ("Left", "Right")


def _both(*stems: str) -> tuple[str, ...]:
    return tuple(f"{stem}{side}" for stem in stems for side in _SIDES)


ARKIT_NAMES = (
    *(f"eye{what}{side}" for side in _SIDES
      for what in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    "jawForward", "jawRight", "jawLeft", "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker",
    "mouthRight", "mouthLeft", *_both("mouthSmile", "mouthFrown", "mouthDimple", "mouthStretch"),
    "mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper",
    *_both("mouthPress", "mouthLowerDown", "mouthUpperUp", "browDown"),
    "browInnerUp", *_both("browOuterUp"), "cheekPuff", *_both("cheekSquint", "noseSneer"),
    "tongueOut",
)  # fmt: skip
"""The 52 weights in the order of Live Link Face files."""

assert len(ARKIT_NAMES) == len(set(ARKIT_NAMES)) == 52

_FIRMNESS_MM = 0.8
"""Displacement in mm that a full weight has to be worth: smaller ones are noise."""

_LIKENESS_MM = 8.0
"""Displacement in mm that has to show a difference between left and right."""


def unit_weights(
    moved: NDArray[np.float64], units: NDArray[np.float64], names: tuple[str, ...]
) -> NDArray[np.float64]:
    """Return the weights (T, U) under which the units come nearest to displacements.

    Parameters
    ----------
    moved : ndarray, shape (T, K, 3)
        Of the markers, mm.
    units : ndarray, shape (U, K, 3)
        Of the markers by each unit at weight 1, mm.
    names : tuple of str
        Of the units.
    """
    alike = _LIKENESS_MM * _pairs(names)
    firm = _FIRMNESS_MM * np.eye(len(names))
    system = np.vstack([units.reshape(len(names), -1).T, firm, alike])
    zeros = np.zeros(len(names) + len(alike))
    flat = moved.reshape(len(moved), -1)
    found = [nnls(system, np.concatenate([target, zeros]))[0] for target in flat]
    return np.minimum(found, 1.0).reshape(-1, len(names))


def _pairs(names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return a row for each unit that has a twin: the one's weight minus the other's."""
    rows = []
    for number, name in enumerate(names):
        twin = name.removesuffix("Left") + "Right"
        # The jaw and the mouth as a whole go to one side or the other.
        if name.endswith("Left") and name not in ("jawLeft", "mouthLeft") and twin in names:
            rows.append(np.zeros(len(names)))
            rows[-1][number], rows[-1][names.index(twin)] = 1, -1
    return np.array(rows).reshape(-1, len(names))
