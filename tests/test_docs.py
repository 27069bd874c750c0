"""The pages are true: every block of code runs and prints what it shows; nobody types a figure."""

import ast
import contextlib
import importlib
import io
import os
import re
import shlex
import signal
import subprocess
import sys
import tomllib
import urllib.request
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import pytest

from cuecast.command.cli import VERBS, build_parser, main
from cuecast.demo.content import FS, PICTURE_RATE, make_pictures, make_sound
from cuecast.demo.run import BROADCASTS, as_srt
from cuecast.media.film import write_film
from cuecast.media.rewrite import Unchanged, rewrite_sound
from docs.generate.__main__ import outdated
from docs.generate.figures import records
from docs.generate.pages import DOCS, PACKAGES, TEMPLATES, typed_figures
from docs.generate.verbs import options_of, parsers_of

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted(p for p in DOCS.rglob("*.md") if "templates" not in p.parts)]
GENERATED = {DOCS / "figures.md", DOCS / "reference" / "verbs.md", *DOCS.glob("reference/api/*.md")}
WRITTEN = [path for path in PAGES if path not in GENERATED]
SHORT_LINES, SHORT_S = 2, 8
pytestmark = pytest.mark.long(75)

KINDS = {"console", "python", "sh", "text"}


@dataclass(frozen=True)
class Block:
    """A block of a page that runs, or a command of one with what it prints."""

    page: str
    kind: str
    text: str
    expected: str | None

    def __str__(self) -> str:
        return f"{self.page}: {self.text.splitlines()[0][:50]}"


def blocks(path: Path) -> list[Block]:
    found, page = [], str(path.relative_to(ROOT))
    for kind, text in re.findall(r"^```(\S*)\n(.*?)^```", path.read_text("utf-8"), re.M | re.S):
        assert kind in KINDS, f"{page}: a block of {kind or 'no kind'} would not be tried"
        if kind == "python":
            found.append(Block(page, kind, text, None))
        elif kind == "console":
            for command, output in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", text, re.M):
                found.append(Block(page, kind, command, output))
    return found


BLOCKS = [block for path in WRITTEN for block in blocks(path)]


@pytest.fixture(scope="session")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder in which the demonstration has run, as the first command of README and tutorial."""
    folder = tmp_path_factory.mktemp("workshop")
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        assert main(["demo", "--out", "demo-out"]) == 0
    return folder, out.getvalue()


@pytest.fixture(scope="session")
def short(workshop: tuple[Path, str]) -> Path:
    """The demonstration's files in short, for the commands of all pages."""
    folder = workshop[0] / "short"
    folder.mkdir()
    made = {"programme.mkv", "programme.srt", *(file for _, file, _, _ in BROADCASTS)}
    for path in (workshop[0] / "demo-out").iterdir():
        if path.name not in made:
            (folder / path.name).symlink_to(path)
    sound, subtitles = make_sound()
    (folder / "programme.srt").write_text(as_srt(subtitles[:SHORT_LINES]), encoding="utf-8")
    write_film(
        folder / "programme.mkv",
        sound[: SHORT_S * FS],
        FS,
        encoder="flac",
        pictures=islice(make_pictures(SHORT_S), SHORT_S * PICTURE_RATE),
        picture_rate=PICTURE_RATE,
    )
    dub = ["dub", "programme.mkv", "--subtitles", "programme.srt", "-o", "on-air.mkv", "--no-grade"]
    with contextlib.chdir(folder):
        assert main(dub) == 0
    for _, file, codec, rate in BROADCASTS:
        rewrite_sound(
            folder / "on-air.mkv", folder / file, lambda *_: Unchanged(), codec=codec, bit_rate=rate
        )
    return folder


@pytest.fixture(scope="session")
def rooms(workshop: tuple[Path, str], short: Path) -> dict[str, tuple[Path, dict[str, object]]]:
    """For each page a folder beside the demonstration's, and the names that it has defined."""
    rooms: dict[str, tuple[Path, dict[str, object]]] = {}
    for block in BLOCKS:
        if block.page not in rooms:
            folder = workshop[0] / block.page.replace("/", "-")
            folder.mkdir()
            (folder / "demo-out").symlink_to(short)
            rooms[block.page] = folder, {"__name__": "page"}
    return rooms


@pytest.mark.parametrize("block", BLOCKS, ids=str)
def test_block(
    block: Block, rooms: dict[str, tuple[Path, dict[str, object]]], workshop: tuple[Path, str]
) -> None:
    """Blocks of a page run in order in one folder: later ones use the files of earlier ones."""
    folder, names = rooms[block.page]
    with contextlib.chdir(folder):
        if block.kind == "python":
            exec(compile(block.text, block.page, "exec"), names)
        elif block.text.startswith("cuecast demo "):
            assert workshop[1].splitlines()[-1] + "\n" == block.expected
        elif block.text.startswith("cuecast watch "):
            _watch(shlex.split(block.text)[1:])
        else:
            assert _printed(block.text) == block.expected


