"""Motion: parameters of the cuer over time, in memory and in ``.npz`` files without pickle."""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from codec.npz import read_arrays, write_arrays
from codec.score import Score

MAX_FILE_BYTES = 1 << 31
"""Largest motion that `load_motion` accepts: four days of 31 parameters at 50 Hz."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Parameters at a constant rate.

    Attributes
    ----------
    params : ndarray of float32, shape (T, P)
        One row per frame, one column per name in `layout`.
    rate_hz : float
        Frames per second, within 1..1000.
    start_s : float
        Time of the first frame on the programme's clock, seconds.
    layout : tuple of str
        Names of the parameters: ``face.*``, ``hand.*``, ``head.*``, ``forearm.*``.
    voice : str
        Identity of the voice that gives the parameters their meaning (`codec.voice.Voice`).
    score : Score, optional
        Phones and keys, where known.
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
        if not (1 <= self.rate_hz <= 1000 and np.isfinite(self.start_s)):
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
    """Write `motion` to `path`, through a temporary name in the same folder."""
    score = "" if motion.score is None else motion.score.to_json()
    write_arrays(
        path,
        {
            "params": motion.params,
            "rate_hz": np.array(motion.rate_hz),
            "start_s": np.array(motion.start_s),
            "layout": np.array(motion.layout, dtype=np.str_),
            "voice": np.array(motion.voice, dtype=np.str_),
            "score": np.array(score, dtype=np.str_),
        },
    )


def load_motion(path: str | os.PathLike[str]) -> Motion:
    """Read a motion file.

    Raises
    ------
    CueError
        If the file is missing, damaged, too large, or not a motion.
    """
    arrays = read_arrays(path, max_bytes=MAX_FILE_BYTES)
    try:
        text = str(arrays["score"]) if "score" in arrays else ""
        return Motion(
            arrays["params"], float(arrays["rate_hz"]), float(arrays["start_s"]),
            tuple(map(str, arrays["layout"])), str(arrays["voice"]),
            Score.from_json(text) if text else None,
        )  # fmt: skip
    except (KeyError, ValueError, TypeError) as error:
        raise CueError(f"{path}: not a motion file: {error}") from error
