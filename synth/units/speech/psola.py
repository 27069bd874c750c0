"""TD-PSOLA: new durations and a new melody for recorded speech.

Time-domain pitch-synchronous overlap-add after Moulines and Charpentier 1990 (section 3), the
technique that Gibert, Bailly and Elisei 2004 name in section 5.1.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError
from synth.units.speech.joins import Grains, smooth_joins
from synth.units.speech.marks import PitchMarks

_MAX_RATIO = 4.0
"""Largest factor on a duration: beyond it periods repeat audibly."""


@dataclass(frozen=True, slots=True)
class SpeechPiece:
    """A stretch of recorded speech and where it goes.

    Attributes
    ----------
    source_s, target_s : ndarray of float64, shape (k,), k >= 2
        Break points of a piecewise linear time map, seconds, strictly ascending.
    f0_ratio : ndarray of float64, shape (k,)
        New over old fundamental frequency at the break points, within 1/4..4.
    """

    source_s: NDArray[np.float64]
    target_s: NDArray[np.float64]
    f0_ratio: NDArray[np.float64]

    @classmethod
    def of(
        cls, source_s: ArrayLike, target_s: ArrayLike, f0_ratio: ArrayLike = 1.0
    ) -> "SpeechPiece":
        """Make a piece of anything array-like; a scalar ratio holds everywhere.

        Raises
        ------
        CueError
            If the break points do not ascend or a ratio is out of range.
        """
        source = np.asarray(source_s, dtype=np.float64)
        target = np.asarray(target_s, dtype=np.float64)
        if source.ndim != 1 or len(source) < 2 or source.shape != target.shape:
            raise CueError(f"time map has {source.size} source and {target.size} target points")
        if not (np.diff(source) > 0).all() or not (np.diff(target) > 0).all():
            raise CueError("time map does not ascend strictly")
        ratio = np.broadcast_to(np.asarray(f0_ratio, dtype=np.float64), source.shape)
        if not ((ratio >= 1 / _MAX_RATIO) & (ratio <= _MAX_RATIO)).all():
            raise CueError(f"pitch ratio {ratio.min()}..{ratio.max()} is not within 1/4..4")
        return cls(source, target, ratio)


def modify_prosody(
    x: ArrayLike, marks: PitchMarks, pieces: Sequence[SpeechPiece]
) -> NDArray[np.float64]:
    """Give speech new timing and a new pitch contour, and join pieces of it.

    Parameters
    ----------
    x : array_like of float, shape (n,)
        One channel of speech.
    marks : PitchMarks
        Its pitch marks.
    pieces : sequence of SpeechPiece
        Stretches of `x` in the order of playing; each begins in the result where its
        predecessor ends.

    Returns
    -------
    ndarray of float64
        From the first piece's first target time to the last piece's last one.

    Raises
    ------
    CueError
        If there is no piece or a piece does not follow its predecessor.

    Examples
    --------
    >>> from synth.units.speech.pitch import PitchTrack
    >>> from synth.units.speech.marks import place_marks
    >>> x = np.sin(np.arange(8000) * 2 * np.pi * 100 / 8000)
    >>> marks = place_marks(x, 8000, PitchTrack(np.full(200, 100.0), 0.005))
    >>> len(modify_prosody(x, marks, [SpeechPiece.of([0, 1], [0, 1.5])]))
    12000
    """
    from synth.units.speech import _kernels

    if not pieces:
        raise CueError("no piece of speech to say")
    for before, after in itertools.pairwise(pieces):
        if abs(after.target_s[0] - before.target_s[-1]) > 1e-6:
            raise CueError(f"a piece starts at {after.target_s[0]} s, not {before.target_s[-1]} s")
    signal = np.ascontiguousarray(x, dtype=np.float64)
    origin = round(pieces[0].target_s[0] * marks.fs)
    n = round(pieces[-1].target_s[-1] * marks.fs) - origin
    y = np.zeros(n)
    if n == 0 or len(marks.sample) < 2:
        return y
    grains = _synthesis_marks(marks, pieces)
    beside = smooth_joins(signal, marks, [(p.source_s, p.target_s) for p in pieces], grains)
    place = np.rint(grains.place_s * marks.fs).astype(np.int64) - origin
    index = grains.index
    # An unvoiced grain that follows itself is mirrored: noise that repeats sounds like a pitch.
    repeated = np.concatenate(([False], index[1:] == index[:-1])) & ~marks.voiced[index]
    mirrored = np.zeros(len(index), dtype=np.bool_)
    for k in np.flatnonzero(repeated):
        mirrored[k] = not mirrored[k - 1]
    for heard in (grains, beside):
        _kernels.overlap_add(
            signal, marks.sample, place, heard.index, mirrored, heard.shift, heard.gain, y
        )
    return y


def _synthesis_marks(marks: PitchMarks, pieces: Sequence[SpeechPiece]) -> Grains:
    """Return where grains go and the analysis marks that serve them."""
    at = marks.sample / marks.fs
    gap = np.diff(at, append=2 * at[-1] - at[-2])
    middle = 0.5 * (at[1:] + at[:-1])
    first, last = (int(np.searchsorted(middle, pieces[0].source_s[0])), len(at) - 1)
    place: list[float] = []
    index: list[int] = []
    number: list[int] = []
    start = np.interp(at[first], pieces[0].source_s, pieces[0].target_s)
    time = float(max(start, pieces[0].target_s[0]))
    for k, piece in enumerate(pieces):
        ratio = np.where(marks.voiced, np.interp(at, piece.source_s, piece.f0_ratio), 1.0)
        period = np.maximum(gap / ratio, 1.0 / marks.fs)
        while time < piece.target_s[-1]:
            source = np.interp(time, piece.target_s, piece.source_s)
            m = min(int(np.searchsorted(middle, source)), last)
            place.append(time)
            index.append(m)
            number.append(k)
            # The next grain follows after the period of its analysis mark at the wanted pitch.
            time += float(period[m])
    n = len(place)
    return Grains(
        np.array(place),
        np.array(index, dtype=np.int64),
        np.array(number, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.ones(n),
    )
