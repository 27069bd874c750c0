"""C3D files and TextGrids of the corpora."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cuer.c3d import read_c3d, write_c3d
from codec.cuer.layout import MARKERS
from codec.cues.score import Key, Phone, Score
from codec.errors import CueError
from synth.planning.scoring.drills import drill
from synth.planning.scoring.textgrid import read_textgrid, write_textgrid

ezc3d = pytest.importorskip("ezc3d", reason="needs the extra c3d")


def some_markers(n: int = 7) -> np.ndarray:
    rng = np.random.default_rng(3)
    markers = rng.normal(scale=200.0, size=(n, len(MARKERS), 3)).astype(np.float32)
    markers[2, 5] = np.nan
    markers[4:, 80] = np.nan
    return markers


def test_c3d_gives_back_markers_gaps_rate_and_start(tmp_path: Path) -> None:
    markers = some_markers()
    write_c3d(tmp_path / "a.c3d", markers, rate_hz=120.0, start_s=2.5)
    found, rate, start = read_c3d(tmp_path / "a.c3d")
    np.testing.assert_allclose(found, markers, atol=1e-4)
    assert rate == 120.0
    assert start == pytest.approx(2.5, abs=1 / 120)


def test_hidden_markers_have_residual_minus_one(tmp_path: Path) -> None:
    write_c3d(tmp_path / "a.c3d", some_markers(), rate_hz=120.0)
    raw = ezc3d.c3d(str(tmp_path / "a.c3d"))
    residuals = raw["data"]["meta_points"]["residuals"][0]
    assert residuals[5, 2] == -1
    assert residuals[5, 3] == 0
    assert raw["parameters"]["POINT"]["LABELS"]["value"] == list(MARKERS)


def test_ghosts_are_written_and_not_taken_for_markers(tmp_path: Path) -> None:
    ghosts = np.full((7, 2, 3), 1.0)
    write_c3d(tmp_path / "a.c3d", some_markers(), rate_hz=120.0, ghosts=ghosts)
    assert read_c3d(tmp_path / "a.c3d")[0].shape == (7, len(MARKERS), 3)
    labels = ezc3d.c3d(str(tmp_path / "a.c3d"))["parameters"]["POINT"]["LABELS"]["value"]
    assert labels[-2:] == ["*1", "*2"]


def test_markers_are_found_in_any_order_and_with_a_prefix(tmp_path: Path) -> None:
    markers = some_markers()
    c3d = ezc3d.c3d()
    points = np.ones((4, len(MARKERS), len(markers)))
    points[:3] = markers.transpose(2, 1, 0)[:, ::-1] / 1000.0
    c3d["parameters"]["POINT"]["LABELS"]["value"] = [f"Claire:{n}" for n in MARKERS[::-1]]
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    c3d["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    c3d["data"]["points"] = points
    c3d.write(str(tmp_path / "b.c3d"))
    np.testing.assert_allclose(read_c3d(tmp_path / "b.c3d")[0], markers, atol=1e-3)


def test_a_missing_marker_is_named(tmp_path: Path) -> None:
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["LABELS"]["value"] = ["FH0"]
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    c3d["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    c3d["data"]["points"] = np.ones((4, 1, 3))
    c3d.write(str(tmp_path / "c.c3d"))
    with pytest.raises(CueError, match="112 markers are missing, the first is FH1_R"):
        read_c3d(tmp_path / "c.c3d")


def foreign_c3d(path: Path, labels: list[str], unit: str, rate_hz: float, at: float = 1.0) -> None:
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["LABELS"]["value"] = labels
    c3d["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    c3d["data"]["points"] = np.full((4, len(labels), 3), at)
    c3d.write(str(path))


@pytest.mark.parametrize(
    ("labels", "unit", "rate_hz", "message"),
    [
        ([*MARKERS], "inch", 100.0, "unit 'inch' is not one of mm, cm, m"),
        ([*MARKERS, "B:K3"], "mm", 100.0, "marker K3 stands there 2 times"),
    ],
)
def test_strange_recordings_are_refused(
    tmp_path: Path, labels: list[str], unit: str, rate_hz: float, message: str
) -> None:
    foreign_c3d(tmp_path / "d.c3d", labels, unit, rate_hz)
    with pytest.raises(CueError, match=message):
        read_c3d(tmp_path / "d.c3d")


def test_a_rate_of_zero_is_refused(tmp_path: Path) -> None:
    write_c3d(tmp_path / "r.c3d", some_markers(), rate_hz=100.0)
    content = (tmp_path / "r.c3d").read_bytes()
    patched = content.replace(struct.pack("<f", 100.0), struct.pack("<f", 0.0))
    (tmp_path / "r.c3d").write_bytes(patched)
    with pytest.raises(CueError, match=r"rate 0\.0 Hz is not positive"):
        read_c3d(tmp_path / "r.c3d")


def test_markers_left_at_the_origin_are_hidden(tmp_path: Path) -> None:
    foreign_c3d(tmp_path / "e.c3d", [*MARKERS], "MM", 100.0, at=0.0)
    assert np.isnan(read_c3d(tmp_path / "e.c3d")[0]).all()


@pytest.mark.parametrize("content", [b"", b"not a c3d file at all", b"\x02\x50" + bytes(600)])
def test_what_is_no_c3d_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.c3d").write_bytes(content)
    with pytest.raises(CueError, match=r"x\.c3d"):
        read_c3d(tmp_path / "x.c3d")


def test_a_missing_c3d_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CueError, match=r"none\.c3d"):
        read_c3d(tmp_path / "none.c3d")


def test_other_shapes_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(CueError, match=r"markers have shape \(2, 3\)"):
        write_c3d(tmp_path / "a.c3d", np.zeros((2, 3)), rate_hz=120.0)


@given(seed=st.integers(0, 50), lines=st.integers(1, 3))
def test_textgrid_round_trip(
    tmp_path_factory: pytest.TempPathFactory, seed: int, lines: int
) -> None:
    score = drill(lines, seed=seed)
    path = tmp_path_factory.mktemp("grid") / "a.TextGrid"
    write_textgrid(path, score, score.phones[-1].end + 1.0)
    found = read_textgrid(path)
    assert [p.symbol for p in found.phones] == [p.symbol for p in score.phones]
    assert [(k.phones, k.shape, k.placement) for k in found.keys] == [
        (k.phones, k.shape, k.placement) for k in score.keys
    ]
    for a, b in zip(found.phones, score.phones, strict=True):
        assert a.start == pytest.approx(b.start, abs=1e-5)
        assert a.end == pytest.approx(b.end, abs=1e-5)


def test_textgrid_tiers_have_no_holes(tmp_path: Path) -> None:
    score = Score((Phone("a", 0.5, 1.0),), (Key(0.5, 1.0, ("a",), 5, "side"),))
    write_textgrid(tmp_path / "a.TextGrid", score, 2.0)
    text = (tmp_path / "a.TextGrid").read_text(encoding="utf-8")
    assert text.count("intervals: size = 3") == 2
    assert 'text = "15 a"' in text


def test_a_score_longer_than_its_textgrid_is_refused(tmp_path: Path) -> None:
    score = Score((Phone("a", 0.5, 1.0),), ())
    with pytest.raises(CueError, match=r"the score ends at 1.0 s, after 0.8 s"):
        write_textgrid(tmp_path / "a.TextGrid", score, 0.8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no tier of phones"),
        ('item [1]:\nname = "phones"\nxmin = x xmax = 1 text = "a"', "malformed TextGrid"),
        (
            'item [1]:\nname = "phones"\nitem [2]:\nname = "keys"\nxmin = 0 xmax = 1 text = "99 a"',
            "key '99' is not placement",
        ),
    ],
)
def test_malformed_textgrids_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.TextGrid").write_text(text, encoding="utf-8")
    with pytest.raises(CueError, match=message):
        read_textgrid(tmp_path / "a.TextGrid")
