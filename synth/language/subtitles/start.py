"""When the programme of a subtitle file starts on the file's own clock.

Broadcasters write the time code of the tape, and tapes start at ten o'clock, some at one.
"""

from collections.abc import Sequence

from synth.language.subtitles.findings import Findings
from synth.language.subtitles.model import Subtitle

_HOUR_S = 3600.0
"""Seconds of an hour: tapes begin on a whole one."""

_TAPE_HOURS = 10
"""No programme has its first words ten hours after its start."""


def programme_start_s(
    subtitles: Sequence[Subtitle], findings: Findings, length_s: float | None = None
) -> float:
    """Return the time on a file's clock at which its programme starts.

    Parameters
    ----------
    subtitles : sequence of Subtitle
        Sorted by start.
    findings : Findings
        The file's statements about its clock.
    length_s : float, optional
        Length of the programme, where it is known: words after its end betray a tape's hour.

    Examples
    --------
    >>> lines = [Subtitle(36_001.0, 36_002.0, "Oui.")]
    >>> programme_start_s(lines, Findings()), programme_start_s(lines, Findings(start_s=36_000.5))
    (36000.0, 36000.5)
    """
    if not subtitles:
        return 0.0
    first_s = subtitles[0].start_s
    if findings.start_s is not None and findings.start_s <= first_s:
        return findings.start_s
    hour_s = first_s // _HOUR_S * _HOUR_S
    beyond = length_s is not None and length_s < first_s
    if first_s >= _TAPE_HOURS * _HOUR_S or findings.time_of_day or beyond:
        return hour_s
    return 0.0
