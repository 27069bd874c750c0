"""Whether a cuer moves as the prediction from her score says, or was filmed.

A motion with its score goes in. The prediction of a rule-based cuer, or joined from a voice's own
units, leaves a few hundredths of the motion's energy; that of a cuer whom a camera saw more than a
half. Between both lies a factor of five.
"""

import numpy as np

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS
from codec.cues.timeline import SUPERFRAME_S, to_line
from codec.superframe.analysis import block_at
from codec.superframe.coding import coding_for
from codec.superframe.fitting import fits
from codec.superframe.merging import join
from codec.superframe.score_coding import part_of
from codec.superframe.superframe import resynthesis_of

_LOOKED_AT = 24
"""Most superframes that are looked at, spread evenly over those with a key's start."""

_LEFT = 0.25
"""Least part of the energy that the prediction leaves of a filmed cuer, in the median superframe:
three virtual laws of movement leave .03 to .06, a second virtual cuer and 8 takes of a
real one .44 to .71."""


def is_filmed(motion: Motion, voice: Voice) -> bool:
    """Return whether the prediction from its score explains little of a motion.

    Parameters
    ----------
    motion : Motion
        With or without a score; one without is not said to be filmed.
    voice : Voice
        Of the motion.

    Raises
    ------
    VoiceError
        If the motion was made with another voice.
    """
    voice.check_motion(motion)
    if motion.score is None:
        return False
    coding = coding_for(voice)
    options = DEFAULT_OPTIONS.in_language(coding.language)
    line = to_line(motion.score, options)
    span = np.array([motion.start_s, motion.start_s + motion.duration_s]) / SUPERFRAME_S
    whole = range(int(np.ceil(span[0] - 1e-6)), int(span[1] + 1e-6))
    keyed = [k for k in whole if part_of(line, k, options).key_starts()]
    places = np.unique(np.linspace(0, len(keyed) - 1, _LOOKED_AT).astype(int)) if keyed else ()
    left = []
    for index in (keyed[place] for place in places):
        block = block_at(motion, index)
        joined = join({k: part_of(line, k, options) for k in (index - 1, index, index + 1)})
        moved = resynthesis_of(coding, joined, index)
        whole_used = next(
            fitted
            for fitted in fits(block, lambda c, s, m=moved: m.params(course=c, shift=s), coding)  # type: ignore[misc]
            if not any(fitted.shares)
        )
        gaps = [
            float(np.square(gap @ coding.residual.matrix).sum())
            for gap in (whole_used.lacking, block - coding.mean)
        ]
        # Energy that the prediction by the score leaves, over that about the voice's mean.
        left.append(gaps[0] / max(gaps[1], 1e-9))
    return bool(left) and float(np.median(left)) > _LEFT