def _printed(command: str) -> str:
    """Run a command: ours within this process, with its redirections, others by the shell."""
    words = shlex.split(command)
    if words[0] != "cuecast" or "|" in words:
        home = Path(sys.executable).parent
        path = {"PATH": f"{home}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
        run = subprocess.run(
            ["bash", "-c", f"set -o pipefail; {command}"],
            env=os.environ | path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert run.returncode == 0, run.stderr
        return run.stdout
    out, notes = io.StringIO(), io.StringIO()
    target = None
    if ">" in words:
        at = words.index(">")
        target, words = words[at + 1], words[:at]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(notes):
        status = main(words[1:])
    assert status == 0, notes.getvalue()
    if target is None:
        return out.getvalue()
    Path(target).write_text(out.getvalue(), encoding="utf-8")
    return ""


def _watch(words: list[str]) -> None:
    """Start the television, ask for its page, and stop it as a user does."""
    command = [
        sys.executable,
        "-m",
        "cuecast",
        *words,
        *(() if "--port" in words else ("--port", "0")),
    ]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    # What was started in the background ignores interrupts, and so would what it starts.
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
    finally:
        signal.signal(signal.SIGINT, before)
    try:
        assert process.stdout is not None
        said = ""
        while not (found := re.search(r"http://\S+", said)):
            line = process.stdout.readline()
            assert line, f"ended: {said}"
            said += line
        with urllib.request.urlopen(found.group().rstrip("/.") + "/", timeout=30) as answer:
            assert b"<title>Cuecast</title>" in answer.read()
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=60)
        finally:
            process.kill()


def test_there_are_blocks() -> None:
    assert len(BLOCKS) > 40
    assert {block.page for block in BLOCKS} >= {"README.md", "docs/tutorial.md"}


def test_the_readme_s_first_command_is_the_demonstration() -> None:
    """The block for the shell is `make demo`, which runs what the workshop runs."""
    made, installed = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.S)
    assert made.splitlines() == ["make demo", ". .venv/bin/activate"]
    assert installed.splitlines() == ["pip install .", "cuecast demo --out demo-out"]
    rule = re.search(r"^demo:.*\n\t(.*)$", (ROOT / "Makefile").read_text("utf-8"), re.M)
    assert rule is not None
    assert rule.group(1) == "$(BIN)/cuecast demo --out $(OUT)"


def test_the_readme_is_a_page() -> None:
    assert (ROOT / "README.md").stat().st_size < 6000


@pytest.mark.parametrize(
    "path",
    [*WRITTEN, *sorted(TEMPLATES.rglob("*.md"))],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_nobody_types_a_figure(path: Path) -> None:
    assert typed_figures(path.read_text(encoding="utf-8")) == []


def test_a_typed_figure_is_seen() -> None:
    text = "At 337.5 bit/s it loses 3 of 310 and takes 1.2 s; `AAC 128 kbit/s` is a name."
    assert typed_figures(text) == ["337.5 bit/s", "3 of 310", "1.2 s"]


def test_pages_are_as_generated() -> None:
    """What a forge shows is what the code and the records say today: `python -m docs.generate`."""
    assert [str(path.relative_to(ROOT)) for path in outdated()] == []


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_pages_show_no_template_code(path: Path) -> None:
    text = re.sub(r"```.*?```|`[^`\n]*`", "", path.read_text(encoding="utf-8"), flags=re.S)
    assert not re.search(r"\{\{|\{%|```\{", text)


@pytest.mark.parametrize(
    "path",
    [*PAGES, *sorted((ROOT / "spec").glob("*.md"))],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_links_lead_somewhere(path: Path) -> None:
    for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", path.read_text(encoding="utf-8")):
        assert "://" in link or (path.parent / link).exists(), link


def test_every_verb_and_option_is_on_a_page() -> None:
    page = (DOCS / "reference" / "verbs.md").read_text(encoding="utf-8")
    for name, verb in parsers_of(build_parser()).items():
        assert name in VERBS
        part = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        for option in set(options_of(verb)):
            assert f'{option.lstrip("-")}"></a>' in part, f"{name} {option} has no anchor"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_on_a_page(package: str) -> None:
    page = (DOCS / "reference" / "api" / f"{package}.md").read_text(encoding="utf-8")
    for name in importlib.import_module(package).__all__:
        assert f"\n## `{name}`\n" in page


def test_the_pages_build_without_warnings(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "docs.generate", str(tmp_path / "site")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    names = ("index", "docs/reference/verbs", "docs/reference/api/codec", "spec/bitstream")
    for name in (*names, "docs/figures"):
        assert (tmp_path / "site" / f"{name}.html").is_file()


def test_every_record_can_be_repeated() -> None:
    """Each names a commit without changes, and each clip has a licence and a source."""
    found = records()
    assert found
    page = (TEMPLATES / "figures.md").read_text(encoding="utf-8")
    for name, record in found.items():
        commit = record.document["commit"]
        assert commit, name
        assert not commit.endswith("+"), f"{name} was made from changed files"
        assert record.document["clips"], f"{name} does not say what it was measured on"
        for clip in record.document["clips"]:
            assert clip["licence"] and clip["source"], f"{name}: {clip['name']}"  # noqa: PT018
        assert f"{name}.origin()" in page, f"{name} is on no page"


def test_every_page_can_be_reached() -> None:
    """From the lists of docs/README.md, which are the sidebar of the HTML too."""
    lists = (DOCS / "README.md").read_text(encoding="utf-8")
    for path in PAGES[1:]:
        name = path.relative_to(DOCS)
        assert name.name == "README.md" or f"]({name})" in lists, f"{name} is in no list"


def test_messages_of_the_page_of_errors_exist() -> None:
    """Each row's message, cut where it varies, consists of texts that the packages contain."""
    sources = "".join(
        "".join(
            c.value if isinstance(c.value, str) else ""
            for c in ast.walk(ast.parse(p.read_text("utf-8")))
            if isinstance(c, ast.Constant)
        )
        for package in PACKAGES
        for p in sorted((ROOT / package).rglob("*.py"))
    )
    page = (DOCS / "reference" / "errors.md").read_text(encoding="utf-8")
    messages = re.findall(r"^\| `([^`]*)` \|", page, re.M)
    assert len(messages) > 25
    for message in messages:
        for part in filter(None, map(str.strip, message.split("…"))):
            assert part in sources, f"no message contains {part!r}"


def test_changelog_and_citation_have_this_version() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    assert f"## {version} " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
