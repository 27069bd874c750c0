"""How the mark of the mid is divided among left, right and centre of more than two channels.

In: the programme and the mark of its mid; out: the part moved from right to left, and the part the
centre takes from both. In each band and frame each channel takes part by its own masking, so that
the mark is as well hidden in one as in the other, and a silent channel stays silent; the mid bears
the whole. Specification: spec/audio-carrier.md, W6.
"""

import numpy as np
from numpy.typing import NDArray

from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.mdct import analyse, frames_of, synthesise
from watermark.audio.signal.mix import has_centre
from watermark.audio.signal.profile import HOP
from watermark.audio.signal.sample_buffer import SampleBuffer

TINY = float(np.finfo(float).tiny)


class MarkShares:
    """Divides marks, stretch after stretch.

    Parameters
    ----------
    channels : int
        Of the programme. Of one or two channels nothing is divided.
    """

    def __init__(self, channels: int) -> None:
        front = 0 if channels < 3 else 3 if has_centre(channels) else 2
        self._tapes = [SampleBuffer() for _ in range(front)]
        self._masker = make_masker()
        self._tails = np.zeros((2, HOP))
        self._across = self._own = np.zeros((0, HOP))

    def append(self, x: NDArray[np.float64]) -> None:
        """Take the programme, shape (n, channels)."""
        for channel, tape in enumerate(self._tapes):
            tape.append(x[:, channel])

    def forget(self, before: int) -> None:
        """Drop samples of the programme below an index."""
        for tape in self._tapes:
            tape.forget(before)

    def begin(self, start: float, ratio: float, count: int) -> None:
        """Look at the next stretch.

        Parameters
        ----------
        start, ratio : float
            Place of its first sample in the programme, and samples of that per sample of the mark.
        count : int
            Samples of the mark, a multiple of `HOP`.
        """
        if not self._tapes:
            return
        first, length = start - HOP * ratio, count + 2 * HOP
        sounds = [tape.read(first, ratio, length) for tape in self._tapes]
        powers = [np.abs(analyse(frames_of(x, HOP), HOP)) ** 2 / 2 for x in sounds]
        left, right = (self._masked(power) for power in powers[:2])
        self._across = (left - right) / np.maximum(left + right, TINY)
        self._own = np.zeros_like(left)
        if len(powers) == 3:
            pair, own = self._masked((powers[0] + powers[1]) / 2), self._masked(powers[2] / 2)
            self._own = own / np.maximum(pair + own, TINY)

    def divide(self, mark: NDArray[np.float64]) -> NDArray[np.float64]:
        """Divide a mark of the stretch.

        Parameters
        ----------
        mark : ndarray of float64, shape (n + HOP,)
            The mark added to the mid, at 48 kHz, with the tail that lies in the next stretch.

        Returns
        -------
        ndarray of float64, shape (2, n + HOP)
            The excess of left, and lack of right, over the mark; and the centre's part of both.
        """
        if not self._tapes:
            return np.zeros((2, mark.size))
        # The transform is orthonormal: the mark's coefficients are those it was made from.
        coefficients = analyse(frames_of(mark, HOP), HOP).real
        taken = self._own * coefficients
        parts = [synthesise(self._across * (coefficients - taken), HOP), synthesise(taken, HOP)]
        divided = np.stack(parts)
        divided[:, :HOP] += self._tails
        return divided

    def settle(self, divided: NDArray[np.float64]) -> NDArray[np.float64]:
        """Go on to the next stretch; return the parts of this one, shape (2, n)."""
        self._tails = divided[:, -HOP:]
        return divided[:, :-HOP]

    def _masked(self, power: NDArray[np.float64]) -> NDArray[np.float64]:
        """Amplitude that is masked, shape (frames - 1, HOP), by power in frames and bins."""
        threshold = self._masker.thresholds(power)
        return np.asarray(self._masker.amplitudes(threshold[1:], threshold[:-1]))
