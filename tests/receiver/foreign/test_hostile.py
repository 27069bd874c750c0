"""Damaged and hostile files: one clear line, no other exception, little memory."""

import json
import struct
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.errors import CueError
from receiver.foreign.container import read_container
from receiver.foreign.paint import read_materials
from receiver.foreign.scene import read_scene
from tests.receiver.foreign.figure import container, figure

DATA = figure("arkit")
LENGTH = struct.unpack_from("<I", DATA, 12)[0]
DOCUMENT: dict[str, Any] = json.loads(DATA[20 : 20 + LENGTH])
BODY = DATA[28 + LENGTH :]


def read(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    file = read_container(path)
    read_scene(file)
    read_materials(file)


def changed(**items: Any) -> bytes:
    return container({**DOCUMENT, **items}, BODY)


def accessor(number: int, **items: Any) -> bytes:
    found = [dict(a) for a in DOCUMENT["accessors"]]
    found[number] |= items
    return changed(accessors=found)


POSITION = DOCUMENT["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
JOINTS = DOCUMENT["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a binary glTF file"),
        (b"glTF" + struct.pack("<II", 1, 20) + bytes(8), "glTF 1, only 2 is known"),
        (DATA[:-200], "cut off"),
        (container(DOCUMENT, BODY[:2000]), "cut off"),
        (changed(extensionsRequired=["KHR_draco_mesh_compression"]), "without compression"),
        (changed(nodes=[]), "has no bone hips"),
        (changed(meshes=[]), "meshes 0 of 0"),
        (changed(nodes=[{**n, "children": [0]} for n in DOCUMENT["nodes"]]), "hangs from two"),
        (changed(nodes="many"), "nodes is not a list"),
        (accessor(POSITION, count=1 << 30), "numbers, 16777216 at most"),
        (accessor(POSITION, count=100_000), "reaches beyond its buffer view"),
        (accessor(POSITION, count=-1), "count of an accessor is -1"),
        (accessor(POSITION, type="VEC2"), "columns, not 3"),
        (accessor(JOINTS, componentType=5121, byteOffset=5), "beyond|a vertex of joint"),
        (changed(materials=[{"pbrMetallicRoughness": {"baseColorFactor": "red"}}]), "is damaged"),
        (changed(textures=[{"source": 0}], images=[{"bufferView": 0}], materials=[
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]), "cannot be decoded"),
    ],
)  # fmt: skip
def test_damage_is_one_clear_line(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(CueError, match=message) as caught:
        read(tmp_path / "f.glb", data)
    assert "\n" not in str(caught.value)


def test_any_changed_field_is_an_error_or_a_figure(tmp_path: Path) -> None:
    rng = np.random.default_rng(34)
    values: list[Any] = [None, -1, 1 << 40, "x", [], {}, True, 1e308, [None], {"node": {}}]
    places = list(_leaves(DOCUMENT))
    for number in rng.permutation(len(places))[:36]:
        document = json.loads(json.dumps(DOCUMENT))
        at: Any = document
        *way, last = places[number]
        for step in way:
            at = at[step]
        at[last] = values[rng.integers(len(values))]
        try:
            read(tmp_path / "f.glb", container(document, BODY))
        except CueError:
            continue


def _leaves(value: Any, way: tuple[Any, ...] = ()) -> Any:
    if way:
        yield way
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(item, (*way, key))
    elif isinstance(value, list):
        for number, item in enumerate(value[:4]):
            yield from _leaves(item, (*way, number))


def test_memory_is_bounded_by_the_file(tmp_path: Path) -> None:
    """A thousand shapes of which each claims millions of numbers that the file does not hold."""
    mesh = json.loads(json.dumps(DOCUMENT["meshes"][0]))
    big = len(DOCUMENT["accessors"])
    mesh["primitives"][0]["targets"] = [{"POSITION": big}] * 1000
    mesh["extras"]["targetNames"] = [f"shape{i}" for i in range(500)] + ["jawOpen"] * 500
    accessors = [*DOCUMENT["accessors"], {"componentType": 5126, "type": "VEC3", "count": 5 << 20}]
    tracemalloc.start()
    with pytest.raises(CueError, match="morph target 500 has 5242880 vertices"):
        read(tmp_path / "f.glb", changed(meshes=[mesh], accessors=accessors))
    assert tracemalloc.get_traced_memory()[1] < 300e6
    tracemalloc.stop()
