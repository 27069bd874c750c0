"""The native receiver, compiled once per session."""

import importlib.util
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

NATIVE = Path(__file__).resolve().parents[3] / "receiver" / "native"


@pytest.fixture(scope="session")
def build() -> ModuleType:
    """The module `receiver/native/build.py`, which is no part of a package."""
    spec = importlib.util.spec_from_file_location("native_build", NATIVE / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def compiled(build: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Compile a program of `receiver/native` with the library; warnings are errors."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    if not (NATIVE / "src" / "timeline.c").exists():
        pytest.skip("the payload half is not there yet")
    folder = tmp_path_factory.mktemp("native")
    objects = []
    for path in [*build.sources(), *build.vendored()]:
        objects.append(str(folder / f"{path.stem}.o"))
        flags = [*build.WARNINGS, "-O3", "-Werror", *build.includes()]
        subprocess.run([compiler, *flags, "-c", str(path), "-o", objects[-1]], check=True)

    def compile_program(name: str) -> Path:
        out = folder / Path(name).stem
        if not out.exists():
            flags = [*build.WARNINGS, "-O3", "-Werror", *build.includes()]
            files = [str(NATIVE / name), *objects, "-lm", "-o", str(out)]
            subprocess.run([compiler, *flags, *files], check=True)
        return out

    return compile_program


@pytest.fixture(scope="session")
def cue_dec(compiled: Callable[[str], Path]) -> Path:
    """The program that reads sound and prints events."""
    return compiled("tools/cue_dec.c")
