"""Programs of the native receiver, built once in a run by the machine's compiler."""

import contextlib
import fcntl
import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

NATIVE = Path(__file__).parents[3] / "receiver" / "native"
FLAGS = ("-std=c11", "-O3", "-Wall", "-Wextra", "-Wconversion")
INCLUDES = tuple(f"-I{NATIVE / name}" for name in ("include", "src", "vendor/monocypher"))
SANITIZE = ("-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""Without optimisation they compile in two fifths of the time of -O1."""
SANITIZE_FAST = ("-O1", *SANITIZE[1:])
"""For long runs."""


@functools.cache
def library(*flags: str) -> tuple[str, str]:
    """Return the compiler and an archive of all sources; a warning is an error."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    archiver = shutil.which("ar")
    if compiler is None or archiver is None:
        pytest.skip("no C compiler")
    with _folder(flags) as folder:
        if not (folder / "libcuecast.a").exists():
            sources = sorted(str(path) for path in (NATIVE / "src").glob("*.c"))
            _quietly([compiler, *FLAGS, *flags, *INCLUDES, "-c", *sources], folder)
            vendored = sorted(str(path) for path in NATIVE.glob("vendor/*/*.c"))
            _quietly([compiler, "-std=c11", "-O2", "-w", *flags, "-c", *vendored], folder)
            objects = sorted(str(path) for path in folder.glob("*.o"))
            _quietly([archiver, "rcs", "libcuecast.a", *objects], folder)
    return compiler, str(folder / "libcuecast.a")


@contextlib.contextmanager
def _folder(flags: tuple[str, ...]) -> Iterator[Path]:
    """Yield the folder of builds with these flags; all workers of a run share it, in turn."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
    name = hashlib.sha256(" ".join([run, *flags]).encode()).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"cuecast-native-{os.getuid()}-{name}"
    folder.mkdir(mode=0o700, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield folder


@functools.cache
def built(name: str, *flags: str) -> str:
    """Return a program of `tools`, `tests` or `examples`; a warning is an error."""
    compiler, archive = library(*flags)
    source = next(NATIVE.glob(f"*/{name}.c"))
    with _folder(flags) as folder:
        program = folder / name
        if not program.exists():
            command = [compiler, *FLAGS, *flags, *INCLUDES, str(source), archive, "-lm"]
            _quietly([*command, "-o", str(program)], folder)
    return str(program)


def _quietly(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr, done.stderr
