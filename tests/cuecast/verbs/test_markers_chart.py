"""The chart of the markers."""

from pathlib import Path

import pytest

from codec.cuer.layout import MARKERS
from cuecast.command.cli import main


def test_every_marker_is_named_on_the_chart(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra plots")
    chart = tmp_path / "markers.svg"
    assert main(["capture", "--markers-chart", str(chart)]) == 0
    drawn = chart.read_text("utf-8")
    assert all(f"<!-- {name} -->" in drawn or f">{name}<" in drawn for name in MARKERS)


def test_other_forms_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    chart = tmp_path / "markers.doc"
    assert main(["capture", "--markers-chart", str(chart)]) == 3
    assert "a chart ends in .png, .svg, .pdf" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ([], "a recording or --markers-chart is needed"),
        (["take.c3d"], "a recording goes with --output"),
        (["-o", "m.npz", "--markers-chart", "c.png"], "a recording goes with --output"),
    ],
)
def test_a_capture_needs_a_recording_and_an_output(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["capture", *argv]) == 2
    assert message in capsys.readouterr().err
