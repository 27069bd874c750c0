"""Where the motion of a programme comes from: a score or a motion file, window by window."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.errors import CueError
from synth.motion.rules.bodiless import RuledCuer, ruled_cuer
from synth.planning.prosody.passages import passages

if TYPE_CHECKING:
    from synth.units.concatenation.concatenation import ConcatenativeSynthesiser

RATE_HZ = 50.0
"""Frames per second of the motion inside superframes."""

_WINDOW = 512
"""Frames of a motion that are made at once: 64 take twice the time each."""


_SAME_FRAME = 1e-6
"""Frames within which two times are of the same frame."""


class MotionSource(Protocol):
    """Motion of a whole programme, any window of it at a time.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import score_of_text
    >>> source: MotionSource = SynthesisedMotion(score_of_text("Oui"), load_voice("claire"))
    >>> source.filmed, source.window(0.0, 32).params.shape
    (False, (32, 31))
    """

    @property
    def score(self) -> Score:
        """Phones and keys, as far as they are known."""

    @property
    def rate_hz(self) -> float:
        """Frames per second."""

    @property
    def filmed(self) -> bool:
        """Whether a camera saw the cuer, rather than that a model moves her by the score."""

    @property
    def whole(self) -> bool:
        """Whether all of it is known beforehand."""

    def window(self, start_s: float, frames: int) -> Motion:
        """Return a window of the motion.

        Parameters
        ----------
        start_s : float
            Time of its first frame on the programme's clock, seconds.
        frames : int
            As many, at `rate_hz`.

        Returns
        -------
        Motion
        """


class SynthesisedMotion:
    """Motion that the gesture synthesiser makes for a score.

    Parameters
    ----------
    score : Score
    voice : Voice
    seed : int
        Of all that is random in her.
    options : CueingOptions
    alignment : str
        ``attina`` or ``paper``: when the hand is on target.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import score_of_text
    >>> source = SynthesisedMotion(score_of_text("Oui"), load_voice("claire"))
    """

    def __init__(
        self,
        score: Score,
        voice: Voice,
        *,
        seed: int = 0,
        options: CueingOptions = DEFAULT_OPTIONS,
        alignment: str = "attina",
    ) -> None:
        self.score = score
        self.rate_hz = RATE_HZ
        self.filmed, self.whole = False, True
        self._voice = voice
        self._synthesiser = ruled_cuer(
            voice, rate_hz=RATE_HZ, seed=seed, options=options, alignment=alignment
        )
        self._made: Motion | None = None

    def window(self, start_s: float, frames: int) -> Motion:
        """Return a window of the motion; its successors are made with it.

        Parameters
        ----------
        start_s, frames
            As of `MotionSource.window`.

        Returns
        -------
        Motion
        """
        made, at = self._made, 0
        if made is not None:
            ahead = (start_s - made.start_s) * RATE_HZ
            at = round(ahead)
            if abs(ahead - at) > _SAME_FRAME or not 0 <= at <= len(made.params) - frames:
                made, at = None, 0
        if made is None:
            made = self._made = self._synthesiser.motion(
                self.score, start_s, max(frames, _WINDOW), self._voice
            )
        return replace(made, params=made.params[at : at + frames].copy(), start_s=start_s)


def ruled_motion(pieces: Iterable[Score], cuer: RuledCuer, voice: Voice) -> Iterator[Motion]:
    """Yield the motion of a score from time 0 on, in constant memory.

    Parameters
    ----------
    pieces : iterable of Score
        In order of time; how the score is cut into pieces changes nothing.
    cuer : RuledCuer
    voice : Voice
        What her motion is expressed in.

    Yields
    ------
    Motion
        Windows; the first of a passage has its score.
    """
    at = 0
    for passage in passages(pieces):
        end = round(passage.end_s * cuer.rate_hz)
        score = passage.score
        while at < end:
            frames = min(_WINDOW, end - at)
            part = cuer.motion(passage.around, at / cuer.rate_hz, frames, voice)
            at += frames
            yield replace(part, score=score)
            score = Score((), ())


class ConcatenativeMotion:
    """Motion joined from recorded units, for windows that mostly move forward.

    Raises
    ------
    CueError
        If nothing is said in the score.
    """

    def __init__(self, score: Score, synthesiser: "ConcatenativeSynthesiser") -> None:
        self.score = score
        self.rate_hz = RATE_HZ
        self.filmed, self.whole = False, True
        self._synthesiser = synthesiser
        self._restart()

    def _restart(self) -> None:
        self._coming = self._synthesiser.perform([self.score], rate_hz=RATE_HZ, start_s=0.0)
        first = next(self._coming, None)
        if first is None:
            raise CueError("nothing is said: there is no motion to join")
        self._kept = [first.motion]

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` on; the cuer is still before and after the score."""
        times = start_s + np.arange(frames) / RATE_HZ
        if times[0] < self._kept[0].start_s > 0:
            self._restart()
        while times[-1] >= self._end_s and (part := next(self._coming, None)):
            while len(self._kept) > 1 and self._kept[1].start_s <= times[0]:
                self._kept.pop(0)
            self._kept.append(part.motion)
        params = np.concatenate([part.params for part in self._kept])
        params = sample_params(replace(self._kept[0], params=params), times)
        return replace(self._kept[0], params=params, start_s=start_s, score=self.score)

    @property
    def _end_s(self) -> float:
        return self._kept[-1].start_s + (len(self._kept[-1].params) - 1) / RATE_HZ


class GivenMotion:
    """Motion of a file; before its start and after its end the cuer stands still.

    Parameters
    ----------
    motion : Motion
    voice : Voice
        That of the motion.

    Raises
    ------
    VoiceError
        If the motion was made with another voice than `voice`.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> given = GivenMotion(motion_of(score_of_text("Oui"), voice), voice)
    >>> given.window(0.5, 3).params.shape
    (3, 31)
    """

    def __init__(self, motion: Motion, voice: Voice) -> None:
        # The analysis of superframes takes a fifth of a second to import.
        from codec.superframe.filmed import is_filmed

        voice.check_motion(motion)
        self.score = motion.score or Score((), ())
        self.rate_hz = RATE_HZ
        self.filmed, self.whole = is_filmed(motion, voice), True
        self._motion = motion

    def window(self, start_s: float, frames: int) -> Motion:
        """Return a window of the motion.

        Parameters
        ----------
        start_s, frames
            As of `MotionSource.window`.

        Returns
        -------
        Motion
        """
        times = start_s + np.arange(frames) / RATE_HZ
        params = sample_params(self._motion, times)
        return replace(self._motion, params=params, rate_hz=RATE_HZ, start_s=start_s)


def whole_motion(
    source: MotionSource,
    end_s: float,
    *,
    start_s: float = 0.0,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Motion:
    """Return the motion of `source` from `start_s` to `end_s`, made window by window."""
    rate = source.rate_hz
    total = max(1, round((end_s - start_s) * rate))
    pieces = []
    for at in range(0, total, _WINDOW):
        frames = min(_WINDOW, total - at)
        pieces.append(source.window(start_s + at / rate, frames))
        progress(frames / rate)
    params = np.concatenate([piece.params for piece in pieces])
    return replace(pieces[0], params=params, score=source.score)
