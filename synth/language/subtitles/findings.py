"""Findings about a subtitle file beside its subtitles.

Files of television are rarely clean: what cannot be read is left out and remembered with its
line and the reason, so that no subtitle is lost without a word. A strict reader refuses instead.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from codec.errors import CueError
from synth.language.subtitles.model import Subtitle, TextRun


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A part of a subtitle file that is not cued.

    Attributes
    ----------
    line : int
        Where it stands in its file, counted from 1 (EBU STL: its block).
    reason : str
        Why, in one line.
    column : int
        Where in its line, if others stand there too, counted from 1; else 0.

    Examples
    --------
    >>> LeftOut(12, "music").reason
    'music'
    """

    line: int
    reason: str
    column: int = 0

    def __str__(self) -> str:
        """Return the text of a message."""
        column = f", column {self.column}" if self.column else ""
        return f"line {self.line}{column}: {self.reason}"


@dataclass(slots=True)
class Findings:
    """A reader's report on a file.

    Attributes
    ----------
    strict : bool
        Whether the first fault ends the reading.
    left_out : list of LeftOut
    language : str
        Which the file says it is in, such as ``fr`` or ``en-GB``; "" if it does not say.
    start_s : float or None
        The time at which the file says that its programme starts.
    time_of_day : bool
        Whether times are those of a tape or a clock (SMPTE), which may start anywhere.
    """

    strict: bool = False
    left_out: list[LeftOut] = field(default_factory=list)
    language: str = ""
    start_s: float | None = None
    time_of_day: bool = False

    def leave_out(self, line: int, reason: str) -> None:
        """Record a part that is left out.

        Raises
        ------
        CueError
            If the reading is strict; the message begins with the line.
        """
        if self.strict:
            raise CueError(f"line {line}: {reason}")
        self.left_out.append(LeftOut(line, reason))

    def refuse(self, line: int, error: CueError) -> None:
        """Remember an error whose message may begin with its line."""
        self.leave_out(line, str(error).removeprefix(f"line {line}: "))

    def made(
        self,
        start_s: float,
        end_s: float,
        text: str,
        line: int,
        runs: tuple[TextRun, ...] = (),
        position: str = "",
        column: int = 0,
    ) -> Iterable[Subtitle]:
        """Return the subtitle of these values, or nothing if they cannot be one."""
        try:
            return (Subtitle(start_s, end_s, text, line, True, runs, position, column),)
        except CueError as error:
            self.refuse(line, error)
            return ()

    def none_left(self, line: int) -> CueError:
        """Return the error of a file without a subtitle: its first fault if it has one."""
        if self.left_out:
            return CueError(str(self.left_out[0]))
        return CueError(f"line {line}: the file has no subtitles")
