"""How far moving hands are from hand shapes: backs of hands laid on each other, fingers compared.

The rotation of each fit is the eigenvector of Horn's matrix (Horn 1987, JOSA A 4:629); markers of
the back that lie off the fit are left out of the next one, as in `codec.cuer.models.rigid`.
"""

import numpy as np
from numpy.typing import NDArray

from codec.analysis import _kernels
from codec.compiled import is_loaded

FloatArray = NDArray[np.float64]

_FEW = 600
"""Frames that are compared with arrays where compiled kernels, three times as fast, are not loaded:
loading them takes as long as that."""

_AT_ONCE = 512
"""Frames that are worked on together."""


def shapes_apart(
    back: FloatArray,
    fingers: FloatArray,
    still_back: FloatArray,
    still_fingers: FloatArray,
    *,
    outlier_mm: float,
    rounds: int,
) -> FloatArray:
    """Return how far T hands are from S shapes once the backs of the hands lie on each other.

    Parameters
    ----------
    back : ndarray, shape (T, K, 3)
        Markers of the back of the hand, mm.
    fingers : ndarray, shape (T, F, 3)
        Those of the fingers, mm.
    still_back, still_fingers : ndarray, shape (S, K, 3) and (S, F, 3)
        Those of each shape, mm.
    outlier_mm, rounds : float, int
        As of `codec.cuer.models.rigid.estimate_motion`.

    Returns
    -------
    ndarray, shape (T, S)
        Root mean square over the fingers' markers, mm.
    """
    if len(back) > _FEW or is_loaded():
        out = np.empty((len(back), len(still_back)))
        whole = map(np.ascontiguousarray, (back, fingers, still_back, still_fingers))
        _kernels.shapes_apart_into(*whole, outlier_mm, rounds, out)
        return out
    parts = [np.zeros((0, len(still_back)))]
    for at in range(0, len(back), _AT_ONCE):
        part = slice(at, at + _AT_ONCE)
        fit = _fits(back[part], still_back, outlier_mm, rounds)
        parts.append(_apart(fingers[part], still_fingers, *fit))
    return np.concatenate(parts)


def _fits(
    back: FloatArray, still: FloatArray, outlier_mm: float, rounds: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rotations (T, S, 3, 3) and the centres that they carry from (T, S, 3) and to."""
    n, shapes, markers = len(back), len(still), back.shape[1]
    turn, here, there = _fit(
        np.ones((n * shapes, markers)), np.tile(still, (n, 1, 1)), np.repeat(back, shapes, axis=0)
    )
    kept = np.ones((n * shapes, markers), dtype=bool)
    open_ = np.arange(n * shapes)
    # Fits with points farther than the limit are repeated without these, until none changes; at
    # least three points and half of them stay.
    for _ in range(rounds - 1):
        a, b = still[open_ % shapes], back[open_ // shapes]
        off = (a - here[open_, None]) @ np.swapaxes(turn[open_], 1, 2) + there[open_, None] - b
        apart = np.sqrt(np.einsum("nkc,nkc->nk", off, off))
        far = apart.max(axis=1) > outlier_mm
        far |= ~kept[open_].all(axis=1)
        open_, apart, a, b = open_[far], apart[far], a[far], b[far]
        ordered = np.sort(apart, axis=1)
        limit = np.maximum(
            np.maximum(outlier_mm, 2 * ordered[:, (markers - 1) // 2]), ordered[:, 2]
        )
        keeps = apart <= limit[:, None]
        changed = (keeps != kept[open_]).any(axis=1)
        if not changed.any():
            break
        open_ = open_[changed]
        kept[open_] = keeps[changed]
        turn[open_], here[open_], there[open_] = _fit(
            keeps[changed].astype(np.float64), a[changed], b[changed]
        )
    return (turn.reshape(n, shapes, 3, 3), here.reshape(n, shapes, 3), there.reshape(n, shapes, 3))


def _fit(weight: FloatArray, a: FloatArray, b: FloatArray) -> tuple[FloatArray, ...]:
    """Return rotations (N, 3, 3) that carry points a (N, K, 3) onto b, and both centres (N, 3)."""
    total = weight.sum(axis=1)[:, None]
    here, there = ((weight[:, None] @ x)[:, 0] / total for x in (a, b))
    c = np.swapaxes(weight[..., None] * a, 1, 2) @ b - total[..., None] * (
        here[:, :, None] * there[:, None]
    )
    xx, yy, zz = c[:, 0, 0], c[:, 1, 1], c[:, 2, 2]
    # Horn (1987): the rotation's quaternion is the eigenvector of the greatest eigenvalue of this
    # symmetric matrix of the sums of products c.
    horn = np.empty((len(c), 4, 4))
    horn[:, 0, 0], horn[:, 1, 1] = xx + yy + zz, xx - yy - zz
    horn[:, 2, 2], horn[:, 3, 3] = yy - xx - zz, zz - xx - yy
    horn[:, 1, 0] = c[:, 1, 2] - c[:, 2, 1]
    horn[:, 2, 0] = c[:, 2, 0] - c[:, 0, 2]
    horn[:, 3, 0] = c[:, 0, 1] - c[:, 1, 0]
    horn[:, 2, 1] = c[:, 0, 1] + c[:, 1, 0]
    horn[:, 3, 1] = c[:, 2, 0] + c[:, 0, 2]
    horn[:, 3, 2] = c[:, 1, 2] + c[:, 2, 1]
    w, x, y, z = np.linalg.eigh(horn, UPLO="L")[1][..., 3].T
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.ascontiguousarray(np.moveaxis(turn, 2, 0)), here, there


def _apart(
    fingers: FloatArray, still: FloatArray, turn: FloatArray, here: FloatArray, there: FloatArray
) -> FloatArray:
    """Return the distance of fingers (T, F, 3) from those of S shapes, each fit applied."""
    n, count = len(fingers), fingers.shape[1]
    mixed = still.transpose(0, 2, 1).reshape(-1, count) @ fingers.transpose(1, 0, 2).reshape(
        count, -1
    )
    mixed = mixed.reshape(len(still), 3, n, 3).transpose(2, 0, 1, 3)  # (T, S, 3, 3)
    sums, own_sums = fingers.sum(axis=1)[:, None], still.sum(axis=1)[None]
    mixed = (
        mixed
        - here[..., None] * sums[:, :, None]
        - own_sums[..., None] * there[:, :, None]
        + count * here[..., None] * there[:, :, None]
    )
    own = (still**2).sum(axis=(1, 2)) - 2 * (here * own_sums).sum(-1) + count * (here**2).sum(-1)
    other = (
        (fingers**2).sum(axis=(1, 2))[:, None]
        - 2 * (there * sums).sum(-1)
        + count * (there**2).sum(-1)
    )
    overlap = (np.swapaxes(turn, -1, -2) * mixed).sum(axis=(-1, -2))
    return np.asarray(np.sqrt(np.maximum(own + other - 2 * overlap, 0.0) / count))
