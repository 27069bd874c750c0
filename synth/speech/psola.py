"""TD-PSOLA: new durations and a new melody for recorded speech.

Time-domain pitch-synchronous overlap-add after Moulines and Charpentier 1990 (section 3), the
technique that Gibert, Bailly and Elisei 2004 name in section 5.1.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError
from synth.speech.marks import PitchMarks

_MAX_RATIO = 4.0


def modify_prosody(
    x: ArrayLike,
    marks: PitchMarks,
    *,
    source_s: ArrayLike,
    target_s: ArrayLike,
    f0_ratio: ArrayLike = 1.0,
) -> NDArray[np.float64]:
    """Give speech new timing and a new pitch contour.

    Parameters
    ----------
    x : array_like of float, shape (n,)
        One channel of speech.
    marks : PitchMarks
        Its pitch marks.
    source_s, target_s : array_like of float, shape (k,), k >= 2
        Break points of a piecewise linear time map, seconds, strictly ascending. The result
        begins at ``target_s[0]`` and ends at ``target_s[-1]``.
    f0_ratio : array_like of float, shape (k,) or scalar
        New over old fundamental frequency at the break points, within 1/4..4.

    Returns
    -------
    ndarray of float64, shape (round((target_s[-1] - target_s[0]) * fs),)

    Raises
    ------
    CueError
        If the break points do not ascend or a ratio is out of range.

    Examples
    --------
    >>> from synth.speech.pitch import PitchTrack
    >>> from synth.speech.marks import place_marks
    >>> x = np.sin(np.arange(8000) * 2 * np.pi * 100 / 8000)
    >>> marks = place_marks(x, 8000, PitchTrack(np.full(200, 100.0), 0.005))
    >>> y = modify_prosody(x, marks, source_s=[0, 1], target_s=[0, 1.5])
    >>> len(y)
    12000
    """
    from synth.speech import _kernels

    signal = np.ascontiguousarray(x, dtype=np.float64)
    source, target, ratio = _checked_map(source_s, target_s, f0_ratio)
    origin = round(target[0] * marks.fs)
    n = round(target[-1] * marks.fs) - origin
    y = np.zeros(n)
    if n == 0 or len(marks.sample) < 2:
        return y
    place, index = _synthesis_marks(marks, source, target, ratio)
    repeated = np.concatenate(([False], index[1:] == index[:-1])) & ~marks.voiced[index]
    mirrored = np.zeros(len(index), dtype=np.bool_)
    for k in np.flatnonzero(repeated):
        mirrored[k] = not mirrored[k - 1]
    _kernels.overlap_add(signal, marks.sample, place - origin, index, mirrored, y)
    return y


def _checked_map(
    source_s: ArrayLike, target_s: ArrayLike, f0_ratio: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    source = np.asarray(source_s, dtype=np.float64)
    target = np.asarray(target_s, dtype=np.float64)
    if source.ndim != 1 or len(source) < 2 or source.shape != target.shape:
        raise CueError(f"time map has {source.size} source and {target.size} target points")
    if not (np.diff(source) > 0).all() or not (np.diff(target) > 0).all():
        raise CueError("time map does not ascend strictly")
    ratio = np.broadcast_to(np.asarray(f0_ratio, dtype=np.float64), source.shape)
    if not ((ratio >= 1 / _MAX_RATIO) & (ratio <= _MAX_RATIO)).all():
        raise CueError(f"pitch ratio {ratio.min()}..{ratio.max()} is not within 1/4..4")
    return source, target, ratio


def _synthesis_marks(
    marks: PitchMarks,
    source: NDArray[np.float64],
    target: NDArray[np.float64],
    ratio: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return target positions in samples and the analysis mark that serves each of them."""
    at = marks.sample / marks.fs
    gap = np.diff(at, append=2 * at[-1] - at[-2])
    pitch = np.where(marks.voiced, np.interp(at, source, ratio), 1.0)
    period = gap / pitch
    middle = 0.5 * (at[1:] + at[:-1])
    place: list[int] = []
    index: list[int] = []
    time = float(np.interp(at[0], source, target))
    while time < target[-1]:
        m = int(np.searchsorted(middle, np.interp(time, target, source)))
        place.append(round(time * marks.fs))
        index.append(m)
        time += max(float(period[m]), 1.0 / marks.fs)
    return np.array(place, dtype=np.int64), np.array(index, dtype=np.int64)
