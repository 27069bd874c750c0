"""Bars around a picture: the box that is left when lines of one even colour are taken off.

In: a mean picture; out: the box, and the places of pictures that have bars of their own.
Specification: spec/video-carrier.md, section 6.
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

LETTERBOX = Region(0.0, 1 / 8, 1.0, 3 / 4)
"""16:9 in 4:3, between bars."""


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
        left, right = 0, columns  # a title on an even ground, rather than bars
    return Region(left / columns, top / rows, (right - left) / columns, (bottom - top) / rows)


def places_around(box: Region) -> list[Region]:
    """Return likely places of a picture that has bars of its own, which are marked with it.

    It is larger than the box inside all bars: a wide film in a letterbox, one between bars at its
    sides that got others above and below, or the other way round.

    Examples
    --------
    >>> places_around(Region(0.125, 0.125, 0.75, 0.75))[0]
    Region(left=0.0, top=0.125, width=1.0, height=0.75)
    """
    found = []
    if box.top > LETTERBOX.top and box.top + box.height < LETTERBOX.top + LETTERBOX.height:
        found.append(LETTERBOX)
    if box.width < 1 and box.height < 1:
        found.append(Region(0.0, box.top, 1.0, box.height))
        found.append(Region(box.left, 0.0, box.width, 1.0))
    return found


def _ends(picture: NDArray[np.float32], axis: int) -> tuple[int, int]:
    """First line of the content along an axis and the end of its last one."""
    first, last = (even_lines(picture, axis, back, EVEN, SAME) for back in (False, True))
    return first, picture.shape[axis] - last
