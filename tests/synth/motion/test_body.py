"""The virtual cuer's body: skeleton, skin, hand shapes and placements."""

from pathlib import Path

import numpy as np
import pytest

from codec.cuer.layout import FOREARM, MARKER_NUMBER, MARKERS, longest_finger_tip, marker_indices
from codec.cues.score import PLACEMENTS
from codec.errors import CueError
from codec.files.npz import read_arrays
from synth.motion.body.anatomy import IDENTITIES, identity
from synth.motion.body.body import Body, BodyPose, load_asset, load_body
from synth.motion.body.mesh import read_mesh
from synth.motion.body.reach import REAL_MM, key_poses, placement_target
from synth.motion.body.shapes import all_shapes, shape_angles
from synth.motion.body.skeleton import ANGLE_NUMBER, ARM_BONES, HAND_ANGLES, rotation

MESH = Path(__file__).parents[4] / "shared" / "data" / "hm08"
BODIES = pytest.mark.parametrize("name", sorted(IDENTITIES))


def still_pose(body: Body, angles: np.ndarray, forearm: np.ndarray | None = None) -> BodyPose:
    n = len(angles)
    arm = np.zeros((n, 6)) if forearm is None else forearm
    return BodyPose(np.zeros((n, len(body.unit_names))), np.zeros((n, 6)), angles, arm)


def distance(markers: np.ndarray, first: str, second: str) -> np.ndarray:
    a, b = MARKER_NUMBER[first], MARKER_NUMBER[second]
    return np.asarray(np.linalg.norm(markers[:, a] - markers[:, b], axis=-1))


@pytest.fixture(scope="module")
def shapes() -> np.ndarray:
    body = load_body()
    return body.markers(still_pose(body, all_shapes()))


@BODIES
def test_skin_in_its_rest_pose_is_the_rest_skin(name: str) -> None:
    body = load_body(name)
    for skin in (body.face_skin, body.hand_skin):
        posed = skin.place(skin.frames[None], skin.origins[None])
        np.testing.assert_allclose(posed[0], skin.rest, atol=1e-9)


@BODIES
def test_weights_sum_to_one(name: str) -> None:
    body = load_body(name)
    for skin in (body.face_skin, body.hand_skin):
        np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0, atol=1e-6)


@BODIES
def test_phalanges_have_the_lengths_of_the_anatomy(name: str) -> None:
    body = load_body(name)
    for finger in range(2, 6):
        first, second = (ARM_BONES.index(f"finger{finger}-{p}") for p in (1, 2))
        length = np.linalg.norm(body.arm.origins[second] - body.arm.origins[first])
        part = body.anatomy.phalanges[f"finger{finger}"][0]
        assert part is not None
        assert length == pytest.approx(part * body.anatomy.hand_length_mm, rel=0.01)


@pytest.mark.parametrize("finger", [2, 3, 4, 5])
def test_bending_one_finger_moves_that_finger_only(finger: int) -> None:
    body = load_body()
    angles = np.zeros((2, len(HAND_ANGLES)))
    stem = ("index", "middle", "ring", "little")[finger - 2]
    angles[1, ANGLE_NUMBER[f"{stem}_mcp"]] = 30.0
    markers = body.markers(still_pose(body, angles))
    moved = np.linalg.norm(markers[1] - markers[0], axis=1)
    tip = MARKER_NUMBER[f"F{finger}T"]
    others = [f"F{f}{p}" for f in range(1, 6) if f != finger for p in "23T"]
    assert moved[tip] > 30.0
    assert moved[marker_indices([*others, *FOREARM])].max() < 1.5


def test_flexion_brings_the_tip_to_the_palm_side() -> None:
    body = load_body()
    angles = np.zeros((2, len(HAND_ANGLES)))
    angles[1, ANGLE_NUMBER["middle_mcp"]] = 60.0
    markers = body.markers(still_pose(body, angles))
    hand = body.arm_bones(angles, np.zeros((2, 6)))[0][0, 2]
    step = (markers[1] - markers[0])[MARKER_NUMBER["F3T"]] @ hand
    assert step[2] < -40.0


def test_shapes_differ_as_the_paper_tells_them_apart(shapes: np.ndarray) -> None:
    tips = distance(shapes, "F2T", "F3T")
    thumb = distance(shapes, "F1T", "P5")
    assert tips[8] > tips[2] + 20.0
    assert thumb[6] > thumb[1] + 25.0
    assert thumb[7] > thumb[2] + 25.0


