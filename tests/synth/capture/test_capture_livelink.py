"""Live Link Face tables: there and back through our own export, and what telephones write."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.cuer.motion import Motion
from codec.cuer.voice import load_voice
from codec.errors import CueError
from receiver.drawing.avatar import load_avatar
from receiver.export.arkit import live_link_csv
from synth.capture.capture import capture_motion
from synth.capture.options import CaptureOptions
from synth.capture.sources.sniff import kind_of
from synth.capture.tracker.livelink import read_live_link
from synth.motion.rules.gesture import GestureSynthesiser
from tests.synth import studio_files as files

VOICE = load_voice()
TITLES = (
    "Timecode,BlendshapeCount,EyeBlinkLeft,JawOpen,MouthFunnel,MouthPucker,"
    "HeadYaw,HeadPitch,HeadRoll"
)


def motion() -> Motion:
    cuer = GestureSynthesiser("claire", rate_hz=60.0, seed=2)
    return cuer.motion(files.score(), 0.0, 150, VOICE)


def table(rows: int, *, base: int = 60, titles: str = TITLES) -> str:
    lines = [titles]
    for n in range(rows):
        code = f"14:03:{22 + n // base:02d}:{n % base:02d}.016"
        opening = 0.2 * (1 - np.cos(2 * np.pi * n / base))
        lines.append(f"{code},61,0.1,{opening:.5f},0.1,0.0,0.2,-0.1,0.05")
    return "\n".join(lines) + "\n"


def test_there_and_back(tmp_path: Path) -> None:
    sent = motion()
    path = tmp_path / "face.csv"
    path.write_text(live_link_csv(sent, VOICE, load_avatar(VOICE)), encoding="utf-8")
    assert kind_of(path) == "livelink"
    got = capture_motion(path, VOICE, CaptureOptions(rate_hz=60.0))
    assert got.motion.score is None
    a, b = (VOICE.reconstruct(m.params[:150]) for m in (sent, got.motion))
    lips = slice(12, 24)
    # Other movements of the head than its turns are not in the table.
    shape = [
        VOICE.face.shape(m.params[:150, VOICE.face_columns[:7]])[:, lips]
        for m in (sent, got.motion)
    ]
    assert np.linalg.norm(shape[0] - shape[1], axis=-1).mean() < 1.5
    assert a.shape == b.shape
    turns = [
        VOICE.face.motion(m.params[:150, VOICE.face_columns[7:]])[:, :3] for m in (sent, got.motion)
    ]
    np.testing.assert_allclose(turns[0], turns[1], atol=0.03)


@pytest.mark.parametrize("base", [30, 60])
def test_a_telephones_table(tmp_path: Path, base: int) -> None:
    path = tmp_path / "MySlate_1_iPhone.csv"
    path.write_text(table(3 * base, base=base))
    found = read_live_link(path)
    assert found.rate_hz == pytest.approx(base)
    assert found.units == ("jawOpen", "mouthFunnel", "mouthPucker")
    np.testing.assert_allclose(found.turns[0], [0.2, -0.1, 0.05], atol=1e-6)
    got = capture_motion(path, VOICE)
    assert got.motion.start_s == 0.0
    assert got.motion.duration_s == pytest.approx(3.0, abs=0.03)
    assert "the table shows no hand: it rests" in got.report["notes"]
    opening = VOICE.face.shape(got.motion.params[:, VOICE.face_columns[:7]])
    gap = np.ptp(opening[:, 18, 1])  # a marker below the mouth follows the jaw
    assert gap > 2.0


def test_degrees_and_milliseconds(tmp_path: Path) -> None:
    rows = [TITLES]
    for n in range(60):
        rows.append(f"00:00:{n // 30:02d}:{n % 30 * 1000 // 30:02d}.000,61,0,0.1,0,0,20.0,-5.0,1.0")
    path = tmp_path / "a.csv"
    path.write_text("\n".join(rows))
    found = read_live_link(path)
    assert found.rate_hz == pytest.approx(30, abs=0.5)
    np.testing.assert_allclose(found.turns[0], np.radians([20.0, -5.0, 1.0]))
    assert "the head's rotations are taken for degrees" in found.notes


def test_lost_rows_and_holes(tmp_path: Path) -> None:
    lines = table(120).splitlines()
    del lines[40:44]
    lines[60] = lines[60].replace(",61,0.1,", ",61,0.1,nan", 1)
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    found = read_live_link(path)
    assert len(found.weights) == 120
    assert "1 rows with missing numbers keep those before" in found.notes
    assert np.abs(np.diff(found.weights[:, 0])).max() < 0.05


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TITLES + "\n", "0 rows with a time code, 2 needed"),
        (table(1), "1 rows with a time code"),
        (table(9).replace("14:03:22", "x"), "0 rows with a time code"),
        ("Timecode,BlendShapeCount,A\n0:0:0:1,1,1\n0:0:0:2,1,1\n", "0 face weights"),
        ("\n".join(table(2).splitlines()[i] for i in (0, 1, 1)), "the times do not rise"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(CueError, match=message):
        read_live_link(tmp_path / "a.csv")


@settings(max_examples=150)
@given(st.data())
def test_damage_is_one_error_or_a_table(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(table(5).encode())
    edits = st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255))
    for at, value in data.draw(st.lists(edits, max_size=12)):
        content[at] = value
    path = tmp_path_factory.mktemp("link") / "a.csv"
    path.write_bytes(bytes(content))
    try:
        found = read_live_link(path)
    except CueError:
        return
    assert np.isfinite(found.weights).all()
    assert np.isfinite(found.turns).all()
