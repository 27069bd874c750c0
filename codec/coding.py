"""The coding tables of a voice: targets of resynthesis, bases of the residual.

They are trained on motions of the voice (`codec.train`) and stored under its identity; those of
a voice that nobody has trained are derived from its models and gesture table, less efficient but
complete. Both ends of a stream need the same tables. Specification: spec/bitstream.md, section 6.
"""

import functools
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import VoiceError
from codec.npz import read_arrays, write_arrays
from codec.resynthesis.targets import Targets
from codec.timeline import TICKS
from codec.transform import Bases, Basis, klt, marker_metric, scales_of
from codec.voice import Voice

Array = NDArray[np.float64]

FOLDER = Path(__file__).parent / "assets" / "coding"
_MAX_BYTES = 1 << 20
_WIDER = 10
"""Quarter octaves by which the second basis of motion without a score expects more."""

_TARGETS = ("hand", "head", "forearm", "arc", "face")


@dataclass(frozen=True, slots=True)
class Coding:
    """Tables by which motions of one voice are coded.

    Attributes
    ----------
    voice : str
        Identity of the voice.
    targets : Targets
        Of the resynthesis.
    residual : Basis
        Of what the resynthesis lacks.
    loose : Basis
        The same for a cuer who does not keep to the score's times.
    mean : ndarray of float64, shape (P,)
        Parameters that stand for a motion without a score.
    plain : Basis
        Of motion about that mean.
    """

    voice: str
    targets: Targets
    residual: Basis
    loose: Basis
    mean: Array
    plain: Basis
    of_score: Bases = field(init=False)
    of_motion: Bases = field(init=False)

    def __post_init__(self) -> None:
        wide = Basis(self.plain.matrix, self.plain.scales + _WIDER)
        object.__setattr__(self, "of_score", (self.residual, self.loose))
        object.__setattr__(self, "of_motion", (self.plain, wide))


def coding_for(voice: Voice) -> Coding:
    """Return the tables of a voice: the trained ones if there are any."""
    return _cached(_ByIdentity(voice))


@dataclass(frozen=True)
class _ByIdentity:
    """A voice that compares by its identity, as the key of a cache."""

    voice: Voice

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByIdentity) and other.voice.identity == self.voice.identity

    def __hash__(self) -> int:
        return hash(self.voice.identity)


@functools.lru_cache(maxsize=8)
def _cached(key: _ByIdentity) -> Coding:
    if is_trained(key.voice):
        return load_coding(_path(key.voice), key.voice)
    return derive_coding(key.voice)


def is_trained(voice: Voice) -> bool:
    """Return whether the package has coding tables that were trained for a voice."""
    return _path(voice).exists()


def _path(voice: Voice) -> Path:
    return FOLDER / f"{voice.identity}.npz"


def save_coding(coding: Coding, path: str | os.PathLike[str]) -> None:
    """Write tables as float32 and int16 arrays."""
    arrays: dict[str, NDArray[np.generic]] = {
        f"targets.{name}": getattr(coding.targets, name).astype(np.float32) for name in _TARGETS
    }
    for name, basis in (
        ("residual", coding.residual),
        ("loose", coding.loose),
        ("plain", coding.plain),
    ):
        arrays[f"{name}.matrix"] = basis.matrix.astype(np.float32)
        arrays[f"{name}.scales"] = basis.scales.astype(np.int16)
    arrays["mean"] = coding.mean.astype(np.float32)
    arrays["voice"] = np.array(coding.voice, dtype=np.str_)
    write_arrays(path, arrays)


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
        targets = Targets(**{name: arrays[f"targets.{name}"] for name in _TARGETS})
        residual, loose, plain = (
            Basis(arrays[f"{n}.matrix"].astype(np.float64), arrays[f"{n}.scales"].astype(np.int64))
            for n in ("residual", "loose", "plain")
        )
        mean = arrays["mean"].astype(np.float64)
        coding = Coding(stated, targets, residual, loose, mean, plain)
    except KeyError as error:
        raise VoiceError(f"{path}: coding tables without {error.args[0]}") from error
    if stated != voice.identity or len(coding.mean) != len(voice.layout):
        raise VoiceError(f"{path}: coding tables of voice {stated}, not of {voice.identity}")
    return coding


_SPECTRUM = 1 / (1 + (np.arange(TICKS) / 2.0) ** 3)
_HEAD_MM = 3.0
"""Displacement of the markers by an untrained voice's head, RMS."""

_UNEXPLAINED = 0.3
"""Share of the targets' variance that an untrained voice's resynthesis leaves over."""


def derive_coding(voice: Voice) -> Coding:
    """Return tables of a voice without training: from its models and gesture table."""
    targets = Targets.of(voice.gestures)
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
    for share in (_UNEXPLAINED, 2 * _UNEXPLAINED, 1.0):
        spread = share * covariance
        spread[head, head] = unit
        matrix = klt(metric, spread)
        variance = np.einsum("pc,pq,qc->c", matrix, spread, matrix)
        bases.append(Basis(matrix, scales_of(np.outer(variance, _SPECTRUM / _SPECTRUM.mean()))))
    tight, loose, plain = bases
    return Coding(voice.identity, targets, tight, loose, poses.mean(axis=0), plain)
