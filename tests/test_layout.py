"""The layout's rules, checked."""

import ast
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MAY_IMPORT: dict[str, set[str]] = {
    "codec": set(),
    "watermark": {"codec.compiled", "codec.errors"},
    "synth": {"codec"},
    "receiver": {"codec", "watermark"},
    "cuecast": {"codec", "watermark", "synth", "receiver"},
    "lab": {"codec", "watermark", "synth", "receiver", "cuecast"},
}

CORRIDORS: dict[str, dict[str, set[str]]] = {
    "codec": {
        "files": set(),
        "authentication": {"files"},
        "cues": {"files"},
        "cuer": {"files", "cues"},
        "analysis": {"cuer", "cues"},
        "superframe": {"files", "cues", "cuer"},
        "streamfile": {"superframe", "cues", "cuer"},
        "training": {"superframe", "cuer", "cues"},
    },
    "watermark": {
        "link": set(),
        "quality": set(),
        "audio": {"link", "quality"},
        "video": {"link", "audio"},
        "a335": {"link"},
    },
    "watermark/audio": {
        "signal": set(),
        "search": {"signal"},
        "follow": {"signal", "search"},
        "embed": {"signal", "follow"},
    },
    "synth": {
        "language": set(),
        "motion": set(),
        "planning": {"language", "motion"},
        "units": {"language", "motion", "planning"},
        "capture": {"motion", "planning"},
        "studio": {"language", "motion", "planning", "units"},
        "voices": {"capture", "motion", "planning", "units"},
    },
    "synth/language": {"text": set(), "subtitles": {"text"}},
    "synth/motion": {"body": set(), "rules": {"body"}, "measured": {"body", "rules"}},
    "synth/planning": {
        "prosody": set(),
        "scoring": {"prosody"},
        "alignment": {"prosody", "scoring"},
    },
    "synth/units": {
        "speech": set(),
        "recordings": {"speech"},
        "concatenation": {"recordings", "speech"},
    },
    "synth/capture": {
        "sources": set(),
        "cues": {"sources"},
        "points": {"cues", "sources"},
        "tracker": {"cues", "points", "sources"},
    },
    "receiver": {
        "media": set(),
        "drawing": set(),
        "reception": {"media"},
        "foreign": {"drawing"},
        "export": {"drawing"},
        "television": {"reception", "drawing", "media"},
        "live": {"reception", "media", "television"},
        "native": set(),
        "web": {"drawing", "export", "native"},
    },
    "cuecast": {
        "command": set(),
        "media": {"command"},
        "dubbing": {"command", "media"},
        "live": {"command", "dubbing", "media"},
        "demo": {"command", "dubbing", "media"},
        "evaluate": {"command", "media", "dubbing", "demo"},
        "conformance": set(),
        "practice": {"command", "dubbing", "evaluate"},
        "verbs": {
            "command",
            "conformance",
            "media",
            "dubbing",
            "live",
            "demo",
            "evaluate",
            "practice",
        },
    },
}
"""Who may import whom inside a package, or inside a room: each room, and those it may lean on.

``synth/studio`` and ``synth/voices`` are beside the five rooms of synthesis because `voice build`
and `evaluate` need them at run time: both stand on all the others, neither makes assets. Each
room's docstring states what comes in, what goes out and what it may import.
"""

ENTRIES = {"__init__.py", "__main__.py", "compiled.py", "errors.py"}
"""Files that may lie loose at the root of a package: faces, entry points, what all packages use."""

LOOSE = {"synth/capture": {"capture.py", "options.py"}, "watermark/audio": {"receiver.py"}}
"""Further loose files: what a room's own rooms all take, and what puts them together."""


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def taken(path: Path) -> tuple[tuple[str, str], ...]:
    """Return what a file imports: modules, and what it takes out of each ("" for all of it)."""
    found = []
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: relative import"
            found += [(node.module, alias.name) for alias in node.names]
    return tuple(found)


def imported(path: Path) -> set[str]:
    return {module for module, _ in taken(path) if module.split(".")[0] in MAY_IMPORT}


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
    return {f"{module}.{name}" if name else module for module, name in taken(path)}


@pytest.mark.parametrize("place", CORRIDORS)
def test_corridors(place: str) -> None:
    table = CORRIDORS[place]
    rooms = {path.name for path in (ROOT / place).iterdir() if any(path.glob("*.py"))}
    assert rooms == set(table)
    above = place.split("/")
    for room, open_to in table.items():
        for path in (ROOT / place / room).rglob("*.py"):
            for name in rooms_of(path):
                *parts, room_of_name = name.split(".")[: len(above) + 1]
                if parts == above and room_of_name in table:
                    assert room_of_name in open_to | {room}, f"{path} imports {name}"


