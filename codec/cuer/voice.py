"""The voice: models and gesture table of one cuer, in memory and in ``.npz`` files.

The identity is a hash of the content, so that a stream made with one voice is never drawn with
another one. The file's format is stated in `save_voice`.
"""

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer import layout
from codec.cuer.gestures import GestureTable
from codec.cuer.models.face import N_FACE_PARAMETERS, FaceModel
from codec.cuer.models.hand import N_HAND_PARAMETERS, HandModel
from codec.cuer.models.inversion import bridge, invert_face, invert_hand
from codec.cuer.models.smooth_inversion import smooth_face, smooth_hand
from codec.cuer.motion import Motion
from codec.cues.language import Language, find_language, french
from codec.cues.score import Score
from codec.errors import CueError, VoiceError
from codec.files.data import DATA
from codec.files.npz import read_arrays, write_arrays

FORMAT = "cuecast-voice-1"

MAX_BYTES = 4 << 20
"""Bytes of a voice's file, unpacked, at most; the built-in one has under one million."""

_PARTS: dict[str, type[FaceModel | HandModel | GestureTable]] = {
    "face": FaceModel,
    "hand": HandModel,
    "gestures": GestureTable,
}
_FACE = slice(0, layout.N_FACE)
_HAND = slice(layout.N_FACE, layout.N_FACE + layout.N_HAND)


