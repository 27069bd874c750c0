"""How well the labels of a sound fit it: the likelihood of each phone where it is said to be."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax

from codec.cues.phonology import PHONE_NUMBER
from codec.cues.score import Phone
from synth.planning.alignment.recogniser import FRAME_RATE, heard
from synth.planning.alignment.sound import mono

_EDGE = 5
"""One part in this many of a phone's frames, at either end, is its neighbours' as well."""


def label_fits(sound: NDArray[Any], fs: int, phones: Sequence[Phone]) -> NDArray[np.float32]:
    """Return the mean log-likelihood of each phone over the middle of its sound.

    Parameters
    ----------
    sound : ndarray of float, shape (n,)
        One channel.
    fs : int
        Its rate in Hz.
    phones : sequence of Phone
        On the sound's clock, without pauses.

    Returns
    -------
    ndarray of float32, shape (phones,)
        At most 0; half of a careful reader's phones lie above -0.2, one in twenty below -2.3.
    """
    likely = log_softmax(heard(mono(sound, fs)).astype(np.float64), axis=1)
    fits = np.zeros(len(phones), dtype=np.float32)
    for row, phone in enumerate(phones):
        first = min(int(phone.start * FRAME_RATE), len(likely) - 1)
        end = min(max(int(np.ceil(phone.end * FRAME_RATE)), first + 1), len(likely))
        edge = (end - first) // _EDGE
        fits[row] = likely[first + edge : end - edge, PHONE_NUMBER[phone.symbol]].mean()
    return fits
