"""From the labels of a laboratory to our markers: by name, or by a mapping file.

Prefixes of subjects (``Claire:FH0``), capitals and blanks do not count. Points that are no marker
of ours are left over; those without a name may be markers whose identity the system has lost
(`synth.capture.points.relabel`).
"""

import csv
import io
import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS
from codec.errors import CueError
from codec.files.whole import whole_file

MAX_MAP_BYTES = 1 << 20
"""Bytes of a map of labels at most: a bound against wrong files."""

_UNNAMED = re.compile(
    r"^(\*\d*|u\d+|c_?\d+|unlabel(l)?ed[ _-]*\d*|uname\*?\d*|noname\d*|ghost\d*|)$"
)
_FOLDED = {name.casefold(): name for name in MARKERS}


@dataclass(frozen=True, slots=True)
class Naming:
    """Where our markers stand in a recording.

    Attributes
    ----------
    columns : ndarray of int, shape (113,)
        Number of the label of each marker, -1 where the recording has none.
    unnamed : ndarray of int
        Labels that name nothing.
    unused : tuple of str
        Labels that name something else.
    """

    columns: NDArray[np.intp]
    unnamed: NDArray[np.intp]
    unused: tuple[str, ...]

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which of our markers the recording has, shape (113,)."""
        return np.asarray(self.columns >= 0)

    def markers(self, points: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return points (T, labels, 3) as our markers (T, 113, 3), NaN where there are none."""
        out = points[:, self.columns].astype(np.float64)
        out[:, ~self.found] = np.nan
        return out


def find_names(
    labels: tuple[str, ...], *, mapping: Mapping[str, str] | None = None, subject: str | None = None
) -> Naming:
    """Return where our markers stand among `labels`.

    Parameters
    ----------
    labels : tuple of str
    mapping : mapping of str to str, optional
        From labels to our markers, as from `read_map`; labels that are not in it go by name.
    subject : str, optional
        Only labels with this prefix before a colon.

    Raises
    ------
    CueError
        If a marker stands there twice, or the mapping names an absent label.
    """
    given = {label.casefold(): name for label, name in (mapping or {}).items()}
    columns = np.full(len(MARKERS), -1, dtype=np.intp)
    unnamed, unused, used = [], [], set()
    for number, label in enumerate(labels):
        # Labels may be SUBJECT:NAME. The user's map is asked for the whole label, then for the bare
        # name; then the name itself counts.
        prefix, _, bare = label.rpartition(":")
        if subject is not None and prefix.casefold() != subject.casefold():
            continue
        key = next((k for k in (label.casefold(), bare.casefold()) if k in given), None)
        if key is not None:
            used.add(key)
        name = given[key] if key is not None else _FOLDED.get(bare.strip().casefold())
        if name is None:
            if _UNNAMED.match(bare.strip().casefold()):
                unnamed.append(number)
            else:
                unused.append(label)
            continue
        at = MARKERS.index(name)
        if columns[at] >= 0:
            raise CueError(
                f"marker {name} stands there twice, as {labels[columns[at]]!r} and {label!r}"
                + ("" if ":" not in label else ": choose with --subject")
            )
        columns[at] = number
    missing = sorted(set(given) - used)
    if missing:
        raise CueError(f"the map names {missing[0]!r}, which is no label of the recording")
    return Naming(columns, np.array(unnamed, dtype=np.intp), tuple(unused))


def read_map(path: str | os.PathLike[str]) -> dict[str, str]:
    """Read a mapping from labels to our markers: JSON, or CSV with a label and a marker a line.

    Raises
    ------
    CueError
        If the file is malformed, or names an unknown marker.
    """
    try:
        if Path(path).stat().st_size > MAX_MAP_BYTES:
            raise CueError(f"{path}: a map of more than {MAX_MAP_BYTES >> 20} MB")
        text = Path(path).read_text(encoding="utf-8-sig")
        pairs = _from_json(text) if text.lstrip().startswith("{") else _from_csv(text)
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error
    except (ValueError, csv.Error, RecursionError) as error:
        raise CueError(f"{path}: not a map of labels: {error}") from error
    mapping = {}
    for label, name in pairs:
        if name.casefold() not in _FOLDED:
            raise CueError(f"{path}: {label!r} is mapped to {name!r}, which is no marker of ours")
        mapping[label] = _FOLDED[name.casefold()]
    if not mapping:
        raise CueError(f"{path}: an empty map")
    if len(set(mapping.values())) < len(mapping):
        twice = next(n for n in mapping.values() if list(mapping.values()).count(n) > 1)
        raise CueError(f"{path}: two labels are mapped to {twice}")
    return mapping


def write_map(
    path: str | os.PathLike[str],
    pairs: Mapping[str, str],
    *,
    unsure: Iterable[tuple[str, str, float]] = (),
) -> None:
    """Write a mapping from labels to our markers: JSON by its name, else CSV.

    Parameters
    ----------
    path : path-like
    pairs : mapping of str to str
    unsure : iterable of (str, str, float)
        Labels, markers and how sure that is: in CSV they stand as comments, which `read_map` skips.

    Raises
    ------
    CueError
        If the file cannot be written, or CSV cannot hold a label.
    """
    if Path(path).suffix.casefold() == ".json":
        text = json.dumps(dict(pairs), ensure_ascii=False, indent=1) + "\n"
    else:
        comment = next((label for label in pairs if label.startswith("#")), None)
        if comment is not None:
            raise CueError(f"{path}: {comment!r} would be a comment in CSV: name it .json")
        out = io.StringIO()
        rows = csv.writer(out, lineterminator="\n")
        rows.writerow(("label", "marker"))
        rows.writerows(pairs.items())
        rows.writerows((f"# {label}", name, f"{sure:.2f}") for label, name, sure in unsure)
        text = out.getvalue()
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _from_json(text: str) -> list[tuple[str, str]]:
    document = json.loads(text)
    if not all(isinstance(name, str) for name in document.values()):
        raise ValueError("a marker's name is no text")
    return [(label.strip(), name.strip()) for label, name in document.items()]


def _from_csv(text: str) -> list[tuple[str, str]]:
    rows = [row for row in csv.reader(text.splitlines()) if row and not row[0].startswith("#")]
    pairs = [(row[0].strip(), row[1].strip() if len(row) > 1 else "") for row in rows]
    # A line of titles names no marker.
    return pairs[1:] if pairs and pairs[0][1].casefold() in ("marker", "markers", "name") else pairs
