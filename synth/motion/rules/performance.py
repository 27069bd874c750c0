"""A rule-based performance of a whole score: the short way from a text to a motion."""

import math

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.errors import CueError, check_kind
from synth.motion.rules.bodiless import ruled_cuer

_AFTER_S = 1.5
"""Seconds behind the last phone: the longest way of the hand back to its rest, and a breath."""


def motion_of(
    score: Score,
    voice: Voice,
    *,
    seed: int = 0,
    rate_hz: float = 50.0,
    alignment: str = "attina",
    options: CueingOptions = DEFAULT_OPTIONS,
) -> Motion:
    """Return the rule-based motion of a whole score, from time 0 until the hand rests again.

    Programmes of any length are better performed window by window: `GestureSynthesiser.motion`.

    Parameters
    ----------
    score : Score
    voice : Voice
        Of the parameters; the virtual cuer of its name performs, or its own targets if there is
        none.
    seed : int
        Of the small motions.
    rate_hz : float
        Frames per second, 1..1000.
    alignment : str
        One of `synth.motion.rules.movement.ALIGNMENTS`.
    options : CueingOptions
        When the hand rests.

    Returns
    -------
    Motion
        With the score.

    Raises
    ------
    CueError
        If there is no score, or an empty one, the alignment unknown, or the rate out of range.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import score_of_text
    >>> motion_of(score_of_text("Oui"), load_voice("claire")).rate_hz
    50.0
    """
    check_kind(score, Score, "motion_of", "score_of_text makes one")
    if not score.phones:
        raise CueError("the score is empty: nothing is said in it")
    cuer = ruled_cuer(voice, rate_hz=rate_hz, seed=seed, alignment=alignment, options=options)
    frames = math.ceil((score.phones[-1].end + _AFTER_S) * rate_hz)
    return cuer.motion(score, 0.0, frames, voice)
