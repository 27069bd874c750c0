"""Reading a binary glTF 2.0 file: its JSON, its arrays and its pictures, with bounds.

A path comes in; a `Container` gives arrays by number of accessor. Nothing is allocated that the
file itself does not hold. Khronos, glTF 2.0 specification, sections 3.6 and 4.4. A library
(pygltflib, trimesh) would only parse the JSON or drop skins and morph targets, so none is used.
"""

import json
import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

FloatArray = NDArray[np.float64]

MAX_BYTES = 1 << 27
"""Bytes of a file at most."""

_MAX_NUMBERS = 1 << 24
"""Numbers of one array at most."""

_MAX_JSON_BYTES = 1 << 23
"""Bytes of the description at most: Python takes some tenfold memory for it."""

_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

_KNOWN_EXTENSIONS = {
    "KHR_materials_unlit", "KHR_texture_transform", "KHR_mesh_quantization", "VRM", "VRMC_vrm",
    "VRMC_materials_mtoon", "VRMC_springBone", "VRMC_node_constraint", "EXT_texture_webp",
    "KHR_materials_specular", "KHR_materials_ior", "KHR_materials_clearcoat", "KHR_materials_sheen",
    "KHR_materials_emissive_strength", "KHR_materials_transmission", "KHR_materials_volume",
}  # fmt: skip
"""Extensions that a file may require; the others, such as compression, change its data."""


@dataclass(frozen=True, slots=True)
class Container:
    """A glTF file in memory.

    Attributes
    ----------
    name : str
        Of the file, for messages.
    document : dict
        Its JSON.
    data : bytes
        Its binary chunk.
    """

    name: str
    document: dict[str, Any]
    data: bytes

    def items(self, kind: str) -> list[dict[str, Any]]:
        """Return the objects of a kind (``nodes``, ``meshes``), an empty list where there are none.

        Raises
        ------
        CueError
            If that is not a list of objects.
        """
        found = self.document.get(kind, [])
        if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
            raise CueError(f"{self.name}: {kind} is not a list of objects")
        return found

    def item(self, kind: str, number: Any) -> dict[str, Any]:
        """Return an object of a kind by its number."""
        found = self.items(kind)
        if not isinstance(number, int) or isinstance(number, bool):
            raise CueError(f"{self.name}: {kind} has no number {number!r}")
        if not 0 <= number < len(found):
            raise CueError(f"{self.name}: {kind} {number} of {len(found)}")
        return found[number]

    def array(self, number: Any) -> FloatArray:
        """Return the numbers of an accessor, shape (count, width); normalised ones as -1..1."""
        accessor = self.item("accessors", number)
        kind, width = self._type(accessor)
        count = _natural(accessor.get("count"), self.name, "count of an accessor")
        if count * width > _MAX_NUMBERS:
            raise CueError(f"{self.name}: array of {count * width} numbers, {_MAX_NUMBERS} at most")
        if "bufferView" in accessor:
            values = self._rows(accessor, kind, width, count).astype(np.float64)
        else:
            values = np.zeros((count, width))
        if "sparse" in accessor:
            self._replace(values, accessor["sparse"], kind)
        if accessor.get("normalized"):
            values = np.maximum(values / np.iinfo(kind).max, -1) if kind.kind in "iu" else values
        if not np.isfinite(values).all():
            raise CueError(f"{self.name}: array {number} holds numbers that are not finite")
        return values

    def view(self, number: Any) -> bytes:
        """Return the bytes of a buffer view."""
        view = self.item("bufferViews", number)
        if view.get("buffer") != 0:
            raise CueError(f"{self.name}: its data lie in another file; write it as one .glb")
        start = _natural(view.get("byteOffset", 0), self.name, "offset of a buffer view")
        length = _natural(view.get("byteLength"), self.name, "length of a buffer view")
        if start + length > len(self.data):
            raise CueError(
                f"{self.name}: buffer view {number} ends at byte {start + length} of "
                f"{len(self.data)}: cut off?"
            )
        return self.data[start : start + length]

    def _type(self, accessor: dict[str, Any]) -> tuple[np.dtype[Any], int]:
        try:
            return np.dtype(_KINDS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        except (KeyError, TypeError):
            raise CueError(f"{self.name}: accessor of an unknown type") from None

    def _rows(
        self, place: dict[str, Any], kind: np.dtype[Any], width: int, count: int
    ) -> NDArray[Any]:
        view = self.item("bufferViews", place["bufferView"])
        data = self.view(place["bufferView"])
        start = _natural(place.get("byteOffset", 0), self.name, "offset of an accessor")
        size = kind.itemsize * width
        stride = _natural(view.get("byteStride", size), self.name, "stride")
        if stride < size or (count and start + stride * (count - 1) + size > len(data)):
            raise CueError(f"{self.name}: an array of {count} rows reaches beyond its buffer view")
        if count == 0:
            return np.zeros((0, width), kind)
        rows = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, np.uint8, offset=start)[: stride * (count - 1) + size],
            (count, size),
            (stride, 1),
        )
        return np.ascontiguousarray(rows).view(kind)

    def _replace(self, values: FloatArray, sparse: Any, kind: np.dtype[Any]) -> None:
        if not isinstance(sparse, dict):
            raise CueError(f"{self.name}: sparse accessor is not an object")
        count = _natural(sparse.get("count"), self.name, "count of a sparse accessor")
        if count > len(values):
            raise CueError(f"{self.name}: sparse accessor replaces {count} of {len(values)} rows")
        of_rows, of_values = sparse.get("indices", {}), sparse.get("values", {})
        number_kind, _ = self._type({**of_rows, "type": "SCALAR"})
        numbers = self._rows(of_rows, number_kind, 1, count)[:, 0].astype(np.int64)
        if count and numbers.max() >= len(values):
            raise CueError(f"{self.name}: sparse accessor replaces row {numbers.max()}")
        values[numbers] = self._rows(of_values, kind, values.shape[1], count)


