"""Films go through a tracker in another process; here a stand-in for it."""

import sys
from pathlib import Path

import av
import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.errors import CueError
from synth.capture.capture import capture_motion
from synth.capture.options import CaptureOptions
from synth.capture.sources.sniff import kind_of
from synth.capture.tracker.video import find_tracker, track
from tests.synth import landmark_files as tables
from tests.synth import studio_files as files

VOICE = load_voice()
FPS, SECONDS = 25, 2

STAND_IN = """
import sys
width, height = map(int, sys.stdin.buffer.readline().split())
with open({rows!r}) as known:
    lines = known.read().splitlines()
print(lines[0])
by_time = {{}}
for line in lines[1:]:
    by_time.setdefault(line.split(",")[0], []).append(line)
frames = list(by_time.values())
count = 0
while line := sys.stdin.buffer.readline():
    pixels = sys.stdin.buffer.read(3 * width * height)
    assert len(pixels) == 3 * width * height
    time_s = line.decode().strip()
    print(f"{{time_s}},frame,0,,,")
    for row in frames[count]:
        print(time_s + row[row.index(","):])
    count += 1
"""


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("film") / "interpreter.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=FPS)
        stream.width, stream.height, stream.pix_fmt = 192, 108, "yuv420p"
        for number in range(FPS * SECONDS):
            picture = np.full((108, 192, 3), 4 * number, dtype=np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def interpreter(folder: Path, script: str) -> str:
    """Return a program that does what `script` says, whatever it is told to run."""
    body, program = folder / "body.py", folder / "python"
    body.write_text(script, encoding="utf-8")
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{body}"\n', encoding="utf-8")
    program.chmod(0o755)
    return str(program)


def test_a_film_through_a_tracker(film: Path, tmp_path: Path) -> None:
    face, hand, _ = tables.project(
        "claire", files.score(), seconds=SECONDS, noise_mm=1.0, rate_hz=FPS
    )
    rows = tmp_path / "rows.csv"
    rows.write_text(tables.long(face, hand), encoding="utf-8")
    tracker = interpreter(tmp_path, STAND_IN.format(rows=str(rows)))
    assert kind_of(film) == "video"
    found = capture_motion(film, VOICE, CaptureOptions(tracker=tracker))
    assert found.report["input"]["kind"] == "video"
    assert found.report["input"]["frames"] == FPS * SECONDS
    assert found.report["place"]["aspect"] == pytest.approx(16 / 9, rel=0.01)
    assert found.report["seen"] == {"face": 1.0, "hand": 1.0}
    assert found.motion.duration_s == pytest.approx(SECONDS, abs=0.05)


def test_without_a_tracker_it_says_what_is_needed(
    film: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CUECAST_TRACKER", raising=False)
    if find_tracker(None) is not None:
        pytest.skip("MediaPipe is installed here")
    with pytest.raises(CueError, match=r"needs an image tracker: .*mediapipe==.*landmark CSV"):
        capture_motion(film, VOICE)
    monkeypatch.setenv("CUECAST_TRACKER", "/usr/bin/other-python")
    assert find_tracker(None) == "/usr/bin/other-python"
    assert find_tracker("given") == "given"


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (
            "import sys; sys.exit('no module named mediapipe')",
            "status 1: no module named mediapipe",
        ),
        ("raise SystemExit(4)", "status 4: it said nothing"),
        ("import sys; sys.stdin.buffer.read(); print('time,part,index,x,y,z')", "0 frames"),
    ],
)
def test_a_tracker_that_fails(film: Path, tmp_path: Path, script: str, message: str) -> None:
    with pytest.raises(CueError, match=message):
        capture_motion(film, VOICE, CaptureOptions(tracker=interpreter(tmp_path, script)))


def test_no_tracker_there_and_no_film(film: Path, tmp_path: Path) -> None:
    with pytest.raises(CueError, match="tracker /nowhere/python: No such file"):
        track(film, "/nowhere/python", tmp_path / "t.csv")
    (tmp_path / "x.mp4").write_bytes(b"\0" * 3000)
    with pytest.raises(CueError, match=r"x\.mp4: cannot be read as a film"):
        track(tmp_path / "x.mp4", sys.executable, tmp_path / "t.csv")
