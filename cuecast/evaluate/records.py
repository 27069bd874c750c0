"""Records: figures with their origin, so that others can repeat them.

In: results of an evaluation and its arguments; out: one JSON document. The pages of `docs/` are
generated from such documents, and nothing else states a figure.
"""

import hashlib
import json
import os
import platform
import shlex
import subprocess
import time
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

import av
import numpy as np

from codec.errors import CueError
from cuecast.command.version import installed_version

RECORD_VERSION = 1
"""Version of the documents' form."""

PACKAGES = ("numpy", "scipy", "numba", "av")
"""Libraries that figures depend on most."""

FIELDS = (
    "record", "kind", "command", "commit", "version", "date", "seed", "machine", "clips", "results",
)  # fmt: skip

_CATALOGUE = "clips.json"
"""Beside clips, a file of this name may describe them like the package's own catalogue."""

_CLIPS = {
    ".wav", ".flac", ".mp3", ".m4a", ".ogg", ".mp4", ".mkv", ".mov", ".ts", ".webm", ".avi", ".mpg",
    ".csv", ".npz",
}  # fmt: skip
"""Sounds, films, tables of landmarks and motions: the content of a folder of clips."""

_YARDSTICK_S = 20.0
"""Long enough that starting the coder does not count."""


def make_record(
    kind: str,
    arguments: Sequence[str],
    results: Any,
    *,
    seed: int,
    clips: Path | Iterable[Path] | None,
) -> dict[str, Any]:
    """Return the record of an evaluation that has just ended.

    Parameters
    ----------
    kind : str
        Kind of evaluation.
    arguments : sequence of str
        The command line behind ``cuecast``.
    results : list of dict, or dict
        Rows or one set of figures, ready for JSON.
    seed : int
        Of everything random.
    clips : Path, iterable of Path, or None
        Folder of the material, or several, each of which may come up again; None where it was
        built in.

    Returns
    -------
    dict
        With the keys of `FIELDS`.
    """
    folders = [clips] if clips is None or isinstance(clips, Path) else list(dict.fromkeys(clips))
    return {
        "record": RECORD_VERSION,
        "kind": kind,
        "command": shlex.join(["cuecast", *_without_folders(arguments)]),
        "commit": commit(),
        "version": installed_version(),
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "seed": seed,
        "machine": machine(),
        "clips": [clip for folder in folders for clip in describe_clips(folder)],
        "results": results,
    }


def read_record(path: Path) -> dict[str, Any]:
    """Read a record.

    Raises
    ------
    CueError
        If the file is no record of this version.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CueError(f"{path}: cannot be read as a record: {error}") from None
    missing = [name for name in FIELDS if not isinstance(document, dict) or name not in document]
    if missing:
        raise CueError(f"{path}: is no record, it has no {missing[0]!r}")
    if document["record"] != RECORD_VERSION:
        raise CueError(f"{path}: record of version {document['record']}, not {RECORD_VERSION}")
    return dict(document)


def describe_clips(folder: Path | None) -> list[dict[str, Any]]:
    """Return name, SHA-256, licence and source of each clip in a folder.

    Clips are known by their SHA-256, from the package's catalogue or a `clips.json` beside them;
    licence and source of others are None.
    """
    if folder is None:
        return [dict(_BUILT_IN)]
    known = catalogue(folder)
    described = []
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() in _CLIPS):
        digest = sha256(path)
        entry = known.get(digest, {})
        described.append(
            {
                "name": entry.get("name", path.stem),
                "sha256": digest,
                "licence": entry.get("licence"),
                "source": entry.get("source"),
            }
        )
    return described


_BUILT_IN = {
    "name": "built-in",
    "sha256": None,
    "licence": "Apache-2.0",
    "source": "made by the command itself",
}


def catalogue(folder: Path | None = None) -> dict[str, dict[str, str]]:
    """Return the known clips, by their SHA-256."""
    text = (files("cuecast.evaluate") / "assets" / _CATALOGUE).read_text(encoding="utf-8")
    known: dict[str, dict[str, str]] = json.loads(text)
    if folder is not None and (folder / _CATALOGUE).is_file():
        known |= json.loads((folder / _CATALOGUE).read_text(encoding="utf-8"))
    return known


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def commit() -> str | None:
    """Return the commit that the running sources are of, with ``+`` if they differ from it."""
    folder = Path(__file__).resolve().parents[2]
    told = _git(folder, "rev-parse", "--short=12", "HEAD")
    if told is None:
        return None
    changed = _git(folder, "status", "--porcelain", "--untracked-files=no")
    return told + ("+" if changed else "")


def machine() -> dict[str, Any]:
    """Return a description of the machine, with a yardstick of its speed."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in PACKAGES},
        "aac_xrt": round(aac_speed(), 1),
    }


@cache
def aac_speed() -> float:
    """Return how many times faster than real time FFmpeg codes noise as AAC at 128 kbit/s.

    Speeds of an evaluation are stated as ratios to this, measured in the same run, by processor
    time: the quotient depends on the program, where each of the two depends on the machine.
    """
    fs = 48_000
    rng = np.random.default_rng(0)
    sound = rng.normal(0.0, 0.1, (2, round(_YARDSTICK_S * fs))).astype(np.float32)
    context: Any = av.CodecContext.create("aac", "w")
    context.sample_rate, context.layout, context.format = fs, "stereo", "fltp"
    context.bit_rate = 128_000
    size = 1024
    began = time.process_time()
    for first in range(0, sound.shape[1] - size + 1, size):
        block = np.ascontiguousarray(sound[:, first : first + size])
        frame = av.AudioFrame.from_ndarray(block, format="fltp", layout="stereo")
        frame.sample_rate, frame.pts = fs, first
        context.encode(frame)
    context.encode(None)
    return _YARDSTICK_S / max(time.process_time() - began, 1e-6)


def _without_folders(arguments: Sequence[str]) -> list[str]:
    """Return a command line whose folders have lost their paths: those are this machine's."""
    kept, folder = [], False
    for word in arguments:
        kept.append(Path(word).name if folder else word)
        folder = word in ("--clips", "--out", "--record", "--voice")
    return kept


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _git(folder: Path, *words: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
