"""Options and result of a capture."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from codec.cuer.motion import Motion
from codec.cues.score import Score


def _silent(_: float) -> None:
    """Show no progress."""


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """Choices of a capture.

    Attributes
    ----------
    rate_hz : float
        Of the motion.
    start_s : float, optional
        Time of the recording's first frame on the programme's clock; default: as the file says.
    mapping : mapping of str to str
        From labels to markers.
    subject : str, optional
        Prefix of the labels that count, where several people are recorded.
    calibration : Path, optional
        A recording of the same speaker and session, her face at rest.
    score : Score, optional
        The transcript on the recording's clock; default: the recognised keys.
    text : Score, optional
        The transcript with unknown times: those of phones and keys do not count.
    keys : bool
        Recognise keys where no score is given.
    frame_rate_hz : float, optional
        Of landmarks whose table holds frame numbers and no times.
    aspect : float, optional
        Width of the picture over its height, for landmarks in parts of width and height.
    tracker : str, optional
        Interpreter with the image tracker, for films.
    progress : callable
        Called with the seconds of the recording that are done.

    Examples
    --------
    >>> CaptureOptions(rate_hz=25.0, aspect=16 / 9).rate_hz
    25.0
    """

    rate_hz: float = 50.0
    start_s: float | None = None
    mapping: Mapping[str, str] = field(default_factory=dict)
    subject: str | None = None
    calibration: Path | None = None
    score: Score | None = None
    text: Score | None = None
    keys: bool = True
    frame_rate_hz: float | None = None
    aspect: float | None = None
    tracker: str | None = None
    progress: Callable[[float], None] = _silent


DEFAULTS = CaptureOptions()


@dataclass(frozen=True, slots=True)
class Captured:
    """A captured motion with its report.

    Attributes
    ----------
    motion : Motion
    report : dict
        For JSON; `notes` in it are sentences.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import motion_of, score_of_text
    >>> motion = motion_of(score_of_text("Oui"), load_voice("claire"))
    >>> Captured(motion, {"kind": "trc", "notes": []}).report["kind"]
    'trc'
    """

    motion: Motion
    report: dict[str, Any]