@pytest.mark.parametrize(
    ("shape", "out"), [(0, ""), (1, "2"), (2, "23"), (3, "345"), (4, "2345"), (5, "2345"),
                       (6, "2"), (7, "23"), (8, "23")],
)  # fmt: skip
def test_the_right_fingers_are_out(shapes: np.ndarray, shape: int, out: str) -> None:
    for finger in "2345":
        reach = distance(shapes, f"F{finger}1", f"F{finger}T")[shape]
        open_reach = distance(shapes, f"F{finger}1", f"F{finger}T")[5]
        assert (reach > 0.9 * open_reach) == (finger in out)


@BODIES
def test_every_shape_reaches_every_placement(name: str) -> None:
    body = load_body(name)
    reach = load_asset(f"reach_{name}")
    for shape in range(9):
        angles = np.tile(shape_angles(shape), (len(PLACEMENTS), 1))
        angles[:, :3] = reach["wrist"][shape]
        markers = body.markers(still_pose(body, angles, reach["forearm"][shape]))
        tip = markers[:, MARKER_NUMBER[longest_finger_tip(shape)]]
        targets = np.array([placement_target(body, p) for p in PLACEMENTS])
        np.testing.assert_allclose(tip, targets, atol=1e-3)


@BODIES
def test_tips_at_the_face_are_before_the_skin(name: str) -> None:
    body = load_body(name)
    touched = {"mouth": "LC_R", "chin": "CH0", "cheek": "CK2_R", "throat": "TH5_C"}
    for placement, marker in touched.items():
        skin = body.face_skin.rest[MARKER_NUMBER[marker]]
        gap = placement_target(body, placement)[2] - skin[2]
        assert 3.0 < gap < 25.0, placement


@BODIES
def test_placements_are_where_real_cuers_point(name: str) -> None:
    body = load_body(name)
    rest = body.face_skin.rest
    mouth = 0.5 * (rest[MARKER_NUMBER["LC_R"]] + rest[MARKER_NUMBER["LC_L"]])
    for placement, real in REAL_MM.items():
        away = (placement_target(body, placement) - mouth)[:2] - real
        assert np.linalg.norm(away) < 10.0, placement


@BODIES
def test_the_hand_is_flat_to_the_viewer_at_every_placement(name: str) -> None:
    """The back of the hand looks at the viewer, and its turn changes little between keys."""
    body, reach = load_body(name), load_asset(f"reach_{name}")
    shape, placement = (grid.ravel() for grid in np.mgrid[1:9, 1 : len(PLACEMENTS)])
    angles, forearm = key_poses(reach["wrist"], reach["forearm"], shape, placement)
    dorsal = body.arm_bones(angles, forearm)[0][:, 2, :, 2]
    assert np.degrees(np.arccos(dorsal[:, 2])).max() < 22.0
    assert np.degrees(np.arccos((dorsal @ dorsal.T).min())) < 12.0


def test_arm_stays_short_of_the_anatomically_impossible() -> None:
    reach = load_asset("reach_claire")
    flexion, deviation, twist = np.abs(reach["wrist"]).max(axis=(0, 1))
    assert flexion < 60.0
    assert deviation < 20.0
    assert twist < 60.0
    body = load_body()
    forearm_mm = np.linalg.norm(body.arm.origins[2] - body.arm.origins[0])
    cueing = np.concatenate([reach["forearm"][0, :1], reach["forearm"][1:, 1:].reshape(-1, 6)])
    turns, _ = body.arm_bones(np.zeros((len(cueing), len(HAND_ANGLES))), cueing)
    elbow = cueing[:, 3:] - forearm_mm * turns[:, 1, :, 1]
    upper_arm = np.linalg.norm(elbow - body.landmarks["shoulder"], axis=1)
    assert np.abs(upper_arm - body.anatomy.upper_arm_mm).max() < 40.0


def test_throat_follows_the_head_partly() -> None:
    body = load_body()
    head = np.zeros((2, 6))
    head[1, 1] = np.radians(12.0)
    markers = body.face(np.zeros((2, len(body.unit_names))), head)
    moved = np.linalg.norm(markers[1] - markers[0], axis=1)
    chin, top, bottom = (moved[MARKER_NUMBER[name]] for name in ("CH0", "TH1_C", "TH5_C"))
    assert bottom < 0.25 * top < 0.7 * chin


