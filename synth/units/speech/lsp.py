"""Linear prediction and line spectrum pairs: the spectral distance between units of speech."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError


def linear_prediction(frames: ArrayLike, order: int) -> NDArray[np.float64]:
    """Return predictor polynomials by the autocorrelation method.

    Parameters
    ----------
    frames : array_like of float, shape (T, n)
        Windowed frames of speech, n > order.
    order : int
        Order p of the predictor, at least 1.

    Returns
    -------
    ndarray of float64, shape (T, p + 1)
        A(z) = 1 + a_1 z^-1 + ... + a_p z^-p, minimum phase; a silent frame gives A(z) = 1.

    Notes
    -----
    Levinson-Durbin recursion over all frames at once (Makhoul 1975, section III), with a noise
    floor 90 dB below the frame.
    """
    x = np.asarray(frames, dtype=np.float64)
    if x.ndim != 2 or not 1 <= order < x.shape[1]:
        raise CueError(f"frames of shape {x.shape} do not allow prediction of order {order}")
    size = 1 << int(np.ceil(np.log2(2 * x.shape[1])))
    r = np.fft.irfft(np.abs(np.fft.rfft(x, size, axis=1)) ** 2, size, axis=1)[:, : order + 1]
    r[:, 0] = r[:, 0] * (1 + 1e-9) + 1e-30
    a = np.zeros((len(x), order + 1))
    a[:, 0] = 1.0
    error = r[:, 0].copy()
    for i in range(1, order + 1):
        k = -(a[:, :i] * r[:, i:0:-1]).sum(axis=1) / error
        a[:, 1 : i + 1] += k[:, None] * a[:, i - 1 :: -1][:, :i]
        error *= 1 - k**2
    return a


def line_spectrum_pairs(polynomials: ArrayLike) -> NDArray[np.float64]:
    """Return the line spectrum frequencies of predictor polynomials.

    Parameters
    ----------
    polynomials : array_like of float, shape (T, p + 1)
        Minimum-phase A(z) with leading 1, p even.

    Returns
    -------
    ndarray of float64, shape (T, p)
        Radians in (0, pi), strictly ascending (Itakura 1975; Soong and Juang 1984).

    Examples
    --------
    >>> line_spectrum_pairs([[1.0, 0.0, 0.0]]).round(4)
    array([[1.0472, 2.0944]])
    """
    a = np.asarray(polynomials, dtype=np.float64)
    order = a.shape[1] - 1
    if order % 2:
        raise CueError(f"line spectrum pairs need an even order, not {order}")
    padded = np.pad(a, ((0, 0), (0, 1)))
    total, difference = padded + padded[:, ::-1], padded - padded[:, ::-1]
    # The trivial roots z = -1 and z = 1 are divided out.
    signs = (-1.0) ** np.arange(order + 2)
    p = np.cumsum(total * signs, axis=1)[:, :-1] * signs[:-1]
    q = np.cumsum(difference, axis=1)[:, :-1]
    angles = [np.sort(_upper_angles(poly), axis=1) for poly in (p, q)]
    return np.sort(np.concatenate(angles, axis=1), axis=1)


def _upper_angles(polynomials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles in (0, pi) of the roots of symmetric polynomials of even degree 2m.

    Divided by z^m such a polynomial is real on the unit circle, a cosine series and so a
    Chebyshev series in cos(angle), whose m roots are real: the colleague matrix gives them.
    """
    m = (polynomials.shape[1] - 1) // 2
    c = polynomials[:, m::-1].copy()
    c[:, 1:] *= 2
    colleague = np.zeros((len(c), m, m))
    for i in range(1, m):
        colleague[:, i, i - 1] = 0.5
        colleague[:, i - 1, i] = 0.5
    if m > 1:
        colleague[:, 0, 1] = 0.5
        colleague[:, 1, 0] = 1.0
        colleague = np.swapaxes(colleague, 1, 2)
        colleague[:, -1, :] -= 0.5 * c[:, :m] / c[:, m:]
    else:
        colleague[:, 0, 0] = -c[:, 0] / c[:, 1]
    roots = np.linalg.eigvals(colleague).real
    return np.asarray(np.arccos(np.clip(roots, -1.0, 1.0)))
