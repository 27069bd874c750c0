"""The coding tables of a voice: targets of resynthesis, bases of the residual.

They are trained on motions of the voice (`codec.training.coding_tables`) and stored under its
identity, in the package or in the user's folder; those of a voice that nobody has trained are
derived from its models and gesture table, less efficient but complete. Both ends of a stream need
the same tables: streams name them by the coding's identity. Specification: spec/bitstream.md,
sections 6 and 6.5.
"""

import functools
import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.movement import Movement
from codec.cuer.voice import Voice
from codec.cues.language import Language, french
from codec.cues.timeline import TICKS
from codec.errors import VoiceError
from codec.files.data import DATA
from codec.files.npz import read_arrays, write_arrays
from codec.superframe.resynthesis.targets import Targets
from codec.superframe.transform import Bases, Basis, klt, marker_metric, scales_of

Array = NDArray[np.float64]

FOLDER = DATA / "coding"
FORMAT = "cuecast-coding-2"

_MAX_BYTES = 1 << 20
"""Bytes of coding tables, unpacked, at most."""

_TARGETS = ("hand", "head", "forearm", "arc", "face")
_BASES = ("residual", "loose", "plain", "filmed")


@dataclass(frozen=True, slots=True)
class Coding:
    """Tables for coding the motions of one voice.

    Attributes
    ----------
    voice : str
        Identity of the voice.
    targets : Targets
        Of the resynthesis.
    residual : Basis
        Of the residual of the resynthesis.
    loose : Basis
        The same for a cuer who does not keep to the score's times.
    mean : ndarray of float64, shape (P,)
        Parameters that stand for a motion without a score.
    plain : Basis
        Of motion about that mean.
    filmed : Basis
        The same of cuers at the pace of real ones, seen by one camera.
    trained : bool
        Whether they were trained; else they are derived from the voice, at each end anew.
    language : Language
        That of the voice.
    identity : str
        Sixteen hexadecimal digits, a hash of the voice's identity, of the format's tables and of
        these (I1).
    """

    voice: str
    targets: Targets
    residual: Basis
    loose: Basis
    mean: Array
    plain: Basis
    filmed: Basis
    trained: bool = True
    language: Language = field(default_factory=french)
    bases: Bases = field(init=False)
    identity: str = field(init=False)

    def __post_init__(self) -> None:
        keys = self.language.n_shapes * self.language.n_placements
        sizes = len(self.targets.hand), len(self.targets.face)
        if sizes != (keys, self.language.n_phones):
            raise VoiceError(
                f"coding tables of {sizes[0]} keys and {sizes[1]} phones; {self.language.name} has "
                f"{keys} and {self.language.n_phones}"
            )
        digest = hashlib.sha256(f"{FORMAT}{self.voice}".encode() + self.language.digest)
        for name, array in arrays_of(self):
            # What is derived may differ in its last bits from machine to machine.
            if self.trained or array.dtype.kind == "i":
                digest.update(f"{name}{array.shape}".encode() + array.tobytes())
        object.__setattr__(self, "identity", digest.hexdigest()[:16])
        bases = (self.residual, self.loose, self.plain, self.filmed)
        object.__setattr__(self, "bases", bases)


def coding_for(voice: Voice) -> Coding:
    """Return the tables of a voice: the trained ones if there are any."""
    return _cached(_ByIdentity(voice))


@dataclass(frozen=True)
class _ByIdentity:
    """A voice that compares by its identity, as the key of a cache."""

    voice: Voice

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByIdentity) and (
            (other.voice.identity, other.voice.language)
            == (self.voice.identity, self.voice.language)
        )

    def __hash__(self) -> int:
        return hash(self.voice.identity)


@functools.lru_cache(maxsize=8)
def _cached(key: _ByIdentity) -> Coding:
    path = trained_path(key.voice)
    return derive_coding(key.voice) if path is None else load_coding(path, key.voice)


def user_folder() -> Path:
    """Return the folder of the tables that a user trained: ``$XDG_DATA_HOME/cuecast/coding``."""
    base = os.environ.get("XDG_DATA_HOME") or str(Path.home() / ".local" / "share")
    return Path(base) / "cuecast" / "coding"


def trained_path(voice: Voice) -> Path | None:
    """Return the file of the tables that were trained for a voice, None if there is none."""
    paths = (folder / f"{voice.identity}.npz" for folder in (FOLDER, user_folder()))
    return next((path for path in paths if path.exists()), None)


def keep_coding(coding: Coding, folder: Path | None = None) -> Path:
    """Write tables where `coding_for` finds them, the user's folder by default."""
    target = user_folder() if folder is None else folder
    target.mkdir(parents=True, exist_ok=True)
    path = target / f"{coding.voice}.npz"
    save_coding(coding, path)
    _cached.cache_clear()
    return path


