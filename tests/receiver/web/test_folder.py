"""`cuecast page` refuses what no browser plays, and leaves no part of a folder behind."""

from pathlib import Path

import pytest

from codec.cuer.voice import load_voice
from codec.errors import CueError
from receiver.web.folder import write_folder


@pytest.mark.parametrize(
    ("name", "words"), [("p.mkv", r"do not play \.mkv"), ("none.mp4", "no such file")]
)
def test_refuses_programmes(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "p.mkv").write_bytes(b"x")
    with pytest.raises(CueError, match=words):
        write_folder(tmp_path / name, tmp_path / "site", load_voice("claire"))
    assert [path.name for path in tmp_path.iterdir()] == ["p.mkv"]


def test_refuses_a_folder_with_files(tmp_path: Path) -> None:
    (tmp_path / "p.mp4").write_bytes(b"x")
    with pytest.raises(CueError, match="not an empty folder"):
        write_folder(tmp_path / "p.mp4", tmp_path, load_voice("claire"))


def test_writes_into_an_empty_folder(tmp_path: Path) -> None:
    (tmp_path / "p.m4a").write_bytes(b"x")
    (tmp_path / "site").mkdir()
    voice, text = load_voice("claire"), b"WEBVTT\n"
    files = write_folder(tmp_path / "p.m4a", tmp_path / "site", voice, text, "fr")
    assert {"captions.vtt", "index.html", "programme.m4a", "cuecast.wasm", "voice.bin"} < set(files)
    page = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert '<audio src="programme.m4a"' in page
    assert '<track src="captions.vtt" srclang="fr" default></audio>' in page
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.m4a", "site"]


def test_a_damaged_public_file_leaves_no_folder(tmp_path: Path) -> None:
    for name in ("p.m4a", "one.pub"):
        (tmp_path / name).write_bytes(b"x")
    voice = load_voice("claire")
    with pytest.raises(CueError, match=r"one\.pub"):
        write_folder(tmp_path / "p.m4a", tmp_path / "site", voice, public=tmp_path / "one.pub")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.pub", "p.m4a"]
