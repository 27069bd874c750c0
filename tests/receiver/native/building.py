"""Programs of the native receiver, built once by the machine's compiler."""

import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

NATIVE = Path(__file__).parents[3] / "receiver" / "native"
FLAGS = ("-std=c11", "-O3", "-Wall", "-Wextra", "-Wconversion")
INCLUDES = tuple(f"-I{NATIVE / name}" for name in ("include", "src", "vendor/monocypher"))
SANITIZE = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@functools.cache
def library(*flags: str) -> tuple[str, str]:
    """Return the compiler and an archive of all sources; a warning is an error."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    archiver = shutil.which("ar")
    if compiler is None or archiver is None:
        pytest.skip("no C compiler")
    folder = Path(tempfile.mkdtemp())
    sources = sorted(str(path) for path in (NATIVE / "src").glob("*.c"))
    _quietly([compiler, *FLAGS, *flags, *INCLUDES, "-c", *sources], folder)
    vendored = sorted(str(path) for path in NATIVE.glob("vendor/*/*.c"))
    _quietly([compiler, "-std=c11", "-O2", "-w", *flags, "-c", *vendored], folder)
    objects = sorted(str(path) for path in folder.glob("*.o"))
    _quietly([archiver, "rcs", "libcuecast.a", *objects], folder)
    return compiler, str(folder / "libcuecast.a")


@functools.cache
def built(name: str, *flags: str) -> str:
    """Return a program of `tools`, `tests` or `examples`; a warning is an error."""
    compiler, archive = library(*flags)
    source = next(NATIVE.glob(f"*/{name}.c"))
    program = Path(archive).parent / name
    _quietly(
        [compiler, *FLAGS, *flags, *INCLUDES, str(source), archive, "-lm", "-o", str(program)],
        program.parent,
    )
    return str(program)


def _quietly(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr, done.stderr
