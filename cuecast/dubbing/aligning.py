"""Scores timed by the voices of a programme, read once from front to back."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Score
from codec.errors import CueError
from receiver.media.programme import open_programme
from receiver.media.sound import SoundDecoder, sound_blocks
from synth.language.subtitles import Subtitle
from synth.planning.alignment.recogniser import FS
from synth.planning.alignment.runs import LONGEST_TEXT_S
from synth.planning.alignment.score import Judged, Judgement, align, phones_of_recording
from synth.planning.alignment.sound import mono
from synth.planning.scoring.text_score import PLAIN, OnWord, Reading, ignore_word, in_pieces

_KEPT_S = 7.0
"""Sound before the last stretch that stays in memory: stretches overlap by less."""


class Confidence:
    """How sure the times of a programme's subtitles are, for reports."""

    def __init__(self) -> None:
        self._judged: list[Judgement] = []

    def __call__(self, judgement: Judgement) -> None:
        """Keep the result for one subtitle."""
        self._judged.append(judgement)

    def report(self) -> dict[str, Any]:
        """Return the offset, the median confidence and that of every subtitle."""
        sure = [item.confidence for item in self._judged]
        offsets = [item.offset_s for item in self._judged if item.confidence > 0]
        return {
            "offset_s": round(float(np.median(offsets)), 2) if offsets else 0.0,
            "confidence": round(float(np.median(sure)), 2) if sure else 0.0,
            "subtitles": [
                {
                    "start": item.subtitle.start_s,
                    "line": item.subtitle.line,
                    "confidence": round(item.confidence, 2),
                }
                for item in self._judged
            ],
        }

    def __str__(self) -> str:
        """Return one line for the reader of the command line."""
        aligned = sum(item.confidence > 0 for item in self._judged)
        return (
            f"aligned: {aligned} of {len(self._judged)} subtitles, "
            f"median confidence {self.report()['confidence']:.2f}"
        )


def aligned_score(
    subtitles: Sequence[Subtitle],
    programme: str | os.PathLike[str],
    *,
    track: int = 0,
    reading: Reading = PLAIN,
    warn: Callable[[str], None],
    judged: Judged,
    on_word: OnWord = ignore_word,
) -> Score:
    """Return the score of subtitles as the voices of `programme` say it.

    Parameters
    ----------
    subtitles : sequence of Subtitle
    programme : path-like
    track : int
        Which of its sounds, from 0.
    reading : Reading
    warn, judged, on_word : callable
        As in `synth.planning.alignment.score.align`.

    Raises
    ------
    CueError
        If the programme is malformed or one subtitle is too long to align.
    """
    with ExitStack() as stack:
        voices = ProgrammeVoices(stack, programme, track=track)
        return align(subtitles, voices, reading=reading, warn=warn, judged=judged, on_word=on_word)


def aligned_pieces(
    subtitles: Sequence[Subtitle],
    programme: str | os.PathLike[str],
    *,
    reading: Reading = PLAIN,
    warn: Callable[[str], None],
    judged: Judged,
    on_word: OnWord = ignore_word,
) -> Iterator[Score]:
    """Yield what `aligned_score` returns in pieces, in constant memory."""
    with ExitStack() as stack:
        voices = ProgrammeVoices(stack, programme)
        phones = phones_of_recording(
            subtitles, voices, reading=reading, warn=warn, judged=judged, on_word=on_word
        )
        yield from in_pieces(phones, reading)


def text_as_subtitle(text: str, programme: str | os.PathLike[str]) -> Subtitle:
    """Return a text without times as one subtitle over the whole sound of `programme`.

    Raises
    ------
    CueError
        If the sound is longer than a text without times can be aligned to.
    """
    with open_programme(programme) as opened:
        length_s = opened.duration_s
    if length_s is None or length_s > LONGEST_TEXT_S:
        raise CueError(
            f"{programme}: a text without times aligns to {LONGEST_TEXT_S:.0f} s of sound at most"
        )
    return Subtitle(0.0, length_s, text, timed=False)


class ProgrammeVoices:
    """The sound of a programme, one stretch after the other, in constant memory.

    Parameters
    ----------
    stack : ExitStack
        Closes the programme.
    programme : path-like
    track : int
        Which of its sounds, from 0.
    """

    def __init__(
        self, stack: ExitStack, programme: str | os.PathLike[str], *, track: int = 0
    ) -> None:
        self._programme = stack.enter_context(open_programme(programme, track=track))
        self._decoder = SoundDecoder(self._programme, strict=False)
        self._blocks: Iterator[NDArray[np.float32]] = sound_blocks(self._decoder, self._programme)
        self._kept = np.zeros(0, dtype=np.float32)
        self._first = 0

    def __call__(self, start_s: float, end_s: float) -> NDArray[np.float64]:
        """Return the sound from `start_s` to `end_s`, mono at 16 kHz; silence where there is none.

        Raises
        ------
        CueError
            If `start_s` lies more than seven seconds before that of an earlier stretch.
        """
        fs = self._decoder.format.fs
        self._read_until(end_s)
        origin_s = self._decoder.start_s or 0.0
        first, last = (round((t - origin_s) * fs) for t in (start_s, end_s))
        if first < self._first and self._first > 0:
            raise CueError(f"subtitles go back in time at {start_s:.2f} s")
        found = self._kept[max(first - self._first, 0) : max(last - self._first, 0)]
        missing = (max(-first, 0), max(last - first - len(found) - max(-first, 0), 0))
        self._forget(first - round(_KEPT_S * fs))
        stretch = mono(np.pad(found, missing), fs)
        return stretch[: round((end_s - start_s) * FS)]

    def _read_until(self, end_s: float) -> None:
        fs = self._decoder.format.fs
        waiting = [self._kept]
        while (self._decoder.start_s or 0.0) + self._decoder.samples / fs < end_s:
            block = next(self._blocks, None)
            if block is None:
                break
            waiting.append(block.mean(axis=1))
        self._kept = np.concatenate(waiting)

    def _forget(self, before: int) -> None:
        passed = min(max(before - self._first, 0), len(self._kept))
        self._kept = self._kept[passed:]
        self._first += passed
