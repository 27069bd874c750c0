"""Catalogues: which programmes to dub with what, into which files.

CSV with a header: ``programme``, and optionally ``subtitles`` or ``motion`` (without either the
programme's own subtitles are taken), ``output``, and ``on_air``, when a signed programme begins on
air; relative paths start at the catalogue.
"""

import csv
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from codec.errors import CueError
from cuecast.command.errors import UsageError
from cuecast.command.trust import seconds_of


@dataclass(frozen=True, slots=True)
class Task:
    """One programme of a catalogue: its files and options.

    Attributes
    ----------
    programme, output : str
        Absolute paths.
    subtitles, motion : str
        Absolute paths, one of them empty, or both.
    options : dict
        Those of the verb ``dub`` by the names that its parser gives them.
    """

    programme: str
    output: str
    subtitles: str = ""
    motion: str = ""
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that determine the output."""
        voice = str(self.options.get("voice", ""))
        named = (
            self.programme,
            self.subtitles,
            self.motion,
            str(self.options.get("lexicon") or ""),
            str(self.options.get("sign") or ""),
        )
        return tuple(filter(None, (*named, voice if voice.endswith(".npz") else "")))


def read_catalogue(
    path: str | os.PathLike[str], folder: Path, options: dict[str, Any] | None = None
) -> list[Task]:
    """Read a catalogue.

    Parameters
    ----------
    path : path
        CSV.
    folder : Path
        Of the outputs.
    options : dict, optional
        Of every `Task`.

    Raises
    ------
    CueError
        If it is not a catalogue, or two programmes would have the same output.
    """
    home, folder = Path(path).absolute().parent, folder.absolute()
    tasks: dict[str, Task] = {}
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file, strict=True))
    except (OSError, UnicodeError, csv.Error) as error:
        raise CueError(f"{path}: not a catalogue: {error}") from error
    for number, row in enumerate(rows, 2):
        cells = {
            name: (row.get(name) or "").strip() for name in ("programme", "subtitles", "motion")
        }
        if not cells["programme"]:
            raise CueError(f"{path}: line {number}: needs a programme")
        if cells["subtitles"] and cells["motion"]:
            raise CueError(f"{path}: line {number}: needs subtitles or motion, not both")
        programme, subtitles, motion = (str(home / c) if c else "" for c in cells.values())
        name = (row.get("output") or "").strip() or Path(cells["programme"]).name
        output = str(folder / Path(name).name)
        if output in tasks:
            raise CueError(f"{path}: line {number}: another programme has the output {output}")
        chosen = dict(options or {})
        on_air = (row.get("on_air") or "").strip()
        if on_air or chosen.get("sign"):
            _check_time(on_air, f"{path}: line {number}")
            chosen["on_air"] = on_air
        tasks[output] = Task(programme, output, subtitles, motion, chosen)
    if not tasks:
        raise CueError(f"{path}: no programmes in it")
    return list(tasks.values())


def _check_time(on_air: str, where: str) -> None:
    try:
        seconds_of(on_air)
    except UsageError as error:
        raise UsageError(f"{where}: on_air: {error}") from error
