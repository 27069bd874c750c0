"""Subtitles as they come, through the command line: what is left out, offsets, unknown words."""

import json
from pathlib import Path

import pytest

from cuecast.command.cli import main

FILE = """1
00:00:01,000 --> 00:00:02,000
Le gribouflon.

2
00:00:04,000 --> 00:00:03,000
Perdu.

3
00:00:05,000 --> 00:00:06,000
What are you doing here?

4
00:00:07,000 --> 00:00:08,000
Le gribouflon mange.
"""


@pytest.fixture
def subs(tmp_path: Path) -> str:
    path = tmp_path / "a.srt"
    path.write_text(FILE, encoding="utf-8")
    return str(path)


def test_bad_subtitles_are_left_out_and_told(subs: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "--file", subs, "--json"]) == 0
    out, err = capsys.readouterr()
    starts = [key["start"] for key in json.loads(out)]
    assert 1.0 <= min(starts) < 2.0
    assert not any(3.5 < start < 6.5 for start in starts), "at most 1.5 s late, 0.5 s early"
    assert "left out: line 6: subtitle ends at 3.000 s" in err
    assert "left out: line 10: not French (en): 'What are you doing here?'" in err


def test_a_strict_reader_refuses(subs: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "--file", subs, "--strict"]) == 3
    assert "line 6: subtitle ends at 3.000 s" in capsys.readouterr().err


def test_everything_and_offset(subs: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "--file", subs, "--json", "--everything", "--offset", "10"]) == 0
    starts = [key["start"] for key in json.loads(capsys.readouterr().out)]
    assert min(starts) == 11.0
    assert any(15.0 <= start < 16.0 for start in starts)


def test_unknown_words_come_as_lines_of_a_lexicon(
    subs: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["keys", "--file", subs, "--unknown"]) == 0
    lines = capsys.readouterr().out
    assert lines == "gribouflon\tɡʁibuflɔ̃\t# line 2, 2 times\n".replace("ɡ", "g")
    lexicon = tmp_path / "mine.txt"
    lexicon.write_text(lines, encoding="utf-8")
    assert main(["keys", "--file", subs, "--unknown", "--json", "--lexicon", str(lexicon)]) == 0
    assert json.loads(capsys.readouterr().out) == []
