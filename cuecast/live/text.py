"""Live text: captions as they come in, and the cuer who follows them.

Captions of a live programme come some seconds late, in pieces, and without an end. They are put
into a line of words that goes on from where the cuer is: never earlier than words on their way to
the viewer already, in her own time, faster where she lags, and caught up with in pauses.
"""

import json
from collections import deque
from dataclasses import dataclass, replace

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key, Phone, Score
from codec.errors import CueError
from cuecast.dubbing.motions import RATE_HZ
from synth.language.subtitles import spoken
from synth.motion.rules.bodiless import ruled_cuer
from synth.planning.scoring.text_score import Reading, score_of_text

AHEAD_S = 0.3
"""How long before its first key the hand has to know of it."""

FASTEST = 1.25
"""How much faster than at rest she cues to catch up; beyond that text is left out."""

HURRY_FROM_S = 1.0
"""Lag in seconds that makes her hurry, in full at twice that."""

_KEPT_S = 8.0
"""Score that is kept behind the requested time: the motion of a window depends on it."""

_LONGEST_LAG_S = 12.0
"""Text that would come later than this is left out."""

_LONGEST_TEXT = 2000
"""Characters of a caption at most."""


@dataclass(frozen=True, slots=True)
class Caption:
    """A piece of live text: words and their time, seconds on the motion's clock."""

    start_s: float
    text: str


def read_caption(line: str | bytes, now_s: float) -> Caption | None:
    r"""Read a line of live text: JSON with ``text``, and ``start`` in seconds or ``age``.

    Parameters
    ----------
    line : str or bytes
        One JSON object. ``age`` gives how many seconds ago it was said; without either it was
        said now.
    now_s : float
        Time of the newest sound on the motion's clock.

    Returns
    -------
    Caption or None
        None for an empty line.

    Raises
    ------
    CueError
        If it is not such a line.

    Examples
    --------
    >>> read_caption('{"text": "Bonsoir.", "age": 2.5}', 60.0)
    Caption(start_s=57.5, text='Bonsoir.')
    """
    if not line.strip():
        return None
    try:
        found = json.loads(line)
        text = found["text"]
        start_s = float(found.get("start", now_s - float(found.get("age", 0.0))))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise CueError(f"live text: not a line of JSON with a text: {str(line)[:60]}") from error
    if not isinstance(text, str) or len(text) > _LONGEST_TEXT or not abs(start_s) < 1e9:
        raise CueError(f"live text: not a text and a time: {str(line)[:60]}")
    return Caption(min(start_s, now_s), text)


class LiveMotion:
    """Motion for captions that come while it is asked for.

    Windows have to be requested in order of time. A returned window is final.

    Parameters
    ----------
    voice : Voice
    reading : Reading
        How the text is read and cued.
    seed : int
    alignment : str
        See `synth.motion.rules.bodiless.ruled_cuer`.

    Attributes
    ----------
    lag_s : float
        How far behind its caption the last word began.
    left_out : int
        Captions that came too late to be cued.
    """

    def __init__(
        self, voice: Voice, reading: Reading, *, seed: int = 0, alignment: str = "attina"
    ) -> None:
        self._voice, self._reading = voice, reading
        self._cuer = ruled_cuer(
            voice, rate_hz=RATE_HZ, seed=seed, options=reading.options, alignment=alignment
        )
        self.rate_hz = RATE_HZ
        self.filmed = self.whole = False
        self._phones: deque[Phone] = deque()
        self._keys: deque[Key] = deque()
        self._horizon_s = self._free_s = 0.0
        self.lag_s = 0.0
        self.captions = self.left_out = 0

    @property
    def score(self) -> Score:
        """Phones and keys that are still kept."""
        return Score(tuple(self._phones), tuple(self._keys))

    def add(self, caption: Caption) -> bool:
        """Put a caption behind those before it; return whether it is cued."""
        text = spoken(caption.text)
        if not text:
            return False
        earliest_s = max(self._horizon_s + AHEAD_S, self._free_s)
        start_s = max(caption.start_s, earliest_s)
        lag_s = start_s - caption.start_s
        # The wait for the horizon is everybody's; only what piles up behind it is left out.
        if earliest_s - (self._horizon_s + AHEAD_S) > _LONGEST_LAG_S:
            self.left_out += 1
            return False
        score = score_of_text(text, start_s=start_s, reading=replace(self._reading, pace=None))
        backlog_s = max(0.0, self._free_s - self._horizon_s - AHEAD_S)
        hurry = min(1.0, max(0.0, backlog_s - HURRY_FROM_S) / HURRY_FROM_S)
        score = _hastened(score, start_s, 1 + (FASTEST - 1) * hurry)
        if not score.keys:
            return False
        self._phones += score.phones
        self._keys += score.keys
        self._free_s = max(score.phones[-1].end, score.keys[-1].end)
        self.lag_s = lag_s
        self.captions += 1
        return True

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` on, for the text so far."""
        self._horizon_s = max(self._horizon_s, start_s + frames / RATE_HZ)
        for line in (self._phones, self._keys):
            while line and line[0].end < start_s - _KEPT_S:
                line.popleft()
        return self._cuer.motion(self.score, start_s, frames, self._voice)


def _hastened(score: Score, start_s: float, factor: float) -> Score:
    """Return a score that takes less time by a factor."""

    def moved(time_s: float) -> float:
        return start_s + (time_s - start_s) / factor

    if factor == 1.0:
        return score
    return Score(
        tuple(replace(p, start=moved(p.start), end=moved(p.end)) for p in score.phones),
        tuple(replace(k, start=moved(k.start), end=moved(k.end)) for k in score.keys),
    )