def test_rigid_markers_keep_their_distances_when_the_head_turns() -> None:
    body = load_body()
    head = np.random.default_rng(1).normal(scale=[0.1] * 3 + [5.0] * 3, size=(8, 6))
    markers = body.face(np.zeros((8, len(body.unit_names))), head)
    assert np.ptp(distance(markers, "EAR_R", "EAR_L")) < 0.01
    assert np.ptp(distance(markers, "FH0", "NB")) < 0.01


def test_rotation_is_right_handed() -> None:
    assert rotation(0, np.array(90.0))[2, 1] == pytest.approx(1.0)


def test_unknown_cuer_is_refused() -> None:
    with pytest.raises(CueError, match="unknown cuer 'nobody'; known: claire, agathe"):
        identity("nobody")


def test_pose_of_unequal_lengths_is_refused() -> None:
    zeros = np.zeros((2, 6))
    with pytest.raises(CueError, match=r"the parts of a pose have \[2, 3\] frames"):
        BodyPose(np.zeros((3, 5)), zeros, np.zeros((2, 31)), zeros)


def test_a_folder_without_mesh_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="not the hm08 mesh"):
        read_mesh(tmp_path)


@pytest.mark.skipif(not MESH.is_dir(), reason="needs the hm08 mesh in ../shared/data")
@pytest.mark.slow
def test_the_asset_is_what_the_mesh_gives(tmp_path: Path) -> None:
    from lab.body import main

    assert main(["--mesh", str(MESH), "--out", str(tmp_path)]) == 0
    asset = Path(__file__).parents[3] / "synth" / "assets" / "hm08_markers.npz"
    made, kept = (read_arrays(p, max_bytes=1 << 26) for p in (tmp_path / asset.name, asset))
    assert made.keys() == kept.keys()  # archives differ in their headers between versions of Python
    for name, array in kept.items():
        np.testing.assert_array_equal(made[name], array, err_msg=name, strict=True)


def test_markers_come_in_the_layout_order() -> None:
    body = load_body()
    markers = body.markers(still_pose(body, all_shapes()))
    assert markers.shape == (9, len(MARKERS), 3)
    assert (markers[:, MARKER_NUMBER["EAR_R"], 0] < 0).all()
    assert (markers[:, MARKER_NUMBER["NB"], 2] > markers[:, MARKER_NUMBER["EAR_R"], 2]).all()


@BODIES
def test_skin_slides_by_what_markers_do(name: str) -> None:
    body = load_body(name)
    assert (body.hand_tissue.shift(np.zeros((1, len(HAND_ANGLES)))) == 0).all()
    slide = np.linalg.norm(body.hand_tissue.shift(all_shapes()), axis=2)
    assert 0.2 < slide.mean() < 2.0
    assert slide.max() < 5.0
    closed = MARKER_NUMBER["F32"] - MARKER_NUMBER["F11"]
    assert slide[0, closed] > slide[5, closed] + 0.1


def test_two_face_units_are_not_their_sum() -> None:
    body = load_body()
    units = np.zeros((4, len(body.unit_names)))
    jaw, pucker = (body.unit_names.index(n) for n in ("jawOpen", "mouthFunnel"))
    units[[1, 3], jaw], units[[2, 3], pucker] = 0.3, 0.4
    rest, one, other, both = body.face(units, np.zeros((4, 6)))
    extra = np.linalg.norm(both - one - other + rest, axis=1)
    assert 0.3 < extra.max() < 3.0
    assert extra[MARKER_NUMBER["EAR_R"]] < 0.05


def test_markers_are_evenly_spaced() -> None:
    body = load_body()
    for skin, least in ((body.face_skin, 7.0), (body.hand_skin, 7.0)):
        away = np.linalg.norm(skin.rest[:, None] - skin.rest, axis=2) + 1e3 * np.eye(len(skin.rest))
        assert away.min() > least


def test_normals_point_out_of_the_skin() -> None:
    body = load_body()
    still = BodyPose(
        np.zeros((1, len(body.unit_names))),
        np.zeros((1, 6)),
        np.zeros((1, len(HAND_ANGLES))),
        np.zeros((1, 6)),
    )
    normals = body.normals(still)[0]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=0.05)
    assert normals[MARKER_NUMBER["FH0"], 2] > 0.7
    assert normals[MARKER_NUMBER["EAR_R"], 0] < -0.5
    assert normals[MARKER_NUMBER["P3"], 2] > 0.7
