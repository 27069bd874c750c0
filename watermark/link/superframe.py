"""What any carrier's receiver hands on: the two classes of a superframe and when it was on air."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

T = TypeVar("T")

SUPERFRAME_S = 0.64
"""Duration of a superframe in seconds, whatever carries it."""


@dataclass(frozen=True, slots=True)
class ReceivedSuperframe:
    """A superframe as a carrier's receiver found it.

    Attributes
    ----------
    l0, l1 : bytes or None
        Payload of the two classes, None where the check failed; L1 is never given without L0.
    position_s : float
        Start of its on-air span on the received stream's clock.
    confidence : float
        0 to 1.
    ber_estimate : float
        Share of wrong coded bits before correction, of the classes that were decoded.
    ratios : ndarray of float64, shape (coded bits,), or None
        Log-likelihood ratios as decoded, for adding those of another carrier.

    Examples
    --------
    >>> ReceivedSuperframe(None, None, 12.8, 0.0).l0 is None
    True
    """

    l0: bytes | None
    l1: bytes | None
    position_s: float
    confidence: float
    ber_estimate: float = 0.0
    ratios: NDArray[np.float64] | None = field(default=None, compare=False, repr=False)


def find_named(choices: Mapping[str, T], name: str, kind: str) -> T:
    """Return the choice called `name`; `kind` is the user's word for it.

    Raises
    ------
    CueError
        If there is none.

    Examples
    --------
    >>> find_named({"one": 1, "two": 2}, "two", "number")
    2
    """
    try:
        return choices[name]
    except KeyError:
        raise CueError(f"unknown {kind} {name!r}, known: {', '.join(choices)}") from None
