"""Takes of a new speaker: C3D files, each with a TextGrid of its name beside it.

As in the paper (Gibert, Bailly, Elisei 2004, section 2) there are takes of the hand alone (shapes
in free space), of the face alone (sounds) and of both (cued sentences); each is known by the
markers that it holds. All come into our axes by the head of the takes that show both, at the
speaker's own size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cues.score import Score
from codec.errors import CueError
from synth.capture.points.framing import find_framing
from synth.capture.points.labels import Naming, find_names
from synth.capture.sources.readers import read_points
from synth.capture.sources.recording import UNITS_MM, PointRecording
from synth.planning.scoring.textgrid import read_textgrid

FACE = slice(0, layout.N_FACE)
HAND = slice(layout.N_FACE, layout.N_FACE + layout.N_HAND)

MAX_TAKES = 2000
"""Files of a folder at most: a bound against a wrong folder."""

MAX_FRAMES = 1_000_000
"""Frames of all takes together at most: two hours at 120 Hz, 1.4 GB."""

_PRESENT = 0.02
"""Part of the frames that must show a marker for the take to hold it."""

_FRAMED_BY = 400
"""Frames that give the axes of a session."""

_SLACK_S = 0.5
"""Most seconds that the last label may outlast the markers."""


@dataclass(frozen=True, slots=True)
class MarkerTake:
    """One file of markers and its labels.

    Attributes
    ----------
    path : Path
    markers : ndarray of float32, shape (T, 113, 3)
        Millimetres; NaN where hidden, and throughout where the take has no such marker.
    rate_hz : float
    score : Score
        On the clock of the first frame.
    has_face, has_hand : bool
    """

    path: Path
    markers: NDArray[np.float32]
    rate_hz: float
    score: Score
    has_face: bool
    has_hand: bool

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.markers) / self.rate_hz


def read_corpora(
    folder: Path, *, mapping: Mapping[str, str] | None = None, subject: str | None = None
) -> list[MarkerTake]:
    """Return the takes of a folder and the folders in it, in our axes.

    Parameters
    ----------
    folder : Path
    mapping : mapping of str to str, optional
        From the files' labels to our markers; others go by name.
    subject : str, optional
        Prefix of the labels that count.

    Raises
    ------
    CueError
        If there are none, a file is malformed or lacks its TextGrid, a marker is in no take, or no
        take shows face and hand together.
    """
    if not folder.is_dir():
        raise CueError(f"{folder}: no such folder")
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() == ".c3d")
    if not files:
        raise CueError(f"{folder}: no C3D files")
    if len(files) > MAX_TAKES:
        raise CueError(f"{folder}: {len(files)} C3D files, {MAX_TAKES} at most")
    takes: list[MarkerTake] = []
    for path in files:
        takes.append(_read(path, mapping, subject))
        if sum(len(take.markers) for take in takes) > MAX_FRAMES:
            raise CueError(f"{folder}: more than {MAX_FRAMES} frames, up to {path}")
    _check(folder, takes)
    return _framed(folder, takes)


def _read(path: Path, mapping: Mapping[str, str] | None, subject: str | None) -> MarkerTake:
    grid = next(
        (p for p in (path.with_suffix(".TextGrid"), path.with_suffix(".textgrid")) if p.exists()),
        None,
    )
    if grid is None:
        raise CueError(f"{path}: no TextGrid of its name beside it")
    recording = read_points(path, "c3d")
    naming = _named(path, recording, mapping, subject)
    unit = UNITS_MM.get(recording.unit or "mm")
    if unit is None:
        raise CueError(f"{path}: unknown unit {recording.unit!r}")
    if recording.n_frames > MAX_FRAMES:
        raise CueError(f"{path}: {recording.n_frames} frames, {MAX_FRAMES} at most")
    points = recording.frames(0, recording.n_frames)
    markers = (unit * naming.markers(points)).astype(np.float32)
    shown = np.isfinite(markers[..., 0]).mean(0) >= _PRESENT
    # The score's clock is the recording's; a take may begin later on it.
    score = read_textgrid(grid).shifted(-recording.start_s)
    last = max([0.0, *(p.end for p in score.phones), *(k.end for k in score.keys)])
    if last > recording.duration_s + _SLACK_S:
        raise CueError(
            f"{grid}: labels until {last:.2f} s, the markers end after {recording.duration_s:.2f} s"
        )
    return MarkerTake(
        path, markers, recording.rate_hz, score, bool(shown[FACE].any()), bool(shown[HAND].any())
    )


def _named(
    path: Path, recording: PointRecording, mapping: Mapping[str, str] | None, subject: str | None
) -> Naming:
    # One map serves takes of the hand alone and of the face alone.
    own = {label.rpartition(":")[2].casefold() for label in recording.labels}
    own |= {label.casefold() for label in recording.labels}
    given = {label: name for label, name in (mapping or {}).items() if label.casefold() in own}
    try:
        naming = find_names(recording.labels, mapping=given, subject=subject)
    except CueError as error:
        raise CueError(f"{path}: {error}") from error
    if not naming.found.any():
        shown = ", ".join(recording.labels[:6])
        raise CueError(f"{path}: no label names a marker of ours; it has {shown}: give --map")
    return naming


def _check(folder: Path, takes: Sequence[MarkerTake]) -> None:
    """Check that every marker occurs, and face and hand together."""
    seen = np.zeros(len(layout.MARKERS), dtype=np.bool_)
    for take in takes:
        seen |= np.isfinite(take.markers[..., 0]).any(0)
    if not seen.all():
        names = [name for name, one in zip(layout.MARKERS, seen, strict=True) if not one]
        more = f" and {len(names) - 6} more" if len(names) > 6 else ""
        raise CueError(f"{folder}: no take shows marker {', '.join(names[:6])}{more}")
    if not any(take.has_face and take.has_hand for take in takes):
        raise CueError(
            f"{folder}: no take shows face and hand together: cued sentences (corpus 3) are needed"
        )


def _framed(folder: Path, takes: Sequence[MarkerTake]) -> list[MarkerTake]:
    """Return the takes in our axes, a left-handed cuer mirrored."""
    both = [take.markers for take in takes if take.has_face and take.has_hand]
    frames = np.concatenate(both)
    few = frames[np.unique(np.linspace(0, len(frames) - 1, _FRAMED_BY).astype(int))]
    try:
        framing = find_framing(few)
    except CueError as error:
        raise CueError(f"{folder}: {error}") from error
    return [replace(take, markers=framing.apply(take.markers)) for take in takes]
