"""`avatar`, and `render --avatar` with what it wrote, through the command line."""

import json
from pathlib import Path

import pytest

from codec.cuer.motion import save_motion
from codec.cuer.voice import load_voice
from cuecast.command.cli import main
from receiver.drawing.render import read_picture
from tests.receiver.foreign.figure import figure
from tests.receiver.standin import make_motion


def test_a_figure_becomes_an_avatar_and_a_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, made, motion = (str(tmp_path / name) for name in ("f.vrm", "f.avatar", "m.npz"))
    Path(model).write_bytes(figure("vrm1"))
    save_motion(make_motion(load_voice(), 1.0), motion)
    assert main(["avatar", model, "-o", made, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["readable_lips"]
    assert said["terms"] == "Egg; A. Test, B; https://vrm.dev/licenses/1.0/"
    assert said["places_mm"].keys() == {"side", "mouth", "chin", "cheek", "throat"}
    target = str(tmp_path / "a.png")
    render = ["render", motion, "-o", target, "--size", "160x186", "--avatar", made]
    assert main(render) == 0
    assert (read_picture(target).max(axis=2) > 40).mean() > 0.3
    assert main([*render, "--look", "man"]) == 2
    capsys.readouterr()


def test_unusable_figures_leave_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "f.vrm"
    for data, said in (
        (figure(without=("rightLittle2",)), "has no bone rightLittleDistal"),
        (figure()[:9000], "cut off"),
        (b"PK\x03\x04", "not a binary glTF file"),
    ):
        model.write_bytes(data)
        assert main(["avatar", str(model), "-o", str(tmp_path / "f.avatar")]) == 3
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert line.startswith("cuecast: f.vrm: ")
        assert said in line
    assert [path.name for path in tmp_path.iterdir()] == ["f.vrm"]
