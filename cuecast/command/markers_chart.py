"""A chart of the 113 markers: where they sit on a cuer, for the laboratory that sticks them on."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENT_NUMBER

SIZE_IN = (16.5, 11.7)
"""Width and height of the chart in inches: a sheet of A3."""

_SHOWN_SHAPE = 5
"""Number of the hand shape that is drawn: all fingers out."""


def draw_markers(voice: Voice, figure: Any) -> None:
    """Draw face and hand of a voice with the names of their markers.

    Parameters
    ----------
    voice : Voice
        Whose head at rest and open hand are drawn.
    figure : matplotlib.figure.Figure
    """
    row = np.zeros((1, len(voice.layout)))
    row[:, voice.hand_columns] = np.concatenate(
        [
            voice.gestures.shape_targets[_SHOWN_SHAPE],
            voice.gestures.placement_targets[_SHOWN_SHAPE, PLACEMENT_NUMBER["side"]],
        ]
    )
    markers = voice.reconstruct(row)[0].astype(np.float64)
    face, hand = markers[: layout.N_FACE], markers[layout.N_FACE :]
    left = [not name.endswith("_R") for name in layout.FACE_MARKERS]
    near = [name for name, shown in zip(layout.FACE_MARKERS, left, strict=True) if shown]
    views = (
        ("face, from the front", face[:, [0, 1]], layout.FACE_MARKERS),
        ("face, from its left", face[left][:, [2, 1]] * [-1.0, 1.0], near),
        ("right hand and forearm, from the back", _flat(hand), layout.HAND_MARKERS),
    )
    for number, (title, points, names) in enumerate(views, start=1):
        axes = figure.add_subplot(1, len(views), number)
        axes.plot(points[:, 0], points[:, 1], "o", markersize=3, color="tab:blue")
        for (x, y), name in zip(points, names, strict=True):
            axes.annotate(name, (x, y), xytext=(2, 2), textcoords="offset points", fontsize=5)
        axes.set_title(title)
        axes.set_aspect("equal")
        axes.set_xlabel("mm")
    figure.suptitle(f"the {layout.N_FACE} markers of the face and {layout.N_HAND} of the hand")


def _flat(hand: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the hand (50, 3) seen from its back, fingers up, (50, 2)."""
    at = {name: hand[number] for number, name in enumerate(layout.HAND_MARKERS)}
    up = at["K3"] - np.mean([at[name] for name in layout.WRIST], axis=0)
    up = up / np.linalg.norm(up)
    across = at["K2"] - at["K5"]
    across = across - (across @ up) * up
    across = across / np.linalg.norm(across)
    # Seen from its back, a right hand with fingers up has its thumb on the left.
    return np.asarray(np.stack([-hand @ across, hand @ up], axis=1))
