"""Exports: what other programs would read equals what the television draws."""

import csv
import json
import struct
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import load_voice
from codec.errors import CueError, VoiceError
from receiver.drawing.avatar import load_avatar
from receiver.drawing.movement import express
from receiver.drawing.units import ARKIT_NAMES
from receiver.export.arkit import arkit_weights
from receiver.export.files import export_motion
from receiver.export.markers import marker_csv, trc
from tests.receiver.standin import make_motion, make_voice

VOICE = load_voice()
AVATAR = load_avatar(VOICE)
MOTION = make_motion(VOICE, duration_s=1.0, start_s=2.0)
MARKERS = VOICE.reconstruct(MOTION.params)


def test_trc_holds_the_markers() -> None:
    hidden = MARKERS.copy()
    hidden[3, 5] = np.nan
    lines = trc(hidden, 50.0, "cuer.trc").splitlines()
    assert lines[2].split("\t")[:4] == ["50", "50", "50", "113"]
    assert len(lines) == 6 + 50
    fields = lines[6 + 3].split("\t")
    assert fields[:2] == ["4", "0.060000"]
    assert fields[2 + 15 : 2 + 18] == ["", "", ""]
    assert float(fields[2]) == pytest.approx(float(MARKERS[3, 0, 0]), abs=1e-4)
    assert len(fields) == 2 + 339


def test_csv_holds_times_and_markers(tmp_path: Path) -> None:
    rows = list(csv.reader(marker_csv(MARKERS, MOTION.times_s).splitlines()))
    assert rows[0][:4] == ["time_s", "FH0.x", "FH0.y", "FH0.z"]
    found = np.array(rows[1:], dtype=float)
    assert np.allclose(found[:, 0], MOTION.times_s)
    assert np.allclose(found[:, 1:].reshape(MARKERS.shape), MARKERS, atol=1e-4)


def test_c3d_comes_back(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="the package ezc3d is not installed")
    export_motion(MOTION, VOICE, tmp_path / "cuer.c3d")
    file = ezc3d.c3d(str(tmp_path / "cuer.c3d"))
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    assert np.allclose(points, MARKERS, atol=1e-3)
    assert file["parameters"]["POINT"]["RATE"]["value"][0] == 50


class Glb:
    """A reader of binary glTF, enough to pose what it holds."""

    def __init__(self, data: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.document: dict[str, Any] = json.loads(data[20 : 20 + size])
        rest = 20 + size
        size, kind = struct.unpack_from("<I4s", data, rest)
        assert kind == b"BIN\0"
        assert rest + 8 + size == len(data)
        self.buffer = data[rest + 8 :]

    def array(self, number: int) -> NDArray[np.float64]:
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2", 5121: "u1"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        count = accessor["count"] * width
        assert view["byteOffset"] % 4 == 0
        values = np.frombuffer(self.buffer, kind, count, view["byteOffset"]).astype(float)
        return values.reshape(accessor["count"], width)

    def animated(self, node: int, path: str, frame: int) -> NDArray[np.float64]:
        animation = self.document["animations"][0]
        for channel in animation["channels"]:
            if channel["target"] == {"node": node, "path": path}:
                sampler = animation["samplers"][channel["sampler"]]
                frames = len(self.array(sampler["input"]))
                values: NDArray[np.float64] = self.array(sampler["output"])
                return np.asarray(values.reshape(frames, -1)[frame])
        raise AssertionError((node, path))

    def bent(self, node: int, frame: int) -> NDArray[np.float64]:
        primitive = self.document["meshes"][self.document["nodes"][node]["mesh"]]["primitives"][0]
        points = self.array(primitive["attributes"]["POSITION"])
        weights = self.animated(node, "weights", frame)
        for weight, target in zip(weights, primitive["targets"], strict=True):
            points = points + weight * self.array(target["POSITION"])
        return points


ARMS = ("clavicleRight", "upperArmRight", "lowerArmRight", "clavicleLeft")


def test_glb_moves_as_the_avatar_does(tmp_path: Path) -> None:
    export_motion(MOTION, VOICE, tmp_path / "cuer.glb")
    file = Glb((tmp_path / "cuer.glb").read_bytes())
    frame = 31
    added = express(VOICE, partial(sample_params, MOTION), MOTION.times_s[frame : frame + 1])
    expected = AVATAR.place(MOTION.params[frame : frame + 1], added)[0]
    n = len(AVATAR.head.sources)
    names = [node["name"] for node in file.document["nodes"]]
    at = {name: names.index(name) for name in ("head", "hand")}
    skin = file.document["skins"][0]
    binds = file.array(skin["inverseBindMatrices"])
    attributes = file.document["meshes"][0]["primitives"][0]["attributes"]
    weights, joints = (file.array(attributes[name]) for name in ("WEIGHTS_0", "JOINTS_0"))
    assert np.allclose(weights.sum(axis=1), 1)
    assert weights.min() >= 0
    for mesh in file.document["meshes"]:
        normals = file.array(mesh["primitives"][0]["attributes"]["NORMAL"])
        assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-3)
    points = file.bent(at["head"], frame)
    head = np.zeros_like(points)
    for number, (node, bind) in enumerate(zip(skin["joints"], binds, strict=True)):
        turn = Rotation.from_quat(file.animated(node, "rotation", frame)).as_matrix()
        into = bind.reshape(4, 4).T
        bound = points @ into[:3, :3].T + into[:3, 3]
        if file.document["nodes"][node]["name"] in ARMS:
            bound = bound * file.animated(node, "scale", frame)
        turned = bound @ turn.T
        turned += file.animated(node, "translation", frame)
        head += np.where(joints == number, weights, 0).sum(axis=1)[:, None] * turned
    error = np.linalg.norm(head - expected[:n], axis=1)
    assert error[AVATAR.head_weights[:, 0] > 0.999].max() < 0.05
    # Measured 0.55 mm: the sleeve's thickness turns with the elbow in the file only.
    assert error.max() < 0.7
    turn = Rotation.from_quat(file.animated(at["hand"], "rotation", frame)).as_matrix()
    hand = file.bent(at["hand"], frame) @ turn.T
    hand += file.animated(at["hand"], "translation", frame)
    assert np.abs(hand - expected[n:]).max() < 0.05