def _natural(value: Any, name: str, what: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 40:
        raise CueError(f"{name}: {what} is {value!r}")
    return value


def read_container(path: str | os.PathLike[str]) -> Container:
    """Read a .glb or .vrm file.

    Raises
    ------
    CueError
        If it is not one, is larger than `MAX_BYTES`, is cut off, or needs an extension that is
        not known here.
    """
    source = Path(path)
    try:
        size = source.stat().st_size
        if size > MAX_BYTES:
            raise CueError(f"{source.name}: {size} bytes, {MAX_BYTES} at most")
        data = source.read_bytes()
    except OSError as error:
        raise CueError(f"{path}: cannot be read: {error.strerror}") from error
    name = source.name
    if len(data) < 20 or data[:4] != b"glTF":
        raise CueError(f"{name}: not a binary glTF file (.glb, .vrm)")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise CueError(f"{name}: glTF {version}, only 2 is known")
    if length > len(data):
        raise CueError(f"{name}: {len(data)} of {length} bytes: cut off")
    chunks: dict[bytes, bytes] = {}
    at = 12
    # Chunks: length, kind, content. The first JSON and the first BIN count.
    while at + 8 <= length:
        long, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + long > length:
            raise CueError(f"{name}: chunk of {long} bytes at byte {at} reaches beyond the file")
        chunks.setdefault(kind, data[at + 8 : at + 8 + long])
        at += 8 + long
    text = chunks.get(b"JSON", b"")
    if len(text) > _MAX_JSON_BYTES:
        raise CueError(f"{name}: JSON of {len(text)} bytes, {_MAX_JSON_BYTES} at most")
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise CueError(f"{name}: its JSON is damaged: {error}") from error
    if not isinstance(document, dict):
        raise CueError(f"{name}: its JSON is not an object")
    needed = document.get("extensionsRequired", [])
    unknown = sorted(set(map(str, needed)) - _KNOWN_EXTENSIONS) if isinstance(needed, list) else []
    if unknown:
        raise CueError(f"{name}: needs {unknown[0]:.60}; export it without compression")
    return Container(name, document, chunks.get(b"BIN\0", b""))
