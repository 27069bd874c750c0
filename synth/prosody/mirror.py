"""What her performance shows: the virtual cuer herself performs a plan, and is looked at.

`synth.rules.sight` is quick and leaves out drift, scatter and the head; this is slower and true,
for the cuer with the usual seed.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import Classes, shown_keys
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Key, Phone, Score
from synth.rules.gesture import GestureSynthesiser

_RATE_HZ = 50.0
"""Frames per second at which she is looked at: those of all reports."""

_AROUND_S = 0.6
"""Seconds of motion before the first key and after the last one."""


@cache
def _cuer(identity: str) -> tuple[GestureSynthesiser, Classes]:
    cuer = GestureSynthesiser(identity, rate_hz=_RATE_HZ)
    return cuer, Classes(cuer.targets()[0])


def held_keys(
    phones: Sequence[Phone],
    keys: Sequence[Key],
    *,
    identity: str = "claire",
    options: CueingOptions = DEFAULT_OPTIONS,
) -> NDArray[np.float64]:
    """Return how long the virtual cuer shows each key of a score, seconds.

    Parameters
    ----------
    phones : sequence of Phone
    keys : sequence of Key
        As `codec.cues.cueing.cue` makes them.
    identity : str
        Of the cuer.
    options : CueingOptions
        Which gaps between keys return to rest.
    """
    if not keys:
        return np.zeros(0)
    cuer, classes = _cuer(identity)
    score = Score(tuple(phones), tuple(keys))
    start_s = max(0.0, keys[0].start - _AROUND_S)
    frames = int((keys[-1].end + _AROUND_S - start_s) * _RATE_HZ)
    markers = cuer.markers(score, start_s, frames)
    shown = shown_keys(markers, score, classes, rate_hz=_RATE_HZ, start_s=start_s, options=options)
    return np.array([item.held_s for item in shown])
