"""Section 6.5 of spec/bitstream.md: the identity of a coding, from its files alone."""

import ast
import hashlib
import zipfile
from pathlib import Path

ARRAYS = (
    "targets.hand", "targets.head", "targets.forearm", "targets.arc", "targets.face",
    "targets.places", "targets.late", "targets.movement",
    "residual.matrix", "residual.scales", "loose.matrix", "loose.scales", "plain.matrix",
    "plain.scales", "filmed.matrix", "filmed.scales", "mean",
)  # fmt: skip
"""Table 4."""

HEAD = 10
"""Bytes of a file of one array (NPY 1.0) before its description: magic, version, its length."""


def identity(tables: Path, coding: Path, voice: str) -> str:
    """(I1) Return the identity of trained tables.

    `tables` is the file of the format's tables, `coding` that of the voice's, an archive of arrays.
    """
    digest = hashlib.sha256(b"cuecast-coding-2" + voice.encode("ascii"))
    digest.update(hashlib.sha256(tables.read_bytes()).digest())
    with zipfile.ZipFile(coding) as archive:
        for name in ARRAYS:
            data = archive.read(f"{name}.npy")
            end = HEAD + int.from_bytes(data[8:HEAD], "little")
            described = ast.literal_eval(data[HEAD:end].decode("ascii"))
            assert described["descr"] == ("<i2" if name.endswith("scales") else "<f4")
            assert not described["fortran_order"]
            digest.update(f"{name}{described['shape']}".encode("ascii") + data[end:])
    return digest.hexdigest()[:16]
