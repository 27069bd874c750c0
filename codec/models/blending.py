"""Blending: where markers come and go, what is expected of hidden ones goes on without a jump.

A mixture completes each frame by itself; when a marker disappears, the expectation of it and of
others that hang on it jumps by what was known and is no more. The steps between frames are kept as
the frames make them by the same markers, and where these change the gap is closed over the moments
before and after: interpolation of an exponentially correlated error from what is seen at its ends
(kriging, Matheron 1963; in pictures the gradients of Perez, Gangnet and Blake 2003).
"""

import numpy as np
from numpy.typing import NDArray

MEMORY_S = 0.02
"""Time in which what was known of a hidden marker is forgotten."""


def blend(
    steps: NDArray[np.float64], seen: NDArray[np.bool_], *, rate_hz: float
) -> NDArray[np.float64]:
    """Return what is to be added to the expectations of hidden markers.

    Parameters
    ----------
    steps : ndarray of float64, shape (T - 1, K, C)
        How much more a marker moves from frame to frame than the same known markers account for:
        zero unless the known ones change.
    seen : ndarray of bool, shape (T, K)
        Nothing is added where a marker is seen.
    rate_hz : float

    Returns
    -------
    ndarray of float64, shape (T, K, C)

    Examples
    --------
    A marker seen at 5 is expected at 1 when it is hidden for a moment.

    >>> seen = np.array([[True], [False], [True]])
    >>> steps = np.array([-4.0, 4.0]).reshape(2, 1, 1)
    >>> blend(steps, seen, rate_hz=100.0)[:, 0, 0].round(1).tolist()
    [0.0, 3.6, 0.0]
    """
    from codec.models import _kernels

    out = np.zeros((len(seen), *steps.shape[1:]))
    stiffness = 1.0 / (MEMORY_S * rate_hz) ** 2
    _kernels.blend_into(
        np.ascontiguousarray(steps), np.ascontiguousarray(seen), stiffness, np.empty(len(seen)), out
    )
    return out
