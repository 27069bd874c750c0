"""Two channels as mid, left and right: their values.

In: quantities of mid and side; out: the same of mid, left and right, in this order, which is
that of `watermark.audio.signal.channel_choice`. Specification: spec/audio-carrier.md, W43.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def channels_of(mid: NDArray[Any], side: NDArray[Any]) -> NDArray[Any]:
    """Mid, left and right, shape (3, *shape)."""
    return np.stack([mid, mid + side, mid - side])
