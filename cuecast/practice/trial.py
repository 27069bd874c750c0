"""A perceptual test as a folder: its items, and each participant's list of steps.

The folder holds ``trial.json`` (kind, seed, settings and pool of items), ``items/`` (motions and
sounds), two papers to read and edit (`cuecast.practice.papers`) and ``answers/``, one CSV file per
participant. Steps follow from the pool, the seed and the participant's number: a folder and a
number give the same list again.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from codec.cuer.motion import Motion, save_motion
from codec.errors import CueError
from codec.files.whole import whole_file

TRIAL = "trial.json"
ITEMS = "items"
ANSWERS = "answers"

KINDS = ("pairs", "naturalness", "comprehension", "voices")

_FORMAT = 1
"""Version of `trial.json`."""

_MOST_BYTES = 1 << 24
"""Bytes of ``trial.json`` at most."""


@dataclass(frozen=True, slots=True)
class ItemCondition:
    """How an item is shown.

    Attributes
    ----------
    hand : str
        ``lips`` (the hand rests) or ``hand``.
    display : str
        ``points``, ``avatar``, or ``none`` where no cuer is drawn.
    channel : str
        ``clear``, or ``channel`` after coding and losses.
    source : str
        Where the content comes from: ``synthetic``, ``natural`` or ``other`` motion; of a
        passage ``subtitles``, ``cuer`` or ``both``; of two speakers their names in the order of
        playing, ``reader-espeak``.
    """

    hand: str = "hand"
    display: str = "points"
    channel: str = "clear"
    source: str = "synthetic"


@dataclass(frozen=True, slots=True)
class Step:
    """One screen of a test: an item to watch, a question, or both.

    Attributes
    ----------
    item : str
        Name in the answers.
    condition : ItemCondition
    prompt : str
        The question; empty where there is nothing to answer.
    choices : tuple of str
        Offered answers in the order of the screen.
    target : int
        Which of them is right; -1 where none is.
    motion, sound : str
        Files within the folder, empty where there is none.
    captions : tuple of (float, float, str)
        Start and end in seconds, and text.
    """

    item: str
    condition: ItemCondition
    prompt: str = ""
    choices: tuple[str, ...] = ()
    target: int = -1
    motion: str = ""
    sound: str = ""
    captions: tuple[tuple[float, float, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Trial:
    """A prepared test.

    Attributes
    ----------
    folder : Path
    kind : str
        One of `KINDS`.
    voice : str
        Name or file of the cuer's voice.
    seed : int
    settings, pool : mapping, sequence of mapping
        As the kind's own module writes and reads them.
    """

    folder: Path
    kind: str
    voice: str
    seed: int
    settings: Mapping[str, Any] = field(default_factory=dict)
    pool: Sequence[Mapping[str, Any]] = ()

    def rng(self, number: int) -> np.random.Generator:
        """Return the random numbers of a participant's list."""
        return np.random.default_rng([self.seed, number])

    def steps(self, number: int) -> list[Step]:
        """Return the list of participant `number`, from 1 up.

        Raises
        ------
        CueError
            If the pool is not that of the kind.
        """
        from cuecast.practice import comprehension, naturalness, pairs, voices

        plan: dict[str, Callable[[Trial, int], list[Step]]] = {
            "pairs": pairs.steps,
            "naturalness": naturalness.steps,
            "comprehension": comprehension.steps,
            "voices": voices.steps,
        }
        try:
            return plan[self.kind](self, number)
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise CueError(f"{self.folder / TRIAL}: malformed pool: {error!r}") from error


@contextmanager
def new_trial(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a folder that gets the name `target` when the block succeeds.

    Raises
    ------
    CueError
        If `target` exists or cannot be written.
    """
    path = Path(target)
    if path.exists():
        raise CueError(f"{path} exists already")
    try:
        made = Path(tempfile.mkdtemp(prefix=f".{path.name}-", dir=path.absolute().parent))
    except OSError as error:
        raise CueError(f"{path}: cannot write: {error.strerror}") from error
    try:
        (made / ITEMS).mkdir()
        (made / ANSWERS).mkdir()
        yield made
        made.chmod(0o755)
        made.rename(path)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise


def save_item(folder: Path, name: str, motion: Motion) -> str:
    """Write a motion of a test; return its file's name within the folder."""
    save_motion(motion, folder / ITEMS / f"{name}.npz")
    return f"{ITEMS}/{name}.npz"


def write_trial(trial: Trial) -> None:
    """Write ``trial.json`` into the trial's folder."""
    document = {
        "format": _FORMAT,
        "kind": trial.kind,
        "voice": trial.voice,
        "seed": trial.seed,
        "settings": dict(trial.settings),
        "pool": [dict(entry) for entry in trial.pool],
    }
    with whole_file(trial.folder / TRIAL) as path:
        path.write_text(json.dumps(document, ensure_ascii=False, indent=1), encoding="utf-8")


def read_trial(folder: str | os.PathLike[str]) -> Trial:
    """Read what `write_trial` wrote.

    Raises
    ------
    CueError
        If the folder holds no test of this format.
    """
    path = Path(folder) / TRIAL
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise CueError(f"{path}: larger than {_MOST_BYTES} bytes")
        document: Any = json.loads(path.read_text(encoding="utf-8"))
        if document["format"] != _FORMAT or document["kind"] not in KINDS:
            raise ValueError(f"format {document['format']!r}, kind {document['kind']!r}")
        return Trial(
            Path(folder),
            document["kind"],
            str(document["voice"]),
            int(document["seed"]),
            dict(document["settings"]),
            [dict(entry) for entry in document["pool"]],
        )
    except OSError as error:
        raise CueError(
            f"{path}: {error.strerror}; cuecast trial prepare makes such a folder"
        ) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise CueError(f"{path}: not a test of this version: {error!r}") from error
