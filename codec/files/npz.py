"""Reading and writing ``.npz`` files that may come from anywhere: no pickle, bounded memory.

Every array's header is read before its data, so that a file cannot make its reader allocate more
than the caller allows; writing goes through a temporary name in the same folder.
"""

import io
import math
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from codec.errors import CueError
from codec.files.whole import whole_file

_HEADERS = {(1, 0): (npy.read_array_header_1_0, "<H"), (2, 0): (npy.read_array_header_2_0, "<I")}
"""Per version of an array's header: what reads it, and how it begins with its own length."""

_ZIP = b"PK"
"""How an archive begins (PKWARE's APPNOTE, 4.3.7)."""

_MOST_HEADER_BYTES = 65_535
"""Bytes of an array's header at most, as in version 1; those of version 2 count to 4 GB."""

_MOST_ITEMS = 1 << 40
"""Numbers of one array at most, also of those that take no memory (strings of no letters)."""


@dataclass(frozen=True, slots=True)
class Parts:
    """An array that never is in memory as a whole.

    Attributes
    ----------
    dtype : numpy.dtype
    shape : tuple of int
    chunks : iterable of bytes
        Its content in C order; together as long as dtype and shape say.
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    chunks: Iterable[bytes]


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any] | Parts]) -> None:
    """Write named arrays, compressed, with fixed time stamps: same arrays, same bytes.

    Parameters
    ----------
    path : path-like
        Replaced only when the new file is complete.
    arrays : mapping of str to ndarray or Parts
        Arrays of numbers, booleans or strings.

    Raises
    ------
    CueError
        If the chunks of an array do not add up to it, or the file cannot be written.
    """
    with (
        whole_file(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for key, array in arrays.items():
            member = zipfile.ZipInfo(f"{key}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(member, "w", force_zip64=True) as stream:
                if isinstance(array, Parts):
                    _write_parts(stream, key, array)
                else:
                    npy.write_array(stream, np.asarray(array), allow_pickle=False)


def _write_parts(stream: Any, key: str, array: Parts) -> None:
    descr = npy.dtype_to_descr(array.dtype)
    header = {"descr": descr, "fortran_order": False, "shape": array.shape}
    npy.write_array_header_1_0(stream, header)
    written = 0
    for chunk in array.chunks:
        stream.write(chunk)
        written += len(chunk)
    expected = array.dtype.itemsize * int(np.prod(array.shape, dtype=np.int64))
    if written != expected:
        raise CueError(f"array {key}: {written} bytes in its chunks, not {expected}")


def read_arrays(path: str | os.PathLike[str], *, max_bytes: int) -> dict[str, NDArray[Any]]:
    """Read all arrays of a ``.npz`` file.

    Parameters
    ----------
    path : path-like
    max_bytes : int
        Most memory that the arrays may take together.

    Raises
    ------
    CueError
        If the file is missing, damaged, holds objects, or declares more than `max_bytes`.

    Examples
    --------
    >>> read_arrays("missing.npz", max_bytes=1000)
    Traceback (most recent call last):
    codec.errors.CueError: missing.npz: No such file or directory
    """
    arrays: dict[str, NDArray[Any]] = {}
    total = 0
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise ValueError(f"array {member.filename} is packed in an unknown way")
                # Check the declared size before unpacking: a small file may declare terabytes.
                total += _declared_bytes(archive, member)
                if total > max_bytes:
                    raise CueError(f"{path}: arrays take {total} bytes, more than {max_bytes}")
                with archive.open(member) as stream:
                    array = npy.read_array(stream, allow_pickle=False)
                arrays[member.filename.removesuffix(".npy")] = array
    except OSError as error:
        raise CueError(f"{path}: {error.strerror or error}") from error
    except (
        ValueError, TypeError, EOFError, KeyError, NotImplementedError, RuntimeError, SyntaxError,
        OverflowError, struct.error, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        if isinstance(error, zipfile.BadZipFile) and (head := _beginning(path)) != _ZIP:
            reason = f"an npz archive begins with {_ZIP!r}, this with {head!r}"
        raise CueError(f"{path}: damaged or foreign file: {reason}") from error
    return arrays


def _beginning(path: str | os.PathLike[str]) -> bytes:
    with open(path, "rb") as file:
        return file.read(len(_ZIP))


def _declared_bytes(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> int:
    """Return the size of an array as its header declares it."""
    with archive.open(member) as stream:
        version = npy.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"array {member.filename} has an unknown header version")
        read_header, prefix = _HEADERS[version]
        begin = stream.read(struct.calcsize(prefix))
        (length,) = struct.unpack(prefix, begin)
        if length > _MOST_HEADER_BYTES:
            raise ValueError(f"array {member.filename} has a header of {length} bytes")
        shape, _, dtype = read_header(io.BytesIO(begin + stream.read(length)))
    if any(not 0 <= size <= _MOST_ITEMS for size in shape):
        raise ValueError(f"array {member.filename} has shape {shape}")
    return max(dtype.itemsize, 1) * max(math.prod(shape), 1)
