"""The command line's manners: pages, exit statuses, one-line errors."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from codec.errors import CueError
from codec.files.whole import whole_file
from cuecast.command import cli
from cuecast.command.cli import main
from cuecast.command.parser import LONGEST_PAGE, Parser
from docs.generate.verbs import parsers_of


def test_help_lists_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    page = capsys.readouterr().out
    for verb in cli.VERBS:
        assert f"  {verb} " in page


@pytest.mark.parametrize("verb", cli.VERBS)
def test_verb_has_a_page(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([verb, "--help"]) == 0
    assert capsys.readouterr().out.startswith(f"usage: cuecast {verb}")


@pytest.mark.parametrize("verb", cli.VERBS)
def test_help_fits_a_screen_and_a_half(verb: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 80 columns; every option is named there, and explained by ``--help-all``."""
    monkeypatch.setenv("COLUMNS", "80")
    parser = parsers_of(cli.build_parser())[verb]
    assert isinstance(parser, Parser)
    assert len(parser.format_help().splitlines()) <= LONGEST_PAGE
    for action in parser._actions:
        for name in action.option_strings:
            assert name in parser.format_help()
            assert f"  {name}" in parser.format_all() or f", {name}" in parser.format_all()


def test_the_whole_help_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dub", "--help-all"]) == 0
    assert "red names sounds" in capsys.readouterr().out
    assert main(["dub", "--help"]) == 0
    assert "red names sounds" not in capsys.readouterr().out


def test_every_verb_module_is_offered() -> None:
    folder = Path(cli.__file__).parents[1] / "verbs"
    assert {path.stem for path in folder.glob("*.py")} - {"__init__"} == set(cli.VERBS)


@pytest.mark.parametrize("argv", [[], ["nonsense"], ["keys"], ["dub", "film.mp4"]])
def test_wrong_usage(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(argv) == 2
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("line", "end"),
    [
        ("dub a.mp4 -o b.mp4 --subtitels s.srt", "--subtitels s.srt; --subtitles is known"),
        ("decode a.cue -o b.npz --subtitles=x", "--subtitles=x"),
        ("decode a.cue b.npz -o c.npz", "b.npz"),
    ],
)
def test_a_verb_refuses_with_its_own_usage(
    line: str, end: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line.split()) == 2
    lines, verb = capsys.readouterr().err.splitlines(), line.split()[0]
    assert lines[0].startswith(f"usage: cuecast {verb} ")
    assert lines[-1] == f"cuecast {verb}: error: unrecognized arguments: {end}"


def test_help_needs_no_numbers() -> None:
    """``cuecast --help`` answers at once because it loads none of the heavy libraries."""
    code = (
        "import sys; from cuecast.command.cli import main; main(['--help']);"
        "print({'numpy', 'numba', 'av', 'scipy'} & set(sys.modules), file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stderr.strip() == "set()"


def test_error_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["receive", str(tmp_path / "missing.mp4")]) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"cuecast: {tmp_path / 'missing.mp4'}: No such file or directory\n"


@pytest.mark.parametrize("argv", [["--debug", "receive", "x"], ["receive", "x", "--debug"]])
def test_debug_shows_a_trace(capsys: pytest.CaptureFixture[str], argv: list[str]) -> None:
    assert main(argv) == 3
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.usefixtures("hangups_end")
@pytest.mark.parametrize(
    ("number", "ignored", "status"),
    [(signal.SIGTERM, False, 130), (signal.SIGHUP, False, 130), (signal.SIGHUP, True, 0)],
)
def test_a_closed_terminal_leaves_no_files(
    tmp_path: Path, number: signal.Signals, ignored: bool, status: int
) -> None:
    text, out = " ".join(["Bonjour, voici les nouvelles de ce soir."] * 40), tmp_path / "a.npz"
    code = (
        "import os, signal, sys; from unittest import mock; from pathlib import Path;"
        "from cuecast.command.cli import main;"
        f"{ignored} and signal.signal(signal.SIGHUP, signal.SIG_IGN);"
        "replace = Path.replace;"
        f"kill = lambda *a: (os.kill(os.getpid(), {int(number)}), replace(*a));"
        "mock.patch.object(Path, 'replace', kill).start(); sys.exit(main(sys.argv[1:]))"
    )
    arguments = ["synth", text, "-o", str(out)]
    run = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)
    assert run.returncode == status, run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"] * ignored
    assert ("interrupted" in run.stderr) is not ignored


def test_whole_file_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt), whole_file(target) as temporary:
        stop_half_way(temporary)
    assert [p.read_text(encoding="utf-8") for p in tmp_path.iterdir()] == ["old"]
    with whole_file(target) as temporary:
        temporary.write_text("new", encoding="utf-8")
    assert [p.read_text(encoding="utf-8") for p in tmp_path.iterdir()] == ["new"]


def stop_half_way(path: Path) -> None:
    path.write_text("half", encoding="utf-8")
    raise KeyboardInterrupt


def test_whole_file_needs_a_folder(tmp_path: Path) -> None:
    with pytest.raises(CueError, match="cannot write: No such file"), whole_file(tmp_path / "a/b"):
        pass
    with pytest.raises(CueError, match="is a folder"), whole_file(tmp_path):
        pass


def test_keys_are_made_renewed_and_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    secret, public, later, other = (str(tmp_path / name) for name in ("s", "p", "q", "o"))
    made = ["key", "new", "Chaîne 1", "--secret", secret, "--public", public, "--days", "1"]
    assert main([*made, "--from", "2026-12-01"]) == 0
    assert main(made) == 3  # a secret is never replaced
    renewed = ["--public", later, "--days", "2", "--from", "2027-12-01"]
    assert main(["key", "renew", "--secret", secret, *renewed]) == 0
    assert (
        main(["key", "new", "x", "--secret", f"{secret}2", "--public", other, "--days", "1"]) == 0
    )
    capsys.readouterr()
    assert main(["key", "show", later, "--pinned", public, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["name"] == "Chaîne 1"
    assert told["from"].startswith("2027-11-30T23") or told["from"].startswith("2027-12-01T00")
    assert main(["key", "show", other, "--pinned", public]) == 1
    assert main(["key", "show", secret]) == 3
    assert (
        main(["key", "new", "x", "--secret", f"{secret}3", "--public", other, "--from", "?"]) == 2
    )
