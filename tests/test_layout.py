"""The layout's rules, checked."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MAY_IMPORT: dict[str, set[str]] = {
    "codec": set(),
    "watermark": {"codec.errors"},
    "synth": {"codec"},
    "receiver": {"codec", "watermark"},
    "cuecast": {"codec", "watermark", "synth", "receiver"},
}

CORRIDORS: dict[str, dict[str, set[str]]] = {
    "codec": {
        "files": set(),
        "authentication": {"files"},
        "cues": set(),
        "cuer": {"files", "cues"},
        "analysis": {"cuer", "cues"},
        "bitstream": {"files", "cues", "cuer"},
        "training": {"bitstream", "cuer", "cues", "files"},
    },
    "watermark": {
        "link": set(),
        "quality": set(),
        "audio": {"link", "quality"},
        "video": {"link", "audio"},
        "a335": {"link"},
    },
    "synth": {
        "text": set(),
        "body": set(),
        "subtitles": {"text"},
        "prosody": {"text", "subtitles", "rules"},
        "speech": {"text"},
        "rules": {"body"},
        "scoring": {"text", "subtitles", "prosody"},
        "alignment": {"text", "subtitles", "prosody", "scoring", "speech"},
        "recordings": {"text", "prosody", "speech", "alignment", "rules"},
        "joined": {"recordings", "rules", "prosody", "speech"},
        "corpus": {"text", "scoring", "speech", "recordings", "body", "rules", "measured"},
        "measured": {"body", "rules"},
        "avatar": {"body", "rules", "scoring"},
        "capture": {"body", "rules", "corpus", "scoring"},
        "training": {
            "alignment",
            "body",
            "capture",
            "corpus",
            "measured",
            "prosody",
            "recordings",
            "rules",
            "scoring",
            "speech",
            "text",
        },
    },
    "receiver": {
        "media": set(),
        "drawing": set(),
        "reception": {"media"},
        "export": {"drawing"},
        "television": {"reception", "drawing", "media"},
        "live": {"reception", "media", "television"},
    },
    "cuecast": {
        "command": set(),
        "media": {"command"},
        "dubbing": {"command", "media"},
        "live": {"command", "dubbing", "media"},
        "demo": {"command", "dubbing", "media"},
        "evaluate": {"command", "media", "dubbing", "demo"},
        "verbs": {"command", "media", "dubbing", "live", "demo", "evaluate"},
    },
}
"""Who may import whom inside a package: each room, and the rooms that it may lean on."""

ENTRIES = {"__init__.py", "__main__.py", "errors.py"}
"""Files that may lie loose at the root of a package: faces, entry points, the exceptions of all."""


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module)
    return {name for name in names if name.split(".")[0] in MAY_IMPORT}


def allowed(name: str, rules: set[str]) -> bool:
    return any(name == rule or name.startswith(f"{rule}.") for rule in rules)


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_layers(package: str) -> None:
    paths = list((ROOT / package).rglob("*.py"))
    assert paths
    for path in paths:
        for name in imported(path):
            assert allowed(name, MAY_IMPORT[package] | {package}), f"{path} imports {name}"


def rooms_of(path: Path) -> set[str]:
    """Return the modules that a file imports, those taken out of packages by their own names."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("package", CORRIDORS)
def test_corridors(package: str) -> None:
    table = CORRIDORS[package]
    rooms = {path.name for path in (ROOT / package).iterdir() if any(path.glob("*.py"))}
    assert rooms == set(table)
    for room, open_to in table.items():
        for path in (ROOT / package / room).rglob("*.py"):
            for name in rooms_of(path):
                parts = name.split(".")
                if parts[0] == package and parts[1] in table:
                    assert parts[1] in open_to | {room}, f"{path} imports {name}"


@pytest.mark.parametrize("package", CORRIDORS)
def test_corridors_have_no_circles(package: str) -> None:
    table = CORRIDORS[package]
    done: set[str] = set()
    while ready := {room for room in table if room not in done and table[room] <= done}:
        done |= ready
    assert done == set(table)


@pytest.mark.parametrize("package", CORRIDORS)
def test_rooms_have_faces_and_nothing_lies_loose(package: str) -> None:
    assert {path.name for path in (ROOT / package).glob("*.py")} <= ENTRIES
    for room in CORRIDORS[package]:
        assert ast.get_docstring(ast.parse((ROOT / package / room / "__init__.py").read_text()))


def test_no_init_under_tests() -> None:
    assert not list((ROOT / "tests").rglob("__init__.py"))


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_package_is_ours(package: str) -> None:
    module = __import__(package)
    assert module.__file__ is not None
    assert (Path(module.__file__).parent / "py.typed").exists()
    assert Path(module.__file__).resolve().parent == ROOT / package


def test_reference_uses_the_standard_library_only() -> None:
    import sys

    for path in (ROOT / "spec" / "reference").rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
            for name in names:
                top = name.split(".")[0]
                assert top in sys.stdlib_module_names or top == "spec", f"{path} imports {name}"
