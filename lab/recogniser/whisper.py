"""The ear of `synth.planning.alignment.recogniser` from the weights of Whisper base.

Read is the file `model.bin` of CTranslate2, in which the weights are distributed for
faster-whisper: version, name of the model, revision, then arrays with name, dimensions, type and
bytes. Kept are the two convolutions and the lower blocks of the encoder, each row of a matrix in
whole numbers with a scale of its own. Weights: OpenAI, MIT licence.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from synth.planning.alignment.recogniser import BLOCKS

LEVELS = 31
"""Whole numbers on either side of 0 that a weight may be."""

_TYPES = {0: "<f4", 1: "i1", 2: "<i2", 3: "<i4", 4: "<f2"}
"""Types of CTranslate2's arrays."""

_VERSION = 6
"""Version of the container that is read."""

_BLOCK = {
    "self_attention/layer_norm": "attention",
    "self_attention/linear_0": "attention.in",
    "self_attention/linear_1": "attention.out",
    "ffn/layer_norm": "feed",
    "ffn/linear_0": "feed.in",
    "ffn/linear_1": "feed.out",
}
"""Parts of a block: Whisper's names and ours."""

_PART = {"weight": "weight", "bias": "bias", "gamma": "gain", "beta": "shift"}


def read_weights(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of a CTranslate2 file by name.

    Raises
    ------
    CueError
        If the file is of another version or cut short.
    """
    data = path.read_bytes()
    place = 0

    def number(form: str) -> int:
        nonlocal place
        (value,) = struct.unpack_from(f"<{form}", data, place)
        place += struct.calcsize(form)
        return int(value)

    def name() -> str:
        nonlocal place
        length = number("H")
        place += length
        return data[place - length : place - 1].decode()

    try:
        if number("I") != _VERSION:
            raise CueError(f"{path}: not a CTranslate2 file of version {_VERSION}")
        name(), number("I")
        arrays = {}
        for _ in range(number("I")):
            key, rank = name(), number("B")
            shape = [number("I") for _ in range(rank)]
            kind, size = np.dtype(_TYPES[number("B")]), number("I")
            flat = np.frombuffer(data, kind, count=size // kind.itemsize, offset=place)
            arrays[key] = flat.reshape(shape)
            place += size
    except (struct.error, ValueError, KeyError, UnicodeDecodeError) as error:
        raise CueError(f"{path}: damaged: {error}") from error
    return arrays


def ear_of(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the arrays of the ear: matrices in whole numbers, the rest in half precision."""
    ear: dict[str, NDArray[Any]] = {}
    for number in (1, 2):
        weights = arrays[f"encoder/conv{number}/weight"]
        ear |= _packed(f"conv{number}.weight", weights.transpose(0, 2, 1).reshape(len(weights), -1))
        ear[f"conv{number}.bias"] = arrays[f"encoder/conv{number}/bias"].astype(np.float16)
    for block in range(BLOCKS):
        for theirs, ours in _BLOCK.items():
            for part, name in _PART.items():
                found = arrays.get(f"encoder/layer_{block}/{theirs}/{part}")
                if found is None:
                    continue
                key = f"{block}.{ours}.{name}"
                ear |= _packed(key, found) if found.ndim > 1 else {key: found.astype(np.float16)}
    return ear


def _packed(name: str, weights: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return a matrix in whole numbers and the scale of each row."""
    exact = weights.astype(np.float64)
    scale = np.abs(exact).max(axis=1) / LEVELS
    whole = np.round(exact / (scale[:, None] + 1e-12)).astype(np.int8)
    return {name: whole, f"{name}.scale": scale.astype(np.float32)}
