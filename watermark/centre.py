"""What part of the mark the centre of a programme takes from left and right.

In: the programme and the mark of its mid; out: the centre's part. In each band and frame the mark
is divided by what centre and pair mask by themselves, so that it is as well hidden in either as in
their downmix; both channels of the stereo downmix bear the whole. Specification: W6.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.masking import make_masker
from watermark.mdct import analyse, frames_of, synthesise
from watermark.mix import has_centre
from watermark.profile import HOP
from watermark.tape import Tape


class CentreShare:
    """Divides marks, stretch after stretch.

    Parameters
    ----------
    channels : int
        Without a centre nothing is kept and nothing is taken.
    """

    def __init__(self, channels: int) -> None:
        self._tapes = [Tape() for _ in range(3 if has_centre(channels) else 0)]
        self._masker = make_masker()
        self._tail = np.zeros(HOP)

    def append(self, x: NDArray[np.float64]) -> None:
        """Take the programme, shape (n, channels)."""
        for channel, tape in enumerate(self._tapes):
            tape.append(x[:, channel])

    def forget(self, before: int) -> None:
        """Drop samples of the programme below an index."""
        for tape in self._tapes:
            tape.forget(before)

    def take(self, mark: NDArray[np.float64], start: float, ratio: float) -> NDArray[np.float64]:
        """Return what the centre takes of a stretch's mark.

        Parameters
        ----------
        mark : ndarray of float64, shape (n + HOP,)
            What was added to the mid, at 48 kHz, with the tail that lies in the next stretch.
        start, ratio : float
            Place of its first sample in the programme, and samples of that per sample of the mark.

        Returns
        -------
        ndarray of float64, shape (n,)
        """
        if not self._tapes:
            return np.zeros(mark.size - HOP)
        sounds = [tape.read(start - HOP * ratio, ratio, HOP + mark.size) for tape in self._tapes]
        left, right, centre = (np.abs(analyse(frames_of(x, HOP), HOP)) ** 2 / 2 for x in sounds)
        pair, own = self._masked((left + right) / 2), self._masked(centre / 2)
        share = own / np.maximum(pair + own, np.finfo(float).tiny)
        # The transform is orthonormal: the mark's coefficients are those it was made from.
        taken = synthesise(share * analyse(frames_of(mark, HOP), HOP).real, HOP)
        taken[:HOP] += self._tail
        self._tail = taken[-HOP:]
        return np.asarray(taken[:-HOP])

    def _masked(self, power: NDArray[np.float64]) -> NDArray[np.float64]:
        """Amplitude that is masked, shape (frames - 1, HOP), by power in frames and bins."""
        threshold = self._masker.thresholds(power)
        return np.asarray(self._masker.amplitudes(threshold[1:], threshold[:-1]))
