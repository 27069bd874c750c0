"""Where motion comes from: text, subtitles, motion capture.

Examples
--------
A sentence to a motion:

>>> from codec import load_voice
>>> from synth import keys_of, motion_of, score_of_text
>>> [str(key) for key in keys_of("Bonsoir")]
['24', '13', '16', '13']
>>> score = score_of_text("Bonsoir", start_s=0.5)
>>> motion = motion_of(score, load_voice("claire"), seed=1)
>>> motion.params.shape[1], motion.rate_hz, motion.score is score
(31, 50.0, True)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from synth.capture.capture import capture_motion
    from synth.capture.options import Captured, CaptureOptions
    from synth.language.subtitles.findings import LeftOut
    from synth.language.subtitles.model import Subtitle, TextRun
    from synth.language.subtitles.read import Terms, read_subtitles
    from synth.language.text.lexicon import Variant
    from synth.language.text.pronounce import Style
    from synth.language.text.words import Word
    from synth.motion.rules.performance import motion_of
    from synth.planning.alignment.score import Judgement, align, sound_of
    from synth.planning.prosody.pacing import Pace, PacedWord, TimedWord
    from synth.planning.prosody.simulation import PerformerChoice
    from synth.planning.scoring.text_score import (
        Reading,
        keys_of,
        score_of_subtitles,
        score_of_text,
    )

__all__ = [
    "CaptureOptions",
    "Captured",
    "Judgement",
    "LeftOut",
    "Pace",
    "PacedWord",
    "PerformerChoice",
    "Reading",
    "Style",
    "Subtitle",
    "Terms",
    "TextRun",
    "TimedWord",
    "Variant",
    "Word",
    "align",
    "capture_motion",
    "keys_of",
    "motion_of",
    "read_subtitles",
    "score_of_subtitles",
    "score_of_text",
    "sound_of",
]

_HOMES = {
    "CaptureOptions": "synth.capture.options",
    "Captured": "synth.capture.options",
    "Judgement": "synth.planning.alignment.score",
    "LeftOut": "synth.language.subtitles.findings",
    "Pace": "synth.planning.prosody.pacing",
    "PacedWord": "synth.planning.prosody.pacing",
    "PerformerChoice": "synth.planning.prosody.simulation",
    "Reading": "synth.planning.scoring.text_score",
    "Style": "synth.language.text.pronounce",
    "Subtitle": "synth.language.subtitles.model",
    "TextRun": "synth.language.subtitles.model",
    "Terms": "synth.language.subtitles.read",
    "TimedWord": "synth.planning.prosody.pacing",
    "Variant": "synth.language.text.lexicon",
    "Word": "synth.language.text.words",
    "align": "synth.planning.alignment.score",
    "capture_motion": "synth.capture.capture",
    "keys_of": "synth.planning.scoring.text_score",
    "motion_of": "synth.motion.rules.performance",
    "read_subtitles": "synth.language.subtitles.read",
    "score_of_subtitles": "synth.planning.scoring.text_score",
    "score_of_text": "synth.planning.scoring.text_score",
    "sound_of": "synth.planning.alignment.score",
}
"""Where each name lives: it is imported when it is first asked for, so that importing is cheap."""

if not TYPE_CHECKING:  # type checkers would take any name for one of ours

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
