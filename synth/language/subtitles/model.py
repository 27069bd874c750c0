"""A subtitle: an interval of the programme and the words spoken in it."""

from dataclasses import dataclass, field, replace

from codec.errors import CueError

LONGEST_S = 360_000.0
"""100 hours: the last time that the formats' two-digit hours can write."""


@dataclass(frozen=True, slots=True)
class TextRun:
    """A part of a subtitle that looks the same throughout.

    Attributes
    ----------
    text : str
    colour : str
        Name of one of teletext's eight colours, "" if the file gives none.
    voice : str
        Who speaks, where the file says so.
    language : str
        As the file states, such as ``en-GB``; "" if it does not.

    Examples
    --------
    >>> TextRun("Coup de feu", colour="red").colour
    'red'
    """

    text: str
    colour: str = ""
    voice: str = ""
    language: str = ""

    def like(self, **changes: str) -> "TextRun":
        """Return a run with other values."""
        return replace(self, **changes)


@dataclass(frozen=True, slots=True)
class Subtitle:
    r"""One subtitle.

    Attributes
    ----------
    start_s, end_s : float
        When it is on the screen, seconds on the programme's clock, 0 <= start < end.
    text : str
        As displayed, without markup, lines separated by ``\n``.
    line : int
        Where it stands in its file, counted from 1, for messages.
    timed : bool
        Whether its times were given; else they are only those of the whole sound.
    runs : tuple of TextRun
        The text as the file shows it, by colour, voice and language.
    position : str
        Where it is shown, as the file writes it; "" if it does not.
    column : int
        Where it starts in its line if others stand there too, counted from 1; else 0.

    Examples
    --------
    >>> Subtitle(1.0, 2.5, "Bonjour !").text
    'Bonjour !'
    """

    start_s: float
    end_s: float
    text: str
    line: int = 1
    timed: bool = field(default=True, repr=False)
    runs: tuple[TextRun, ...] = field(default=(), repr=False, compare=False)
    position: str = field(default="", repr=False, compare=False)
    column: int = field(default=0, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0 <= self.start_s <= LONGEST_S:
            raise CueError(f"line {self.line}: subtitle starts at {self.start_s} s")
        if not self.start_s < self.end_s <= LONGEST_S:
            raise CueError(
                f"line {self.line}: subtitle ends at {self.end_s:.3f} s, "
                f"not after its start at {self.start_s:.3f} s"
            )