def arrays_of(coding: Coding) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Yield all numbers of a coding as they are stored (table 4)."""
    for name in _TARGETS:
        yield f"targets.{name}", getattr(coding.targets, name).astype("<f4")
    yield "targets.places", coding.targets.places.astype("<f4")
    yield "targets.late", coding.targets.late.astype("<f4")
    yield "targets.movement", coding.targets.movement.as_array()
    for name in _BASES:
        basis = getattr(coding, name)
        yield f"{name}.matrix", basis.matrix.astype("<f4")
        yield f"{name}.scales", basis.scales.astype("<i2")
    yield "mean", coding.mean.astype("<f4")


def save_coding(coding: Coding, path: str | os.PathLike[str]) -> None:
    """Write tables as float32 and int16 arrays."""
    write_arrays(path, dict(arrays_of(coding)) | {"voice": np.array(coding.voice, dtype=np.str_)})


def load_coding(path: str | os.PathLike[str], voice: Voice) -> Coding:
    """Read the tables of a voice.

    Raises
    ------
    VoiceError
        If they are not tables of this voice.
    """
    arrays = read_arrays(path, max_bytes=_MAX_BYTES)
    try:
        stated = str(arrays["voice"])
        hand, head, forearm, arc, face = (arrays[f"targets.{name}"] for name in _TARGETS)
        targets = Targets(
            hand, head, forearm, arc, face, Movement.from_array(arrays["targets.movement"]),
            arrays["targets.places"], arrays["targets.late"],
        )  # fmt: skip
        bases = (
            Basis(arrays[f"{n}.matrix"].astype(np.float64), arrays[f"{n}.scales"].astype(np.int64))
            for n in _BASES
        )
        mean = arrays["mean"].astype(np.float64)
        residual, loose, plain, filmed = bases
        coding = Coding(
            stated, targets, residual, loose, mean, plain, filmed, language=voice.language
        )
    except KeyError as error:
        raise VoiceError(f"{path}: coding tables without {error.args[0]}") from error
    if stated != voice.identity or len(coding.mean) != len(voice.layout):
        raise VoiceError(f"{path}: coding tables of voice {stated}, not of {voice.identity}")
    return coding


_SPECTRUM = 1 / (1 + (np.arange(TICKS) / 2.0) ** 3)
"""Expected power of a residual by frequency, of cosines over a superframe."""

DOUBT = 2.0
"""Variance of each parameter that the basis of filmed motion adds to the known one: of 0.5, 1 and 2
the least rate on films of cuers that training has not seen."""

_HEAD_MM = 3.0
"""Displacement of the markers by an untrained voice's head, RMS."""

_UNEXPLAINED = 0.3
"""Share of the targets' variance that an untrained voice's resynthesis leaves over."""


def basis_of_any(
    metric: Array, covariance: Array, spectrum: Array = _SPECTRUM, *, doubt: float = DOUBT
) -> Basis:
    """Return the basis of motion that is known by its covariance only.

    Each parameter's variance is 1 in a voice's own motion; other cuers and cameras move the
    parameters in other proportions. The covariance counts `doubt` times less than not knowing.

    Parameters
    ----------
    metric, covariance : ndarray of float64, shape (P, P)
    spectrum : ndarray of float64, shape (32,)
        Power at each frequency of the transform, alike in all channels.
    doubt : float
        Variance of each parameter that is added.
    """
    wide = covariance + doubt * np.eye(len(covariance))
    matrix = klt(metric, wide)
    variance = np.einsum("pc,pq,qc->c", matrix, wide, matrix)
    variance *= np.trace(covariance) / np.trace(wide)
    return Basis(matrix, scales_of(np.outer(variance, spectrum / spectrum.mean())))


def derive_coding(voice: Voice) -> Coding:
    """Return tables of a voice without training: from its models and gesture table."""
    targets = Targets.of(voice)
    held = np.arange(len(targets.hand))
    poses = np.concatenate(
        [targets.face[held % len(targets.face)], targets.hand, targets.head, targets.forearm],
        axis=1,
    )
    metric = marker_metric(voice, poses)
    covariance = np.zeros_like(metric)
    begin = 0
    for group in (targets.face, targets.hand, targets.head, targets.forearm):
        block = slice(begin, begin + group.shape[1])
        covariance[block, block] = np.cov(group.T)
        begin = block.stop
    head = slice(begin - targets.forearm.shape[1] - targets.head.shape[1], begin)
    head = slice(head.start, head.start + targets.head.shape[1])
    size = max(float(np.trace(metric[head, head])), 1e-9)
    unit = np.eye(targets.head.shape[1]) * 113 * _HEAD_MM**2 / size
    bases = []
    # Karhunen-Loeve basis of each share of the targets' covariance, under the metric of the
    # markers. The head has a spread of its own.
    for share in (_UNEXPLAINED, 2 * _UNEXPLAINED, 1.0):
        spread = share * covariance
        spread[head, head] = unit
        matrix = klt(metric, spread)
        variance = np.einsum("pc,pq,qc->c", matrix, spread, matrix)
        bases.append(Basis(matrix, scales_of(np.outer(variance, _SPECTRUM / _SPECTRUM.mean()))))
    tight, loose, plain = bases
    filmed = basis_of_any(metric, covariance)
    return Coding(
        voice.identity, targets, tight, loose, poses.mean(axis=0), plain, filmed, trained=False,
        language=voice.language,
    )  # fmt: skip
