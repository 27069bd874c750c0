"""Sound of any rate and number of channels to the aligner's mono."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal

from codec.errors import CueError
from synth.planning.alignment.recogniser import FS


def mono(samples: ArrayLike, fs: int) -> NDArray[np.float64]:
    """Return sound of shape (n,) or (n, channels) as one channel at `FS`.

    Raises
    ------
    CueError
        If the sampling rate is not within 8 to 192 kHz.
    """
    if not 8_000 <= fs <= 192_000:
        raise CueError(f"sampling rate {fs} Hz is not within 8000..192000")
    x = np.asarray(samples, dtype=np.float64)
    x = x.mean(axis=1) if x.ndim > 1 else x
    common = np.gcd(fs, FS)
    return x if fs == FS else np.asarray(signal.resample_poly(x, FS // common, fs // common))