@dataclass(frozen=True, slots=True)
class Voice:
    """Models and gesture table of one cuer.

    Attributes
    ----------
    name : str
        For people.
    face : FaceModel
    hand : HandModel
        With twelve shape parameters.
    gestures : GestureTable
    language : Language
        Whose phones, shapes and placements these are.
    identity : str
        Sixteen hexadecimal digits, a hash of all numbers of the voice; the name does not count.

    Examples
    --------
    >>> voice = load_voice("claire")
    >>> voice.name, len(voice.layout)
    ('claire', 31)
    """

    name: str
    face: FaceModel
    hand: HandModel
    gestures: GestureTable
    language: Language = field(default_factory=french)
    identity: str = field(init=False)

    def __post_init__(self) -> None:
        if self.hand.n_shape != N_HAND_PARAMETERS:
            raise VoiceError(f"voice has {self.hand.n_shape} hand parameters, 12 are needed")
        if self.gestures.placement_targets.shape[2] != self.hand.n_motion:
            raise VoiceError("gesture table and hand model differ in the forearm's parameters")
        self.gestures.check(self.language)
        if self.gestures.neutral_head.size != self.face.n_motion:
            raise VoiceError("gesture table and face model differ in the head's parameters")
        digest = hashlib.sha256(FORMAT.encode())
        for key, array in arrays_of(self):
            digest.update(f"{key}{array.shape}".encode())
            digest.update(array.astype("<f4").tobytes())
        object.__setattr__(self, "identity", digest.hexdigest()[:16])

    @property
    def layout(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of `Motion.params`."""
        counts = {
            "face": N_FACE_PARAMETERS,
            "hand": N_HAND_PARAMETERS,
            "head": self.face.n_motion,
            "forearm": self.hand.n_motion,
        }
        return tuple(f"{group}.{k + 1}" for group, n in counts.items() for k in range(n))

    @property
    def face_columns(self) -> NDArray[np.intp]:
        """Columns of `Motion.params` that drive the face model, in its order."""
        head = N_FACE_PARAMETERS + N_HAND_PARAMETERS + np.arange(self.face.n_motion)
        return np.concatenate([np.arange(N_FACE_PARAMETERS), head])

    @property
    def hand_columns(self) -> NDArray[np.intp]:
        """Columns of `Motion.params` that drive the hand model, in its order."""
        hand = N_FACE_PARAMETERS + np.arange(N_HAND_PARAMETERS)
        return np.concatenate(
            [
                hand,
                N_FACE_PARAMETERS
                + N_HAND_PARAMETERS
                + self.face.n_motion
                + np.arange(self.hand.n_motion),
            ]
        )

    def check_motion(self, motion: Motion) -> None:
        """Check that a motion's columns mean what this voice's do.

        Parameters
        ----------
        motion : Motion

        Raises
        ------
        VoiceError
            If it was made with another voice, or names its columns otherwise.
        """
        if motion.voice != self.identity:
            raise VoiceError(f"motion was made with voice {motion.voice}, not {self.identity}")
        if motion.layout != self.layout:
            pairs = zip(motion.layout, self.layout, strict=False)
            odd = next((f"{a} for {b}" for a, b in pairs if a != b), "another length")
            raise VoiceError(f"motion has another layout than voice {self.name}: {odd}")

    def reconstruct(self, params: ArrayLike) -> NDArray[np.float32]:
        """Return the markers of parameters.

        Parameters
        ----------
        params : array_like, shape (T, P)
            Columns as in `layout`.

        Returns
        -------
        ndarray of float32, shape (T, 113, 3)
            World coordinates, millimetres.
        """
        p = np.asarray(params, dtype=np.float64)
        if p.ndim != 2 or p.shape[1] != len(self.layout):
            raise CueError(f"parameters have shape {p.shape}, the voice {len(self.layout)} names")
        markers = np.empty((len(p), layout.N_FACE + layout.N_HAND, 3), dtype=np.float32)
        markers[:, _FACE] = self.face.reconstruct(p[:, self.face_columns])
        markers[:, _HAND] = self.hand.reconstruct(p[:, self.hand_columns])
        return markers

    def invert(
        self,
        markers: ArrayLike,
        visible: ArrayLike | None = None,
        *,
        rate_hz: float,
        start_s: float = 0.0,
        score: Score | None = None,
    ) -> Motion:
        """Return the motion that explains the visible markers best.

        Parameters
        ----------
        markers : array_like, shape (T, 113, 3)
            World coordinates, millimetres; NaN marks a hidden marker.
        visible : array_like of bool, shape (T, 113), optional
            Default: every marker that is finite.
        rate_hz : float
            Frames per second; the frames are consecutive.
        start_s, score
            Passed on to the motion.

        Returns
        -------
        Motion
        """
        x = np.asarray(markers, dtype=np.float64)
        if x.ndim != 3 or x.shape[1:] != (len(layout.MARKERS), 3):
            raise CueError(f"markers have shape {x.shape}, expected (T, {len(layout.MARKERS)}, 3)")
        seen = np.asarray(np.isfinite(x).all(-1))
        if visible is not None:
            seen &= np.asarray(visible, dtype=bool)
        x = np.where(seen[..., None], x, 0.0)
        params = np.empty((len(x), len(self.layout)), dtype=np.float32)
        face, of_face = x[:, _FACE], seen[:, _FACE]
        found = invert_face(self.face, face, of_face)
        params[:, self.face_columns] = bridge(self.face, face, of_face, found, rate_hz=rate_hz)
        hand, of_hand = x[:, _HAND], seen[:, _HAND]
        found = invert_hand(self.hand, hand, of_hand)
        params[:, self.hand_columns] = bridge(self.hand, hand, of_hand, found, rate_hz=rate_hz)
        return Motion(params, rate_hz, start_s, self.layout, self.identity, score)

    def invert_smooth(
        self, markers: NDArray[np.floating], hand: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Return the parameters of markers that are all seen and move without noise.

        The result is as near to the markers as that of `invert`, for a fifth of the work.

        Parameters
        ----------
        markers : ndarray, shape (T, 113, 3)
            Of T consecutive frames, one more than a multiple of
            `codec.cuer.models.smooth_inversion.ANCHORED`, millimetres.
        hand : ndarray, shape (T, 12)
            Parameters of the hand's shape nearby, moving smoothly too.

        Returns
        -------
        ndarray of float32, shape (T, parameters)
        """
        x = np.asarray(markers, dtype=np.float64)
        params = np.empty((len(x), len(self.layout)), dtype=np.float32)
        near = np.asarray(hand, dtype=np.float64)
        params[:, self.face_columns] = smooth_face(self.face, x[:, _FACE])
        params[:, self.hand_columns] = smooth_hand(self.hand, x[:, _HAND], near)
        return params


def arrays_of(voice: Voice) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Yield name and content of all arrays of a voice file (O2)."""
    for part, kind in _PARTS.items():
        for item in fields(kind):
            yield f"{part}.{item.name}", getattr(getattr(voice, part), item.name)


def save_voice(voice: Voice, path: str | os.PathLike[str]) -> None:
    """Write a voice: one float32 array per attribute of its parts, and texts beside.

    Parameters
    ----------
    voice : Voice
    path : path-like
        An ``.npz`` file without pickle.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_voice(load_voice("claire"), f"{folder}/mine.npz")
    ...     load_voice(f"{folder}/mine.npz").name
    'claire'
    """
    header: dict[str, NDArray[Any]] = {
        "format": np.array(FORMAT, dtype=np.str_),
        "name": np.array(voice.name, dtype=np.str_),
        "identity": np.array(voice.identity, dtype=np.str_),
    }
    if voice.language != french():
        header["tables"] = np.array(voice.language.identity, dtype=np.str_)
    write_arrays(path, header | dict(arrays_of(voice)))


def load_voice(path_or_name: str | os.PathLike[str] = "claire") -> Voice:
    """Read a voice file, or a built-in voice by its name.

    Parameters
    ----------
    path_or_name : path-like
        A name without a folder and without ``.npz`` means a voice that comes with the package.

    Returns
    -------
    Voice

    Raises
    ------
    VoiceError
        If the file is missing, damaged, or not a voice.

    Examples
    --------
    >>> load_voice("missing.npz")
    Traceback (most recent call last):
    codec.errors.VoiceError: missing.npz: No such file or directory
    """
    path = _find(path_or_name)
    try:
        arrays = read_arrays(path, max_bytes=MAX_BYTES)
        found = str(arrays["format"]) if "format" in arrays else None
        if found != FORMAT:
            raise VoiceError(f"{path}: not a voice file: format is {found}, expected {FORMAT}")
        # Arrays are named PART.FIELD after the dataclasses that hold them.
        parts: dict[str, Any] = {
            part: kind(**{item.name: arrays[f"{part}.{item.name}"] for item in fields(kind)})
            for part, kind in _PARTS.items()
        }
        tables = str(arrays["tables"]) if "tables" in arrays else french().identity
        voice = Voice(str(arrays["name"]), **parts, language=find_language(tables))
        stated = str(arrays["identity"])
    except KeyError as error:
        raise VoiceError(f"{path}: voice without its array {error.args[0]}") from error
    except (ValueError, TypeError, IndexError) as error:
        raise VoiceError(f"{path}: malformed voice: {error}") from error
    except VoiceError:
        raise
    except CueError as error:
        text = str(error)
        raise VoiceError(text if text.startswith(str(path)) else f"{path}: {text}") from error
    # The identity is a hash of the content: a file that was changed does not pass for another.
    if voice.identity != stated:
        raise VoiceError(f"{path}: content has identity {voice.identity}, the file says {stated}")
    return voice


def built_in_voices() -> tuple[str, ...]:
    """Return the names of the voices that come with the package."""
    return tuple(sorted(path.stem for path in (DATA / "voices").glob("*.npz")))


def _find(path_or_name: str | os.PathLike[str]) -> Path:
    text = os.fspath(path_or_name)
    if Path(text).name != text or text.endswith(".npz"):
        return Path(text)
    if text not in built_in_voices():
        raise VoiceError(f"no voice called {text!r}; built in: {', '.join(built_in_voices())}")
    return DATA / "voices" / f"{text}.npz"
