"""Motion: parameters of the cuer over time, in memory and in ``.npz`` files without pickle."""

import json
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Score
from codec.errors import CueError
from codec.files.npz import Parts, read_arrays, write_arrays
from codec.files.whole import folder_beside

MAX_FILE_BYTES = 1 << 31
"""Largest motion that `load_motion` accepts: four days of 31 parameters at 50 Hz."""

_CHUNK_BYTES = 1 << 18
"""Bytes that are read at once from a temporary file."""

MOST_PARAM = 1000.0
"""Magnitude of parameters at most. They are in standard deviations or so of a cuer's movements:
what is a hundred times as large as any pose is damage, and overflows what draws or codes it."""

MOST_START_S = 1e10
"""Seconds from the clock's zero at most, either way: farther away times lose their microseconds."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Parameters at a constant rate.

    Attributes
    ----------
    params : ndarray of float32, shape (T, P)
        One row per frame, one column per name in `layout`; magnitudes up to `MOST_PARAM`.
    rate_hz : float
        Frames per second, within 1..1000.
    start_s : float
        Time of the first frame on the programme's clock, seconds; up to `MOST_START_S`.
    layout : tuple of str
        Names of the parameters: ``face.*``, ``hand.*``, ``head.*``, ``forearm.*``.
    voice : str
        Identity of the voice that gives the parameters their meaning (`codec.cuer.voice.Voice`).
    score : Score, optional
        Phones and keys, where known.

    Examples
    --------
    >>> import numpy as np
    >>> from codec import load_voice
    >>> voice = load_voice("claire")
    >>> still = np.zeros((100, len(voice.layout)), dtype=np.float32)
    >>> Motion(still, 50.0, 0.0, voice.layout, voice.identity).duration_s
    2.0
    """

    params: NDArray[np.float32]
    rate_hz: float
    start_s: float
    layout: tuple[str, ...]
    voice: str
    score: Score | None = None

    def __post_init__(self) -> None:
        params = np.ascontiguousarray(self.params, dtype=np.float32)
        if params.ndim != 2 or params.shape[1] != len(self.layout):
            raise CueError(f"motion has shape {params.shape}, its layout {len(self.layout)} names")
        if not np.isfinite(params).all():
            raise CueError("motion holds values that are not finite")
        if len(params) and np.abs(params).max() > MOST_PARAM:
            raise CueError(
                f"motion holds parameters up to {np.abs(params).max():.3g}, the limit is "
                f"{MOST_PARAM:g}"
            )
        if not (1 <= self.rate_hz <= 1000 and abs(self.start_s) <= MOST_START_S):
            raise CueError(f"motion has rate {self.rate_hz} Hz and start {self.start_s} s")
        object.__setattr__(self, "params", params)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.params) / self.rate_hz

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Time of every frame on the programme's clock, shape (T,)."""
        return self.start_s + np.arange(len(self.params)) / self.rate_hz


def save_motion(motion: Motion, path: str | os.PathLike[str]) -> None:
    """Write a motion file, through a temporary name in the same folder.

    Parameters
    ----------
    motion : Motion
    path : path-like
        An ``.npz`` file without pickle; one that exists is replaced.

    Examples
    --------
    >>> import numpy as np, tempfile
    >>> from codec import load_voice
    >>> voice = load_voice("claire")
    >>> still = np.zeros((100, len(voice.layout)), dtype=np.float32)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/still.npz"
    ...     save_motion(Motion(still, 50.0, 0.0, voice.layout, voice.identity), path)
    ...     load_motion(path).params.shape
    (100, 31)
    """
    with MotionWriter(path) as writer:
        writer.append(motion)


