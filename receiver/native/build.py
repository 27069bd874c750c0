"""Build the native receiver: tool and plug-in with any C compiler, library and module with zig.

In: the sources beside this file. Out: a program, a shared library, or `dist/cuecast.wasm` with
`dist/cuecast.json`, which names the sources that it was made of.

zig comes from PyPI (``pip install --group native``) and is needed to build only; the module is
reproducible: the same sources and the same zig give the same bytes.

Examples
--------
>>> from receiver.native.build import exported
>>> "cue_push" in exported() and "cue_push_planar" in exported()
True
"""

import argparse
import gzip
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path

HERE = Path(__file__).resolve().parent
MODULE, RECORD = HERE / "dist" / "cuecast.wasm", HERE / "dist" / "cuecast.json"

WARNINGS = ["-std=c11", "-Wall", "-Wextra", "-Wconversion"]
"""Flags under which every compiler must be silent, but for sources of others."""

VENDORED = ["-std=c11", "-w"]
"""Flags for the sources of others, which are kept as they came."""

HOT = {"acquire"}
"""Sources that are compiled for speed in a small module: the search takes most of the time; the
others run as fast when compiled for size (24 s of marked sound in .34 to .36 s in node)."""

LARGEST_BYTES = 60 * 1024
"""Limit of the compressed module."""


def sources() -> list[Path]:
    """List the sources of the library, in a fixed order."""
    return sorted((HERE / "src").glob("*.c"))


def source_digest() -> str:
    """SHA-256 over names and contents of all sources and headers, in hexadecimal."""
    digest = hashlib.sha256()
    for path in sorted(
        [*HERE.glob("src/*.[ch]"), *HERE.glob("include/*.h"), *HERE.glob("vendor/*/*.[ch]")]
    ):
        digest.update(path.relative_to(HERE).as_posix().encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def exported() -> list[str]:
    """Names of the functions that the header declares."""
    header = (HERE / "include" / "cuecast.h").read_text(encoding="utf-8")
    code = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    return sorted(
        set(re.findall(r"\b(cue_\w+)\([^()]*(?:\[\w*\])?[^()]*\)\s*(?:CUE_NONNULL|;)", code))
    )


def includes() -> list[str]:
    """Search paths of headers."""
    vendored = [f"-I{path}" for path in sorted((HERE / "vendor").glob("*")) if path.is_dir()]
    return [f"-I{HERE / 'include'}", f"-I{HERE / 'src'}", *vendored]


def build_tool(compiler: list[str], out: Path, *, flags: tuple[str, ...] = ("-O3",)) -> None:
    """Build `tools/cue_dec.c` with a compiler.

    Parameters
    ----------
    compiler : list of str
        Its command.
    out : Path
        The program.
    flags : tuple of str
        Further ones.

    Raises
    ------
    subprocess.CalledProcessError
        If it fails.
    """
    files = [str(path) for path in [*sources(), HERE / "tools" / "cue_dec.c"]]
    with tempfile.TemporaryDirectory() as name:
        objects = [f"{name}/{path.stem}.o" for path in vendored()]
        for path, made in zip(vendored(), objects, strict=True):
            subprocess.run([*compiler, *VENDORED, *flags, "-c", str(path), "-o", made], check=True)
        subprocess.run(
            [*compiler, *WARNINGS, *flags, *includes(), *files, *objects, "-lm", "-o", str(out)],
            check=True,
        )


def vendored() -> list[Path]:
    """List sources of others."""
    return sorted((HERE / "vendor").glob("*/*.c"))


def zig(*arguments: str) -> None:
    """Run zig's C compiler."""
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *arguments], check=True)


def build_library(folder: Path) -> Path:
    """Build a shared library for this machine; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / {"win32": "cuecast.dll", "darwin": "libcuecast.dylib"}.get(
        sys.platform, "libcuecast.so"
    )
    shared = ["-O3", "-fPIC"]
    with tempfile.TemporaryDirectory() as name:
        objects = [f"{name}/{path.stem}.o" for path in vendored()]
        for path, made in zip(vendored(), objects, strict=True):
            zig(*shared, *VENDORED, "-c", str(path), "-o", made)
        files = [*map(str, sources()), *objects]
        zig(*shared, "-s", "-shared", *WARNINGS, *includes(), *files, "-o", str(out))
    return out


def build_plugin(compiler: list[str], folder: Path) -> Path:
    """Build the GStreamer element of `plugin` with a compiler and pkg-config; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / "libgstcuecast.so"
    asked = ["pkg-config", "--cflags", "--libs", "gstreamer-audio-1.0"]
    found = subprocess.run(asked, check=True, capture_output=True, text=True).stdout.split()
    headers = [f"-isystem{flag[2:]}" for flag in found if flag.startswith("-I")]
    libraries = [flag for flag in found if flag.startswith("-l")]
    shared = ["-O3", "-fPIC", "-fvisibility=hidden"]
    with tempfile.TemporaryDirectory() as name:
        objects = []
        for path in [*sources(), *vendored(), HERE / "plugin" / "gstcuecast.c"]:
            flags = VENDORED if path in vendored() else [*WARNINGS, *includes(), *headers]
            objects.append(f"{name}/{path.stem}.o")
            command = [*compiler, *shared, *flags, "-c", str(path), "-o", objects[-1]]
            subprocess.run(command, check=True)
        command = [*compiler, "-shared", *objects, *libraries, "-lm", "-o", str(out)]
        subprocess.run(command, check=True)
    return out


