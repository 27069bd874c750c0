"""Participants of a test: their lists, and their answers as CSV files on this machine."""

import csv
import re
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from codec.errors import CueError
from cuecast.practice.trial import ANSWERS, Step, Trial

COLUMNS = (
    "participant", "step", "time_utc", "kind", "item", "hand", "display", "channel", "source",
    "choices", "target", "answer", "right", "answer_ms", "frames_per_second",
)  # fmt: skip
"""Columns of a file of answers; `target`, `answer` count the choices from 0."""

SEEN = -1
"""Answer to a step that asks nothing."""

_CODE = re.compile(r"P([0-9]{2,4})")

_MOST_PARTICIPANTS = 9999
"""Participants of a test at most: four digits of a code."""

_MOST_MS = 1e7
"""Milliseconds of an answer at most: close to three hours."""


def code_of(number: int) -> str:
    """Return a participant's code: no name is ever asked for.

    Examples
    --------
    >>> code_of(7)
    'P07'
    """
    return f"P{number:02}"


def number_of(code: str) -> int:
    """Return the number in a code.

    Raises
    ------
    CueError
        If it is not one.

    Examples
    --------
    >>> number_of("P07")
    7
    """
    found = _CODE.fullmatch(code.strip().upper())
    if found is None or int(found[1]) < 1:
        raise CueError(f"{code[:20]!r} n’est pas un code de participant, comme P07")
    return int(found[1])


@dataclass(frozen=True, slots=True)
class Answer:
    """What a participant did at a step.

    Attributes
    ----------
    choice : int
        Which of the step's choices; `SEEN` where there are none.
    answer_ms : float
        Milliseconds from the moment the choices appeared.
    frames_per_second : float
        Pictures that the browser drew per second while the item moved; 0 if nothing moved.
    """

    choice: int
    answer_ms: float
    frames_per_second: float = 0.0


class TrialSession:
    """One participant's way through a test; a second session goes on where the first one ended.

    Parameters
    ----------
    trial : Trial
    number : int
        The participant's, from 1 up.

    Raises
    ------
    CueError
        If the file of earlier answers is not of this list.
    """

    def __init__(self, trial: Trial, number: int) -> None:
        self.trial = trial
        self.code = code_of(number)
        self.steps = trial.steps(number)
        self.path = trial.folder / ANSWERS / f"{self.code}.csv"
        rows = read_answers(self.path) if self.path.exists() else []
        if [row["item"] for row in rows] != [step.item for step in self.steps[: len(rows)]]:
            raise CueError(f"{self.path}: answers of another test or another list")
        self.next = len(rows)

    @property
    def ended(self) -> bool:
        """Whether every step has its answer."""
        return self.next >= len(self.steps)

    def answer(self, step: int, answer: Answer) -> None:
        """Append an answer to the participant's file.

        Raises
        ------
        CueError
            If it is not the next step, the choice not one of the step's, a time not possible, or
            the file cannot be written.
        """
        if self.ended or step != self.next:
            raise CueError(f"réponse à l’étape {step + 1}, on en est à l’étape {self.next + 1}")
        asked = self.steps[step]
        known = range(len(asked.choices)) if asked.choices else (SEEN,)
        if answer.choice not in known:
            raise CueError(f"le choix {answer.choice} n’existe pas")
        for value in (answer.answer_ms, answer.frames_per_second):
            if not 0 <= value <= _MOST_MS:
                raise CueError(f"{value} n’est pas une durée possible")
        row = self._row(step, asked, answer)
        new = not self.path.exists()
        try:
            with self.path.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, COLUMNS)
                if new:
                    writer.writeheader()
                writer.writerow(row)
        except OSError as error:
            raise CueError(f"{self.path}: {error.strerror}") from error
        self.next += 1

    def _row(self, number: int, step: Step, answer: Answer) -> dict[str, Any]:
        return {
            "participant": self.code,
            "step": number,
            "time_utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "kind": self.trial.kind,
            "item": step.item,
            **asdict(step.condition),
            "choices": "|".join(step.choices),
            "target": step.target if step.target >= 0 else "",
            "answer": answer.choice if answer.choice >= 0 else "",
            "right": int(answer.choice == step.target) if step.target >= 0 else "",
            "answer_ms": round(answer.answer_ms, 1),
            "frames_per_second": round(answer.frames_per_second, 1),
        }


def new_session(trial: Trial) -> TrialSession:
    """Return the session of the next participant.

    Raises
    ------
    CueError
        If there are too many.
    """
    taken = [number_of(path.stem) for path in answer_files(trial.folder)]
    number = max(taken, default=0) + 1
    if number > _MOST_PARTICIPANTS:
        raise CueError(f"{number} participants: at most {_MOST_PARTICIPANTS}")
    session = TrialSession(trial, number)
    try:
        session.path.parent.mkdir(exist_ok=True)
        with session.path.open("x", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(COLUMNS)
    except OSError as error:
        raise CueError(f"{session.path}: {error.strerror}") from error
    return session


def old_session(trial: Trial, code: str) -> TrialSession:
    """Return the session of a participant who began earlier.

    Raises
    ------
    CueError
        If nobody has that code.
    """
    number = number_of(code)
    if not (trial.folder / ANSWERS / f"{code_of(number)}.csv").is_file():
        raise CueError(f"personne n’a encore le code {code_of(number)}")
    return TrialSession(trial, number)


def answer_files(folder: Path) -> list[Path]:
    """Return the participants' files in order of their numbers."""
    found = [p for p in (folder / ANSWERS).glob("P*.csv") if _CODE.fullmatch(p.stem)]
    return sorted(found, key=lambda path: number_of(path.stem))


def read_answers(path: Path) -> list[dict[str, str]]:
    """Return the rows of a file of answers.

    Raises
    ------
    CueError
        If it is not one.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CueError(f"{path}: cannot be read: {error}") from error
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise CueError(f"{path}: not a file of answers: its columns are {reader.fieldnames}")
    for number, row in enumerate(rows, 2):
        if None in row or None in row.values():
            raise CueError(f"{path}, line {number}: wrong number of columns")
    return rows
