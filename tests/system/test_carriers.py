"""Several carriers at once: the picture bears more, the sound helps where it is lost."""

import json
from itertools import islice
from pathlib import Path

import pytest

from cuecast.command.cli import main
from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
from cuecast.demo.run import as_srt
from cuecast.media.film import write_film

pytestmark = pytest.mark.long(10)

SECONDS = 5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short film, dubbed with all carriers, and without its sound with those of the picture."""
    path = tmp_path_factory.mktemp("carriers")
    sound, subtitles = make_sound()
    (path / "a.srt").write_text(as_srt(subtitles[:2]), encoding="utf-8")
    write_film(
        path / "a.mkv",
        sound[: SECONDS * FS],
        FS,
        encoder="flac",
        pictures=islice(make_pictures(SECONDS), SECONDS * PICTURE_RATE),
    )
    dub = ["dub", str(path / "a.mkv"), "--subtitles", str(path / "a.srt"), "--no-grade"]
    dub += ["--video-bitrate", "2000k"]
    every = [*dub, "--carriers", "audio,video,a335", "-o", str(path / "all.mkv")]
    assert main([*every, "--report", str(path / "all.json")]) == 0
    assert main([*dub, "--carriers", "a335", "--no-read-back", "-o", str(path / "line.mkv")]) == 0
    return path


def test_every_carrier_is_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["receive", str(folder / "all.mkv"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    report = json.loads((folder / "all.json").read_text(encoding="utf-8"))
    assert set(found["carriers"]) == set(report["carriers"]) == {"audio", "video", "a335"}
    assert all(carrier["locked"] for carrier in found["carriers"].values())
    assert found["superframes"]["lost"] == 0
    assert found["superframes"]["received"] >= 6
    assert report["carriers"]["video"]["mark_psnr_db"] > 45
    assert 30 < report["carriers"]["video"]["psnr_db"] < report["carriers"]["video"]["mark_psnr_db"]
    assert found["keys"]
    keys = [[(k["shape"], k["placement"]) for k in d["keys"]] for d in (report, found)]
    assert keys[1] == keys[0][: len(keys[1])]


def test_the_line_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["receive", str(folder / "line.mkv"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["carriers"]["a335"]["locked"]
    assert not found["carriers"]["audio"]["locked"]
    assert found["superframes"]["received"] >= 6


def test_hearing_only(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["receive", str(folder / "line.mkv"), "--sound-only", "--json"]) == 1
    assert set(json.loads(capsys.readouterr().out)["carriers"]) == {"audio"}


@pytest.mark.parametrize(
    ("options", "status", "message"),
    [
        (["--profile", "loud"], 2, "say it as audio=robust"),
        (["--profile", "audio=loud"], 3, "unknown profile 'loud'"),
        (["--carriers", "audio,video", "--video-codec", "nonsense"], 3, "nonsense"),
        (["--carriers", "audio,"], 2, "no carrier called ''"),
    ],
)
def test_wrong_choices(
    folder: Path, capsys: pytest.CaptureFixture[str], options: list[str], status: int, message: str
) -> None:
    before = set(folder.iterdir())
    dub = ["dub", str(folder / "a.mkv"), "--subtitles", str(folder / "a.srt"), "--no-grade"]
    assert main([*dub, "-o", str(folder / "never.mkv"), *options]) == status
    assert message in capsys.readouterr().err
    assert set(folder.iterdir()) == before
