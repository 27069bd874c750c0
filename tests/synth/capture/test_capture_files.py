"""Readers of recordings and of maps: what laboratories write, and what is broken."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.cuer.layout import MARKER_NUMBER, MARKERS
from codec.errors import CueError
from receiver.export.markers import marker_csv
from receiver.export.markers import trc as our_trc
from synth.capture.points.labels import find_names, read_map
from synth.capture.sources.readers import read_points
from synth.capture.sources.sniff import kind_of
from tests.synth import studio_files as files

LABELS = ("FH0", "Claire:EAR_R", "W1")


def some_points(frames: int = 12) -> np.ndarray:
    points = np.random.default_rng(2).uniform(-500, 500, size=(frames, 3, 3)).round(2)
    points[4:7, 1] = np.nan
    return points


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("a.trc", files.trc(some_points(), LABELS), "trc"),
        ("a.txt", files.trc(some_points(), LABELS).replace("\t", "  "), "trc"),
        ("a.tsv", files.tsv(some_points(), LABELS), "tsv"),
        ("b.tsv", files.tsv(some_points(), LABELS, lead=1), "tsv"),
        ("c.tsv", files.tsv(some_points(), LABELS, lead=2), "tsv"),
    ],
)
def test_tables_are_known_by_their_content(tmp_path: Path, name: str, text: str, kind: str) -> None:
    path = tmp_path / name
    path.write_text(text, newline="")
    assert kind_of(path) == kind
    recording = read_points(path, kind)
    assert (recording.labels, recording.rate_hz, recording.n_frames) == (LABELS, 60.0, 12)
    if name != "a.txt":  # without tabs, an empty field is not to be seen
        np.testing.assert_allclose(recording.frames(0, 12), some_points(), atol=1e-3)
    np.testing.assert_allclose(recording.frames(8, 99), some_points()[8:], atol=1e-3)


def test_a_tsv_whose_hidden_markers_are_empty_fields(tmp_path: Path) -> None:
    text = files.tsv(some_points(), LABELS, lead=2)
    lines = text.replace("\r\n", "\n").split("\n")
    lines[11] = "\t".join([*lines[11].split("\t")[:8], "", "", ""])
    lines[10] += "\t"
    path = tmp_path / "a.tsv"
    path.write_text("\n".join(lines))
    points = read_points(path, "tsv").frames(0, 12)
    expected = some_points()
    expected[0, 2] = np.nan
    np.testing.assert_allclose(points, expected, atol=1e-3)


def test_our_own_exports_are_read(tmp_path: Path) -> None:
    markers = np.random.default_rng(0).uniform(-300, 300, size=(5, 113, 3))
    markers[2, 7] = np.nan
    (tmp_path / "m.trc").write_text(our_trc(markers, 50.0, "m"))
    (tmp_path / "m.csv").write_text(marker_csv(markers, 3.0 + np.arange(5) / 50.0))
    for name, kind, start in (("m.trc", "trc", 0.0), ("m.csv", "points", 3.0)):
        assert kind_of(tmp_path / name) == kind
        recording = read_points(tmp_path / name, kind)
        assert recording.labels == MARKERS
        assert recording.rate_hz == pytest.approx(50.0)
        assert recording.start_s == pytest.approx(start)
        np.testing.assert_allclose(recording.frames(0, 5), markers, atol=1e-3)


def test_c3d_with_prefix_metres_and_sound_channel(tmp_path: Path) -> None:
    pytest.importorskip("ezc3d", reason="needs the extra c3d")
    points = some_points()
    files.write_foreign_c3d(tmp_path / "a.c3d", points / 1000, list(LABELS), unit="m")
    assert kind_of(tmp_path / "a.c3d") == "c3d"
    recording = read_points(tmp_path / "a.c3d", "c3d")
    assert (recording.labels, recording.unit, recording.n_frames) == (LABELS, "m", 12)
    np.testing.assert_allclose(recording.frames(0, 12), points / 1000, atol=1e-5)


def test_a_cut_table_says_so(tmp_path: Path) -> None:
    text = files.trc(some_points(), LABELS)
    (tmp_path / "a.trc").write_text(text[: len(text) * 2 // 3])
    recording = read_points(tmp_path / "a.trc", "trc")
    assert 0 < recording.n_frames < 12
    assert "missing" in recording.notes[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty file"),
        (b"hello\nworld\n", "not C3D, TRC, Qualisys TSV"),
        (b"PathFileType\t4\nnothing\n", "not a TRC file"),
        (b"NO_OF_FRAMES\t3\nMARKER_NAMES\tA\n1\t2\t3\t4\t5\t6\t7\n", "FREQUENCY is missing"),
        (b"NO_OF_FRAMES\t3\nFREQUENCY\t100\nMARKER_NAMES\tA\n1\t2\t3\t4\t5\t6\t7\n", "1 markers"),
        (b"NO_OF_FRAMES\t3\nFREQUENCY\tx\nMARKER_NAMES\tA\n1\t2\t3\t4\n", "malformed"),
        (b"NO_OF_FRAMES\t3\nFREQUENCY\t0\nMARKER_NAMES\tA\n1\t2\t3\t4\n", "not within 1..10000"),
        (b"time,A.x,A.y,A.z\n", "not a time that rises"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(content)
    with pytest.raises(CueError, match=message):
        read_points(path, kind_of(path))


SAMPLES: dict[str, Callable[[], str]] = {
    "trc": lambda: files.trc(some_points(4), LABELS),
    "tsv": lambda: files.tsv(some_points(4), LABELS, lead=2),
    "points": lambda: "t,A.x,A.y,A.z\n0,1,2,3\n0.02,1,2,3\n0.04,,,\n",
}


@pytest.mark.parametrize("kind", SAMPLES)
@settings(max_examples=120)
@given(data=st.data())
def test_damage_is_one_error_or_frames(
    kind: str, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(SAMPLES[kind]().encode())
    edits = st.tuples(st.integers(0, len(content) - 1), st.sampled_from(b"\0\t\n,.-9eENaN\xff "))
    for at, value in data.draw(st.lists(edits, max_size=10)):
        content[at] = value
    cut = data.draw(st.integers(1, len(content)))
    path = tmp_path_factory.mktemp("text") / "a"
    path.write_bytes(bytes(content[:cut]))
    try:
        recording = read_points(path, kind)
    except CueError:
        return
    points = recording.frames(0, recording.n_frames)
    assert points.shape == (recording.n_frames, len(recording.labels), 3)


def test_names_without_prefix_capitals_and_blanks() -> None:
    naming = find_names(("Marie:fh0", "EAR_r ", "*12", "belly"))
    assert naming.columns[[MARKER_NUMBER["FH0"], MARKER_NUMBER["EAR_R"]]].tolist() == [0, 1]
    assert naming.found.sum() == 2
    assert naming.unnamed.tolist() == [2]
    assert naming.unused == ("belly",)


def test_of_two_people_one_is_chosen() -> None:
    labels = ("A:FH0", "B:FH0", "B:NB")
    with pytest.raises(CueError, match="FH0 stands there twice, as 'A:FH0' and 'B:FH0': choose"):
        find_names(labels)
    assert find_names(labels, subject="b").columns[MARKER_NUMBER["FH0"]] == 1


@pytest.mark.parametrize("form", ["csv", "titled", "json"])
def test_a_map_of_labels(tmp_path: Path, form: str) -> None:
    pairs = {"front": "FH0", "left ear": "EAR_L"}
    rows = "\n".join(f"{a},{b}" for a, b in pairs.items())
    text = {"csv": rows, "titled": "label,marker\n" + rows, "json": json.dumps(pairs)}[form]
    (tmp_path / "m").write_text(text, encoding="utf-8")
    mapping = read_map(tmp_path / "m")
    assert mapping == pairs
    naming = find_names(("LEFT EAR", "x", "front"), mapping=mapping)
    assert naming.columns[[MARKER_NUMBER["FH0"], MARKER_NUMBER["EAR_L"]]].tolist() == [2, 0]
    with pytest.raises(CueError, match="names 'left ear', which is no label"):
        find_names(("front",), mapping=mapping)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty map"),
        ("{1}", "not a map"),
        ('{"a": 3}', "not a map"),
        ("a,NOSE", "mapped to 'NOSE', which is no marker"),
        ("a,FH0\nb,fh0", "two labels are mapped to FH0"),
    ],
)
def test_a_wrong_map_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "m").write_text(text)
    with pytest.raises(CueError, match=message):
        read_map(tmp_path / "m")
