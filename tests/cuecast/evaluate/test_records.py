"""Records of figures: what they tell, and that clips are known by their bytes."""

import itertools
import json
import re
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from codec.errors import CueError
from cuecast.evaluate.drawing import Dot, draw_dots
from cuecast.evaluate.records import (
    FIELDS,
    catalogue,
    describe_clips,
    make_record,
    read_record,
    sha256,
)
from cuecast.evaluate.tables import COLUMN_IN, PLOTS, STYLE, write_plots


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    folder = tmp_path / "clips"
    folder.mkdir()
    (folder / "a.wav").write_bytes(b"known")
    (folder / "b.flac").write_bytes(b"unknown")
    (folder / "notes.txt").write_text("no clip")
    entry = {"name": "first", "licence": "CC0-1.0", "source": "a shelf"}
    (folder / "clips.json").write_text(json.dumps({sha256(folder / "a.wav"): entry}))
    return folder


def test_clips_are_known_by_their_bytes(clips: Path) -> None:
    known, unknown = describe_clips(clips)
    assert (known["name"], known["licence"], known["source"]) == ("first", "CC0-1.0", "a shelf")
    assert (unknown["name"], unknown["licence"], unknown["source"]) == ("b", None, None)
    assert known["sha256"] == sha256(clips / "a.wav") != unknown["sha256"]


def test_the_catalogue_is_complete() -> None:
    for digest, entry in catalogue().items():
        assert re.fullmatch("[0-9a-f]{64}", digest)
        assert set(entry) == {"name", "licence", "source"}
        assert all(entry.values())


def test_a_record_tells_all_that_repeats_it(clips: Path) -> None:
    argv = ["evaluate", "audio", "--clips", str(clips), "--seed", "3"]
    record = make_record("audio", argv, [{"x": 1}], seed=3, clips=clips)
    assert tuple(record) == FIELDS
    assert record["command"] == "cuecast evaluate audio --clips clips --seed 3"
    assert record["machine"]["aac_xrt"] > 1
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", record["date"])
    assert str(clips.parent) not in json.dumps(record)
    several = make_record("audio", argv, [], seed=3, clips=[clips, clips])
    assert several["clips"] == record["clips"]
    (built_in,) = make_record("codec", ["evaluate", "codec"], {}, seed=0, clips=None)["clips"]
    assert built_in["licence"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "cannot be read as a record"),
        ("[]", "is no record, it has no 'record'"),
        ('{"record": 1}', "it has no 'kind'"),
        (json.dumps(dict.fromkeys(FIELDS, 9)), "record of version 9, not 1"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "r.json").write_text(text)
    with pytest.raises(CueError, match=re.escape(message)):
        read_record(tmp_path / "r.json")


def test_the_same_results_give_the_same_drawings(tmp_path: Path) -> None:
    def plot(results: Any, figure: Any) -> None:
        axes = figure.subplots()
        axes.plot([1, 2], [row["x"] for row in results], label="x")
        axes.legend()

    drawn = [write_plots(tmp_path / name, [{"x": 1}, {"x": 4}], plot) for name in "ab"]
    assert [path.suffix for path in drawn[0]] == list(PLOTS)
    for one, other in zip(*drawn, strict=True):
        assert one.read_bytes() == other.read_bytes()
    assert b"<text" in drawn[0][1].read_bytes()


def test_no_letters_overlap_at_the_width_of_a_column() -> None:
    """Eleven channels and five clips of long names: every text within the figure and by itself."""
    clips = [f"a_clip_of_a_long_name_{n}" for n in range(5)]
    dots = [Dot(f"discreet@-0.{n}: aac_128", clip, n, 0, 9) for n in range(11) for clip in clips]
    figure = Figure(figsize=COLUMN_IN, layout="constrained")
    with matplotlib.rc_context(STYLE):
        draw_dots(figure, dots, xlabel="superframes lost, % (95 % intervals)")
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
    (axes,), (legend,) = figure.axes, figure.legends
    low, high = axes.get_xlim()
    marks = zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
    shown = [text for place, text in marks if low <= place <= high]
    texts = [*axes.get_yticklabels(), *shown, axes.xaxis.label]
    boxes = [text.get_window_extent() for text in [*texts, *legend.get_texts()] if text.get_text()]
    page = figure.bbox
    assert page.width == COLUMN_IN[0] * figure.dpi
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    for box in boxes:
        assert page.x0 <= box.x0 <= box.x1 <= page.x1
        assert page.y0 <= box.y0 <= box.y1 <= page.y1