@pytest.mark.parametrize("place", CORRIDORS)
def test_corridors_have_no_circles(place: str) -> None:
    table = CORRIDORS[place]
    done: set[str] = set()
    while ready := {room for room in table if room not in done and table[room] <= done}:
        done |= ready
    assert done == set(table)


@pytest.mark.parametrize("place", CORRIDORS)
def test_rooms_have_faces_and_nothing_lies_loose(place: str) -> None:
    entries = LOOSE.get(place, set()) | (ENTRIES if "/" not in place else {"__init__.py"})
    assert {path.name for path in (ROOT / place).glob("*.py")} <= entries
    for room in CORRIDORS[place]:
        assert face_of(ROOT / place / room)


def face_of(room: Path) -> str:
    """Return the docstring of a room on one line."""
    text = (room / "__init__.py").read_text(encoding="utf-8")
    return " ".join((ast.get_docstring(ast.parse(text)) or "").split())


@pytest.mark.parametrize("place", CORRIDORS)
def test_faces_state_input_output_and_imports(place: str) -> None:
    for room, open_to in CORRIDORS[place].items():
        stated = re.search(r"In: .+ Out: .+ May import: (.+?)\.", face_of(ROOT / place / room))
        assert stated, f"{place}/{room}: 'In: ... Out: ... May import: ...' is missing"
        assert set(re.findall(r"`(\w+)`", stated[1])) == open_to, f"{place}/{room}: {stated[1]}"


def test_wheel_holds_the_packages_and_no_lab() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = settings["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert set(wheel) == set(MAY_IMPORT) - {"lab"}


def test_class_names_mean_one_thing() -> None:
    homes: dict[str, list[str]] = {}
    for package in MAY_IMPORT:
        for path in (ROOT / package).rglob("*.py"):
            for node in tree_of(path).body:
                if isinstance(node, ast.ClassDef):
                    homes.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert {name: paths for name, paths in homes.items() if len(paths) > 1} == {}


def test_no_init_under_tests() -> None:
    assert not list((ROOT / "tests").rglob("__init__.py"))


@pytest.mark.parametrize("package", sorted(set(MAY_IMPORT) - {"lab"}))
def test_package_is_ours(package: str) -> None:
    module = __import__(package)
    assert module.__file__ is not None
    assert (Path(module.__file__).parent / "py.typed").exists()
    assert Path(module.__file__).resolve().parent == ROOT / package


SOUND_REFERENCE = {"hearing", "hearing_view", "list_decoder", "marking"}
"""References of sound: a list decoder and thousands of spectra in plain Python would take hours."""


def test_reference_uses_the_standard_library_and_numpy_for_sound_only() -> None:
    for path in (ROOT / "spec" / "reference").rglob("*.py"):
        more = {"spec", "numpy"} if path.stem in SOUND_REFERENCE else {"spec"}
        for module, _ in taken(path):
            top = module.split(".")[0]
            assert top in sys.stdlib_module_names or top in more, f"{path} imports {module}"


def test_kernels_are_compiled_in_one_way() -> None:
    """Numba is imported by the first kernel that runs, and by nothing else."""
    for package in MAY_IMPORT:
        for path in (ROOT / package).rglob("*.py"):
            if path != ROOT / "codec" / "compiled.py":
                found = {name.split(".")[0] for name, _ in taken(path)}
                assert "numba" not in found or path.name == "cache.py", f"{path} imports numba"


def test_inner_kernels_are_called_by_kernels_alone() -> None:
    """They have no way in from Python: calls from there are run as Python, slowly."""
    places = [*MAY_IMPORT, "tests"]
    trees = {path: tree_of(path) for place in places for path in (ROOT / place).rglob("*.py")}
    inner = {
        node.name
        for path, tree in trees.items()
        if path.stem.endswith("_kernels")
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any("inner=True" in ast.unparse(one) for one in node.decorator_list)
    }
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and "_kernels" in ast.unparse(node.value):
                assert node.attr not in inner, f"{path} calls {node.attr}"
            if isinstance(node, ast.ImportFrom) and "_kernels" in (node.module or ""):
                own = path.stem.endswith("_kernels")
                assert own or not inner & {one.name for one in node.names}, path
