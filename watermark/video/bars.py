"""Bars around a picture: the box that is left when lines of one even colour are taken off.

In: a mean picture; out: the box. Specification: spec/video-carrier.md, section 6.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.video._place_kernels import even_lines
from watermark.video.grid import WHOLE, Region

EVEN = 1.5
"""Largest standard deviation along a line of a bar, in luma of 8 bits."""

SAME = 3.0
"""Largest difference between the mean of a bar's line and that of the outermost one."""

LEAST = 0.3
"""Least part of the width and height that the content has."""


def content_box(mean: NDArray[np.float32]) -> Region:
    """Return the box inside the bars, `WHOLE` if there are none or nothing else.

    Parameters
    ----------
    mean : ndarray of float32, shape (rows, columns)
        Mean luma of a window in levels of 8 bits.

    Examples
    --------
    >>> picture = np.full((100, 100), 16, dtype=np.float32)
    >>> picture[20:80] += 10 * np.add.outer(np.arange(60) % 5, np.arange(100) % 7)
    >>> content_box(picture)
    Region(left=0.0, top=0.2, width=1.0, height=0.6)
    """
    rows, columns = mean.shape
    top, bottom = _ends(mean, 0)
    if bottom - top < LEAST * rows:
        return WHOLE
    left, right = _ends(mean[top:bottom], 1)
    if right - left < LEAST * columns:
        return WHOLE
    return Region(left / columns, top / rows, (right - left) / columns, (bottom - top) / rows)


def _ends(picture: NDArray[np.float32], axis: int) -> tuple[int, int]:
    """First line of the content along an axis and the end of its last one."""
    first, last = (even_lines(picture, axis, back, EVEN, SAME) for back in (False, True))
    return first, picture.shape[axis] - last
