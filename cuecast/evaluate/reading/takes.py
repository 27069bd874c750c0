"""Takes to be read: a folder of real cuers, virtual ones in simulated films, tracked films.

A folder holds tables of landmarks, one utterance each, or all of them in ``landmarks.npz``, and
``phones.csv`` with the columns ``utterance`` and ``phones``.
"""

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.errors import CueError
from cuecast.evaluate.reading.reader import ReaderTake, asked
from cuecast.evaluate.reading.view import RATE_HZ, TakeView, view
from synth.capture.cues.transcript import read_transcript
from synth.capture.sources.landmark_maps import FACE_LANDMARKS, N_HAND_LANDMARKS
from synth.capture.sources.landmark_table import HANDS, LandmarkTable, read_landmarks
from synth.capture.tracker.aspect import find_aspect

FloatArray = NDArray[np.float64]

PHONES = "phones.csv"
ARCHIVE = "landmarks.npz"

_UNIT, _UNKNOWN = 20_000, -32_768
"""Integers of the archive to the picture's width or height, and the one of unseen landmarks."""

_PARTS = {"hand": "hand", "lip": "face", "face": "face"}
"""Parts of the archive's columns, as in tables."""


def real_takes(folder: Path, voice: Voice) -> list[ReaderTake]:
    """Return the takes of real cuers in a folder.

    Parameters
    ----------
    folder : Path
    voice : Voice
        By whose measure the aspect of the picture is found.

    Raises
    ------
    CueError
        If there are no landmarks, or no transcript.
    """
    said = _phones(folder / PHONES)
    takes = []
    for name, table in _tables(folder):
        if name in said:
            seen = seen_in(table, find_aspect(table, voice).value)
            takes.append(ReaderTake(name, seen, asked(read_transcript(said[name]).keys)))
    if not takes:
        raise CueError(f"{folder}: no landmarks (*.csv or {ARCHIVE}) of what {PHONES} names")
    return takes


def seen_in(table: LandmarkTable, aspect: float) -> TakeView:
    """Return the reader's view of a table; a left hand as a right one.

    Raises
    ------
    CueError
        If no hand is ever seen.
    """
    shown = {name: np.isfinite(table.hands[name][..., 0]).all(1).sum() for name in table.hands}
    best = max(shown, key=lambda name: int(shown[name]), default=None)
    if best is None or not shown[best]:
        raise CueError("no hand in the landmarks")
    face, hand = (x[..., :2] * [aspect, -1.0] for x in (table.face, table.hands[best]))
    flat = np.concatenate([x.reshape(len(x), -1) for x in (face, hand)], axis=1)
    grid = np.arange(0.0, table.times[-1] + 1e-6, 1.0 / RATE_HZ)
    even = np.stack([np.interp(grid, table.times, column) for column in flat.T], axis=1)
    face, hand = np.split(even.reshape(len(even), -1, 2), [len(FACE_LANDMARKS)], axis=1)
    if best == HANDS[2]:
        # Her right side takes the place of the left one, its landmarks with it.
        face, hand = face[:, _MIRRORED] * [-1.0, 1.0], hand * [-1.0, 1.0]
    return view(face, hand)


_OTHER_SIDE = {234: 454, 61: 291, 39: 269, 181: 405, 40: 270, 91: 321}
"""Landmarks that the reader uses, and those on the other side of the face."""

_MIRRORED = [
    FACE_LANDMARKS.index(
        (_OTHER_SIDE | {right: left for left, right in _OTHER_SIDE.items()}).get(number, number)
    )
    for number in FACE_LANDMARKS
]


def _phones(path: Path) -> dict[str, str]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return {row["utterance"]: row["phones"] for row in csv.DictReader(file)}
    except (OSError, KeyError, UnicodeDecodeError, csv.Error) as error:
        raise CueError(f"{path}: cannot be read as utterances and phones: {error}") from None


def _tables(folder: Path) -> Iterator[tuple[str, LandmarkTable]]:
    for path in sorted(folder.glob("*.csv")):
        if path.name != PHONES:
            yield path.stem, read_landmarks(path)
    if (folder / ARCHIVE).is_file():
        yield from _archived(folder / ARCHIVE)


def _archived(path: Path) -> Iterator[tuple[str, LandmarkTable]]:
    """Yield the tables of an archive: ``columns``, then NAME and NAME.frames for each."""
    try:
        with np.load(path) as archive:
            columns = [str(title) for title in archive["columns"]]
            for name in archive.files:
                if f"{name}.frames" in archive.files:
                    yield name, _table(columns, archive[name], archive[f"{name}.frames"])
    except (OSError, KeyError, ValueError, EOFError) as error:
        raise CueError(f"{path}: cannot be read as landmarks: {error}") from None


def _table(
    columns: list[str], values: NDArray[np.generic], frames: NDArray[np.generic]
) -> LandmarkTable:
    known = np.asarray(values, dtype=np.float64)
    known = np.where(known == _UNKNOWN, np.nan, known / _UNIT)
    parts = {
        "face": np.full((len(known), len(FACE_LANDMARKS), 3), np.nan),
        "hand": np.full((len(known), N_HAND_LANDMARKS, 3), np.nan),
    }
    for title, column in zip(columns, known.T, strict=True):
        part, _, point = title.partition("_")
        axis, number = "xyz".index(point[0]), int(point[1:])
        if part in ("lip", "face") and number in FACE_LANDMARKS:
            parts["face"][:, FACE_LANDMARKS.index(number), axis] = column
        elif part == "hand":
            parts["hand"][:, number, axis] = column
    times = np.asarray(frames, dtype=np.float64)
    return LandmarkTable(
        (times - times[0]) / RATE_HZ, parts["face"], {"hand": parts["hand"]}, timed=False
    )
