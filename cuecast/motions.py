"""Where the motion of a programme comes from: a score or a motion file, window by window."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from codec.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.errors import VoiceError
from codec.motion import Motion
from codec.score import Score
from codec.voice import Voice
from receiver.render import sample_params
from synth.gesture import GestureSynthesiser

RATE_HZ = 50.0
"""Frames per second of the motion inside superframes."""

_WINDOW = 64


class MotionSource(Protocol):
    """Motion of a whole programme, any window of it at a time."""

    @property
    def score(self) -> Score:
        """Phones and keys, as far as they are known."""

    @property
    def rate_hz(self) -> float:
        """Frames per second."""

    def window(self, start_s: float, frames: int) -> Motion:
        """Return `frames` frames at `rate_hz` from `start_s` on."""


class SynthesisedMotion:
    """Motion that the gesture synthesiser makes for a score."""

    def __init__(
        self,
        score: Score,
        voice: Voice,
        *,
        seed: int = 0,
        rate_hz: float = RATE_HZ,
        rest_gap_s: float = DEFAULT_OPTIONS.rest_gap_s,
    ) -> None:
        self.score = score
        self.rate_hz = rate_hz
        self._voice = voice
        self._synthesiser = GestureSynthesiser(
            voice.name, rate_hz=rate_hz, seed=seed, options=CueingOptions(rest_gap_s=rest_gap_s)
        )

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` on."""
        return self._synthesiser.motion(self.score, start_s, frames, self._voice)


class GivenMotion:
    """Motion of a file; before its start and after its end the cuer stands still.

    Raises
    ------
    VoiceError
        If the motion was made with another voice than `voice`.
    """

    def __init__(self, motion: Motion, voice: Voice) -> None:
        check_voice(motion, voice)
        self.score = motion.score or Score((), ())
        self.rate_hz = RATE_HZ
        self._motion = motion

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` on."""
        times = start_s + np.arange(frames) / RATE_HZ
        params = sample_params(self._motion, times)
        return replace(self._motion, params=params, rate_hz=RATE_HZ, start_s=start_s)


def check_voice(motion: Motion, voice: Voice) -> None:
    """Raise `VoiceError` unless `motion` was made with `voice`."""
    if motion.voice != voice.identity:
        raise VoiceError(f"motion of voice {motion.voice}, but {voice.name} is {voice.identity}")


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
