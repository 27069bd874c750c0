"""Recordings of the virtual cuer: espeak-ng's voice, exact labels, and her motion to them."""

import itertools
from collections.abc import Iterable, Iterator

from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.phonology import PAUSE
from codec.cues.score import Score
from synth.language.text.espeak import RATE_HZ
from synth.language.text.pronounce import phonemise
from synth.motion.rules.gesture import GestureSynthesiser
from synth.units.recordings.recording import UnitRecording
from synth.units.speech.espeak_voice import render

_TAIL_S = 1.0
"""Seconds of rest before and after a line."""

RATES = (90, 150)
"""Words a minute, in turn: at a cuer's ease, some three and a half keys a second, and as fast as
subtitles are read, so that units of either pace can be chosen."""


def line_of(text: str) -> list[str]:
    """Return the phones of a text in a row, `codec.cues.phonology.PAUSE` between its groups.

    Examples
    --------
    >>> line_of("Oui, merci.")
    ['w', 'i', '_', 'm', 'ɛ', 'ʁ', 's', 'i', '_']
    """
    line: list[str] = []
    for word in phonemise(text):
        line += [*word.phones, *(PAUSE if word.pause else "")]
    return line


def record(
    texts: Iterable[str],
    cuer: GestureSynthesiser,
    voice: Voice,
    *,
    options: CueingOptions = DEFAULT_OPTIONS,
) -> Iterator[UnitRecording]:
    """Yield one recording per text, at the two `RATES` in turn.

    Parameters
    ----------
    texts : iterable of str
        French sentences; one without a phone is passed over.
    cuer : GestureSynthesiser
        Who cues.
    voice : Voice
        What her motion is expressed in.
    options : CueingOptions
    """
    for text, words_per_minute in zip(texts, itertools.cycle(RATES), strict=False):
        line = line_of(text)
        if not any(symbol != PAUSE for symbol in line):
            continue
        rendering = render(line, words_per_minute=words_per_minute)
        score = Score(rendering.phones, tuple(cue(rendering.phones, options)))
        n_frames = round((len(rendering.samples) / RATE_HZ + 2 * _TAIL_S) * cuer.rate_hz)
        motion = cuer.motion(score, -_TAIL_S, n_frames, voice)
        yield UnitRecording.analysed(
            rendering.samples, RATE_HZ, score=score, gestures=cuer.gestures(score), motion=motion
        )
