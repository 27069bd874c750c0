"""Reading the base mesh and placing points on it, on a mesh of one square."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.errors import CueError
from lab.body import vertex_normals
from synth.motion.body.mesh import read_mesh
from synth.motion.body.placing import sample_skin
from synth.motion.body.skin import stretch

OBJ = """# a square and the cube of a joint
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 4 4 4
v 6 4 4
g body
f 1/1 2/2 3/3 4/4
g joint-a
f 5 6 6
"""


def write_mesh(folder: Path, **changes: Any) -> None:
    rig = {
        "a": {
            "head": {"strategy": "CUBE", "cube_name": "joint-a", "default_position": [9, 9, 9]},
            "tail": {"strategy": "MEAN", "vertex_indices": [0, 2]},
        },
        "b": {
            "head": {"strategy": "VERTEX", "vertex_index": 1},
            "tail": changes.get("tail", {"strategy": "VERTEX", "vertex_index": 3}),
        },
    }
    (folder / "faceunits").mkdir(exist_ok=True)
    (folder / "base.obj").write_text(changes.get("obj", OBJ))
    (folder / "rig.default.json").write_text(json.dumps(rig))
    weights = {"weights": {"a": [[0, 1.0], [2, 0.25]]}}
    (folder / "weights.default.json").write_text(json.dumps(weights))
    (folder / "faceunits" / "jawOpen.target").write_text("# a comment\n2 0 -.5 .1\n")


def test_a_mesh_is_read_in_millimetres(tmp_path: Path) -> None:
    write_mesh(tmp_path)
    mesh = read_mesh(tmp_path)
    np.testing.assert_allclose(mesh.vertices[2], [100.0, 100.0, 0.0])
    assert mesh.faces.tolist() == [[0, 1, 2, 3]]
    np.testing.assert_allclose(mesh.units["jawOpen"][2], [0.0, -50.0, 10.0])
    assert mesh.weights["a"].tolist() == [1.0, 0.0, 0.25, 0.0, 0.0, 0.0]


def test_joints_come_from_the_strategy_not_from_the_default(tmp_path: Path) -> None:
    write_mesh(tmp_path)
    joints = read_mesh(tmp_path).joints
    np.testing.assert_allclose(joints["a"][0], [500.0, 400.0, 400.0])
    np.testing.assert_allclose(joints["a"][1], [50.0, 50.0, 0.0])
    np.testing.assert_allclose(joints["b"][0], [100.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "changes",
    [
        {"tail": {"strategy": "ELSEWHERE"}},
        {"tail": {"strategy": "CUBE", "cube_name": "none"}},
        {"obj": "v 0 0\nv x y z\n"},
    ],
)
def test_malformed_meshes_are_refused(tmp_path: Path, changes: dict[str, Any]) -> None:
    write_mesh(tmp_path, **changes)
    with pytest.raises(CueError, match="not the hm08 mesh"):
        read_mesh(tmp_path)


def test_points_of_the_skin_lie_on_it_and_include_the_corners(tmp_path: Path) -> None:
    write_mesh(tmp_path)
    mesh = read_mesh(tmp_path)
    points = sample_skin(mesh).of(mesh.vertices)
    assert (points[:, 2] == 0).all()
    assert points.min() == 0.0
    assert points.max() == 100.0
    corners = mesh.vertices[:4, :2].tolist()
    assert all(corner in points[:, :2].tolist() for corner in corners)


def test_normals_stand_on_the_skin(tmp_path: Path) -> None:
    write_mesh(tmp_path)
    np.testing.assert_allclose(vertex_normals(read_mesh(tmp_path))[:4], [[0.0, 0.0, 1.0]] * 4)


def test_stretching_a_chain_moves_its_children_along() -> None:
    origins = np.array([[0.0, 0.0, 0.0], [0.0, 10.0, 0.0]])
    frames = np.tile(np.eye(3), (2, 1, 1))
    factors = np.array([[1.0, 2.0, 1.0], [1.0, 1.0, 3.0]])
    points, joints = stretch(
        np.array([[0.0, 5.0, 1.0], [1.0, 12.0, 1.0]]), np.eye(2), frames, origins, [-1, 0], factors
    )
    np.testing.assert_allclose(joints, [[0.0, 0.0, 0.0], [0.0, 20.0, 0.0]])
    np.testing.assert_allclose(points, [[0.0, 10.0, 1.0], [1.0, 22.0, 3.0]])
