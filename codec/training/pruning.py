"""Vector quantisation of training frames: keep those that differ from all kept before."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

PRUNE_MM = 2.0
"""Distance in mm within which frames count as alike, as in the paper (section 3.1)."""


def prune(frames: ArrayLike, distance_mm: float = PRUNE_MM) -> NDArray[np.int64]:
    """Return the indices of frames that guarantee a least distance between any two.

    The distance of two frames is that of the marker that moved most. Long holds thus weigh no
    more than quick transitions, which conditions the statistics.

    Parameters
    ----------
    frames : array_like, shape (T, K, 3)
        Millimetres, without rigid motion.
    distance_mm : float

    Returns
    -------
    ndarray of int64, shape (n,)
        Increasing.

    Notes
    -----
    Gibert, Bailly, Elisei 2004, section 3.1: 2 mm.

    Examples
    --------
    >>> prune([[[0, 0, 0]], [[1, 0, 0]], [[2.5, 0, 0]]]).tolist()
    [0, 2]
    """
    from codec.cuer.models import _kernels

    array = np.ascontiguousarray(frames, dtype=np.float32)
    # Most mobile markers first: the first comparison separates frames that differ.
    order = np.argsort(-array.std(0).sum(-1), kind="stable")
    kept = np.empty(len(array), dtype=np.int64)
    ordered = np.ascontiguousarray(array[:, order])
    count = _kernels.prune_into(ordered, float(distance_mm) ** 2, kept)
    return kept[:count]
