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