class MotionWriter:
    """A motion file that is written part by part, in constant memory.

    The file appears when the block ends without an error: frames so far wait in unnamed
    files of the same folder, because an array of a ``.npz`` opens with its length.

    Parameters
    ----------
    path : path-like

    Examples
    --------
    >>> import tempfile
    >>> part = Motion(np.zeros((2, 1)), 50.0, 0.0, ("face.1",), "v")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with MotionWriter(f"{folder}/m.npz") as writer:
    ...         for start_s in (0.0, 0.04):
    ...             writer.append(replace(part, start_s=start_s))
    ...     len(load_motion(f"{folder}/m.npz").params)
    4
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = Path(path)
        self._first: Motion | None = None
        self._frames = 0
        self._scored = False
        self._stack = ExitStack()

    def __enter__(self) -> "MotionWriter":
        try:
            self._params, phones, keys = self._spool(), self._spool(), self._spool()
        except OSError as error:
            self._stack.close()
            raise CueError(f"{self._path}: cannot write: {error.strerror}") from error
        self._phones, self._keys = _JsonList(phones), _JsonList(keys)
        return self

    def _spool(self) -> IO[bytes]:
        return self._stack.enter_context(tempfile.TemporaryFile(dir=folder_beside(self._path)))

    def append(self, motion: Motion) -> None:
        """Add the next frames with their score.

        Raises
        ------
        CueError
            If they do not follow the frames before.
        """
        first = self._first = self._first or replace(motion, params=motion.params[:0], score=None)
        if (motion.rate_hz, motion.layout, motion.voice) != (
            first.rate_hz,
            first.layout,
            first.voice,
        ):
            raise CueError("parts of a motion differ in rate, layout or voice")
        due_s = first.start_s + self._frames / first.rate_hz
        if abs(motion.start_s - due_s) > 0.5 / first.rate_hz:
            raise CueError(f"part of a motion starts at {motion.start_s} s, not at {due_s} s")
        self._params.write(motion.params.tobytes())
        self._frames += len(motion.params)
        if motion.score is not None:
            self._phones.extend(motion.score.phone_rows())
            self._keys.extend(key.as_dict() for key in motion.score.keys)
            self._scored = True

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._stack:
            if kind is None:
                self._write()

    def _write(self) -> None:
        first = self._first
        if first is None:
            raise CueError(f"{self._path}: a motion without frames")
        write_arrays(
            self._path,
            {
                "params": Parts(
                    np.dtype("<f4"), (self._frames, len(first.layout)), _chunks(self._params)
                ),
                "rate_hz": np.array(first.rate_hz),
                "start_s": np.array(first.start_s),
                "layout": np.array(first.layout, dtype=np.str_),
                "voice": np.array(first.voice, dtype=np.str_),
                "score": self._score() if self._scored else np.array("", dtype=np.str_),
            },
        )

    def _score(self) -> Parts:
        """Return the text of `Score.to_json` for all that was said."""
        pieces: list[str | _JsonList] = ['{"phones": [', self._phones, '], "keys": [', self._keys]
        pieces.append("]}")
        length = sum(map(len, pieces))
        chunks = (
            text.encode("utf-32-le")
            for piece in pieces
            for text in ([piece] if isinstance(piece, str) else piece.texts())
        )
        return Parts(np.dtype(f"<U{length}"), (), chunks)


class _JsonList:
    """The inside of a JSON list, kept in a file; its length counts letters."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def extend(self, items: Iterable[Any]) -> None:
        for item in items:
            text = (", " if self._length else "") + json.dumps(item, ensure_ascii=False)
            self._length += len(text)
            self._file.write(text.encode("utf-32-le"))

    def texts(self) -> Iterator[str]:
        return (chunk.decode("utf-32-le") for chunk in _chunks(self._file))


def _chunks(file: IO[bytes]) -> Iterator[bytes]:
    """Yield the content of a file from its beginning."""
    file.seek(0)
    while chunk := file.read(_CHUNK_BYTES):
        yield chunk


def load_motion(path: str | os.PathLike[str]) -> Motion:
    """Read a motion file.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Motion

    Raises
    ------
    CueError
        If the file is missing, damaged, too large, or not a motion.

    Examples
    --------
    >>> load_motion("missing.npz")
    Traceback (most recent call last):
    codec.errors.CueError: missing.npz: No such file or directory
    """
    arrays = read_arrays(path, max_bytes=MAX_FILE_BYTES)
    try:
        text = str(arrays["score"]) if "score" in arrays else ""
        return Motion(
            arrays["params"],
            float(arrays["rate_hz"]),
            float(arrays["start_s"]),
            tuple(map(str, arrays["layout"])),
            str(arrays["voice"]),
            Score.from_json(text) if text else None,
        )
    except CueError as error:
        raise CueError(f"{path}: {error}") from error
    except (KeyError, ValueError, TypeError) as error:
        raise CueError(f"{path}: not a motion file: {error}") from error


def sample_params(motion: Motion, times_s: NDArray[np.float64]) -> NDArray[np.float32]:
    """Interpolate the parameters at `times_s`, linearly, held at both ends; shape (n, P)."""
    position = np.clip((times_s - motion.start_s) * motion.rate_hz, 0, len(motion.params) - 1)
    below = np.floor(position).astype(np.intp)
    above = np.minimum(below + 1, len(motion.params) - 1)
    share = (position - below)[:, None]
    mixed = motion.params[below] * (1 - share) + motion.params[above] * share
    return mixed.astype(np.float32)