def test_arkit_weights_of_known_units() -> None:
    """A face made of two units gives these two units back."""
    weights = {"jawOpen": 0.3, "mouthPucker": 0.4}
    moved = sum(w * AVATAR.units[AVATAR.unit_names.index(name)] for name, w in weights.items())
    params = np.zeros((1, len(VOICE.layout)))
    target = np.asarray(AVATAR.unit_rest + moved)
    flat = VOICE.face.directions.reshape(7, -1).astype(float)
    difference = (target - VOICE.face.mean).ravel()
    params[:, :7] = np.linalg.lstsq(flat.T, difference, rcond=None)[0]
    motion = Motion(params.astype(np.float32), 50.0, 0.0, VOICE.layout, VOICE.identity)
    found = dict(zip(ARKIT_NAMES, arkit_weights(motion, AVATAR)[0], strict=True))
    assert found["jawOpen"] == pytest.approx(0.3, abs=0.1)
    assert found["mouthPucker"] + found["mouthFunnel"] > 0.2
    assert max(found.values()) < 0.75


def test_arkit_weights_are_alike_on_both_sides() -> None:
    """A mouth that moves a little to one side does not pull one corner far."""
    weights = arkit_weights(MOTION, AVATAR)
    assert weights.min() >= 0
    assert weights.max() <= 1
    for name in ("mouthSmile", "mouthDimple", "mouthStretch", "mouthPress"):
        left, right = (weights[:, ARKIT_NAMES.index(f"{name}{side}")] for side in ("Left", "Right"))
        assert np.abs(left - right).mean() < 0.15


def test_arkit_table_has_live_link_s_columns(tmp_path: Path) -> None:
    export_motion(MOTION, VOICE, tmp_path / "cuer.arkit.csv")
    rows = list(csv.reader((tmp_path / "cuer.arkit.csv").read_text().splitlines()))
    assert len(rows[0]) == 2 + 61
    assert rows[0][:4] == ["Timecode", "BlendShapeCount", "EyeBlinkLeft", "EyeLookDownLeft"]
    assert rows[1][:2] == ["00:00:02:00.000", "61"]
    values = np.array([row[2:54] for row in rows[1:]], dtype=float)
    assert values.shape == (50, 52)
    assert (values >= 0).all()
    assert (values <= 1).all()


def test_unusable_exports(tmp_path: Path) -> None:
    with pytest.raises(CueError, match=r"cuer.bvh: exports end in .c3d, .trc, .csv, .glb"):
        export_motion(MOTION, VOICE, tmp_path / "cuer.bvh")
    with pytest.raises(VoiceError, match="motion was made with voice"):
        export_motion(MOTION, make_voice(), tmp_path / "cuer.csv")
    voice = make_voice()
    with pytest.raises(CueError, match="has no avatar"):
        export_motion(make_motion(voice, 1.0), voice, tmp_path / "cuer.glb")
    assert list(tmp_path.iterdir()) == []
