"""Programs of the native receiver, built once by the machine's compiler."""

import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

NATIVE = Path(__file__).parents[3] / "receiver" / "native"
FLAGS = ("-std=c11", "-O1", "-Wall", "-Wextra", "-Wconversion")
SANITIZE = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@functools.cache
def built(name: str, *flags: str) -> str:
    """Return a program of `tools`, `tests` or `examples`; a warning is an error."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    source = next(NATIVE.glob(f"*/{name}.c"))
    program = Path(tempfile.mkdtemp()) / name
    sources = sorted(str(path) for path in (NATIVE / "src").glob("*.c"))
    command = [
        compiler, *FLAGS, *flags, f"-I{NATIVE / 'include'}", f"-I{NATIVE / 'src'}", str(source),
        *sources, "-lm", "-o", str(program),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr, done.stderr
    return str(program)
