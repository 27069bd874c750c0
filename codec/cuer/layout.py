"""The 113 markers: names, order and groups.

The order is part of voices and motion-capture files: 63 markers of the face, then 50 of the right
hand and forearm. ``_R`` and ``_L`` are the cuer's right (negative x) and left. Counts follow
Gibert, Bailly, Elisei 2004, section 2 (63 + 50) and section 3.1 (18 markers on the throat; the
head's rigid motion from ears, nose and forehead); the names are ours, the paper shows a picture
only.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError


def _pair(*stems: str) -> tuple[str, ...]:
    return tuple(f"{stem}_{side}" for stem in stems for side in "RL")


FOREHEAD = ("FH0", *_pair("FH1", "FH2"))
NOSE = ("NB", *_pair("NW"))
EARS = _pair("EAR")
RIGID_FACE = (*FOREHEAD, *NOSE, *EARS)
"""The ten markers that move with the skull."""

BROWS = _pair("BRW")
UPPER_LIP = ("UL0", *_pair("UL1", "UL2"))
LIP_CORNERS = _pair("LC")
LOWER_LIP = ("LL0", *_pair("LL1", "LL2"))
CHIN = ("CH0", "CH1", "CH2")
JAW = _pair("JW0", "JW1", "JW2")
CHEEKS = _pair("CK0", "CK1", "CK2", "CK3")
NASOLABIAL = _pair("NL0", "NL1")
THROAT = tuple(f"TH{row}_{column}" for row in range(6) for column in "RCL")
"""Six rows of three from under the chin down to the notch of the breastbone."""

FACE_MARKERS = (
    *RIGID_FACE, *BROWS, *UPPER_LIP, *LIP_CORNERS, *LOWER_LIP, *CHIN, *JAW, *CHEEKS,
    *NASOLABIAL, *THROAT,
)  # fmt: skip
"""The 63 markers of head and throat."""

FINGERS = tuple(
    tuple(f"F{finger}{place}" for place in ("1", "2", "3", "T")) for finger in range(1, 6)
)
"""Per finger, thumb first: middle of each phalange on the back, then the nail."""

KNUCKLES = tuple(f"K{finger}" for finger in range(1, 6))
PALM = tuple(f"P{finger}" for finger in range(2, 6))
"""On the back of the hand, over the middle of the metacarpals of index to little finger."""

SIDES = tuple(f"S{finger}" for finger in range(1, 6))
"""Beside the middle phalange of each finger (the thumb's first): they show twist."""

WRIST = tuple(f"W{place}" for place in range(1, 5))
FOREARM = tuple(f"A{ring}{place}" for ring in range(3) for place in range(4))
"""Three rings of four around the forearm, elbow to wrist: the rigid carrier of the hand."""

HAND_MARKERS = (
    *(name for finger in FINGERS for name in finger),
    *KNUCKLES,
    *PALM,
    *SIDES,
    *WRIST,
    *FOREARM,
)
"""The 50 markers of right hand and forearm."""

MARKERS = (*FACE_MARKERS, *HAND_MARKERS)
"""All 113, in the order of every marker array."""

MARKER_NUMBER = {name: number for number, name in enumerate(MARKERS)}
"""Inverse of `MARKERS`."""

N_FACE = len(FACE_MARKERS)
N_HAND = len(HAND_MARKERS)

assert (N_FACE, N_HAND, len(THROAT), len(set(MARKERS))) == (63, 50, 18, 113)


def marker_indices(names: Iterable[str]) -> NDArray[np.intp]:
    """Return the positions of `names` in `MARKERS`, shape (len(names),).

    Raises
    ------
    CueError
        If a name is not a marker.

    Examples
    --------
    >>> marker_indices(["FH0", "F11"]).tolist()
    [0, 63]
    """
    try:
        return np.array([MARKER_NUMBER[name] for name in names], dtype=np.intp)
    except KeyError as error:
        raise CueError(f"unknown marker {error.args[0]!r}") from None


def longest_finger_tip(shape: int) -> str:
    """Return the marker that a hand shape points with: index for 1 and 6, otherwise middle.

    Source: Gibert, Bailly, Elisei 2004, section 4.

    Examples
    --------
    >>> longest_finger_tip(6), longest_finger_tip(4)
    ('F2T', 'F3T')
    """
    return "F2T" if shape in (1, 6) else "F3T"