WASM = ["-target", "wasm32-wasi", "-msimd128", "-ffp-contract=off"]
STACK = "-Wl,-z,stack-size=262144"


def _wasm_objects(folder: str) -> list[str]:
    """Compile all sources for WebAssembly; return the objects."""
    objects = []
    for path in [*sources(), *vendored()]:
        level = ["-O2", "-fno-unroll-loops"] if path.stem in HOT else ["-Os"]
        objects.append(f"{folder}/{path.stem}.o")
        flags = WARNINGS if path in sources() else [*VENDORED, "-ffunction-sections"]
        zig(*WASM, *level, *flags, *includes(), "-c", str(path), "-o", objects[-1])
    return objects


def build_module(out: Path) -> None:
    """Build the WebAssembly module: no imports, its memory above `__heap_base` is the host's."""
    keep = [f"-Wl,--export={symbol}" for symbol in [*exported(), "__heap_base"]]
    link = ["-Os", "-s", "-mexec-model=reactor", "-Wl,--no-entry", "-Wl,--gc-sections", STACK]
    with tempfile.TemporaryDirectory() as name:
        zig(*WASM, *link, *keep, *_wasm_objects(name), "-o", f"{name}/cuecast.wasm")
        out.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(f"{name}/cuecast.wasm", out)


def build_conformer(out: Path) -> None:
    """Build `tools/cue_conform.c` for `tools/cue_conform.mjs`: the module's objects under WASI."""
    tool = str(HERE / "tools" / "cue_conform.c")
    with tempfile.TemporaryDirectory() as name:
        objects = _wasm_objects(name)
        zig(*WASM, "-Os", "-s", STACK, *WARNINGS, *includes(), tool, *objects, "-o", str(out))


def imports_of(module: bytes) -> int:
    """Count the imports of a WebAssembly module.

    Raises
    ------
    ValueError
        If the bytes are no module.
    """
    if module[:8] != b"\0asm\x01\0\0\0":
        raise ValueError("no WebAssembly module of version 1")

    def number(at: int) -> tuple[int, int]:
        value, shift = 0, 0
        while True:
            byte = module[at]
            value, shift, at = value | (byte & 127) << shift, shift + 7, at + 1
            if byte < 128:
                return value, at

    at = 8
    while at < len(module):
        kind = module[at]
        size, at = number(at + 1)
        if kind == 2:
            return number(at)[0]
        at += size
    return 0


def record_of(module: bytes) -> dict[str, str | int]:
    """State a module's digest, its size and its sources."""
    return {
        "sources": source_digest(),
        "module": hashlib.sha256(module).hexdigest(),
        "bytes": len(module),
        "compressed": len(gzip.compress(module, 9, mtime=0)),
        "zig": metadata.version("ziglang"),
    }


def main(arguments: list[str] | None = None) -> int:
    """Build the target of the command line."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    kinds = ["tool", "library", "plugin", "wasm", "conform"]
    parser.add_argument("what", choices=kinds)
    parser.add_argument("-o", "--out", type=Path, default=HERE / "dist")
    parser.add_argument("--cc", default="cc", help="compiler of tool and plug-in")
    chosen = parser.parse_args(arguments)
    if chosen.what == "tool":
        chosen.out.mkdir(parents=True, exist_ok=True)
        build_tool(chosen.cc.split(), chosen.out / "cue_dec")
    elif chosen.what == "library":
        build_library(chosen.out)
    elif chosen.what == "plugin":
        build_plugin(chosen.cc.split(), chosen.out)
    elif chosen.what == "conform":
        chosen.out.mkdir(parents=True, exist_ok=True)
        build_conformer(chosen.out / "cue_conform.wasm")
    else:
        build_module(chosen.out / MODULE.name)
        module = (chosen.out / MODULE.name).read_bytes()
        record = record_of(module)
        (chosen.out / RECORD.name).write_text(json.dumps(record, indent=1) + "\n")
        print(f"{record['bytes']} bytes, {record['compressed']} compressed")
        if int(record["compressed"]) > LARGEST_BYTES or imports_of(module):
            print(f"limits: {LARGEST_BYTES} bytes compressed, no imports", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
