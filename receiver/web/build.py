"""Build the web component: each entry with all that it imports as one file of `dist`.

In: `src`, the television's drawing scripts in `receiver/page`, the sources of `receiver/native`.
Out: `dist/*.js`, `dist/cuecast.wasm` (with `--wasm`, by zig) and `dist/sources.json`, the SHA-256
of every file that they were made of.

Examples
--------
>>> from receiver.web.build import stale
>>> stale()
[]
"""

import argparse
import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

from codec.cuer.voice import Voice, load_voice
from receiver.native.build import MODULE, build_module, imports_of, source_digest
from receiver.web.voice_files import write_voice

HERE = Path(__file__).resolve().parent
DIST = HERE / "dist"
RECORD = DIST / "sources.json"
README = HERE / "README.md"
WASM = DIST / MODULE.name
STYLES = (HERE.parent / "page" / "style.css", HERE / "src" / "style.css")

ENTRIES = {
    "cuecast-player.js": "element.js",
    "decoder.js": "decoder.js",
    "worker.js": "worker.js",
    "worklet.js": "worklet.js",
}
"""Files of `dist` and the modules of `src` which they begin with."""

_IMPORT = re.compile(r'^import \{([^}]*)\} from "([^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async function|function|class|const) (\w+))", re.MULTILINE)


def style_module() -> str:
    """Return the television's style sheet and the player's as a module, for a shadow tree."""
    sheets = "\n".join(path.read_text(encoding="utf-8") for path in STYLES)
    return f"export const STYLE = {json.dumps(sheets.replace(':root', ':host'))};\n"


def bundle(entry: Path) -> tuple[str, list[Path]]:
    """Join a module with all that it imports.

    Parameters
    ----------
    entry : Path
        A module that imports by names and exports by declarations.

    Returns
    -------
    text : str
        One module without imports.
    sources : list of Path
        The files that it was made of, the entry last.
    """
    order: list[Path] = []
    names: dict[Path, list[str]] = {}
    parts: list[str] = []

    def visit(path: Path) -> None:
        if path in names:
            return
        is_style = path.name == "style.js"
        text = style_module() if is_style else path.read_text(encoding="utf-8")
        names[path] = [match.group(1) for match in _EXPORT.finditer(text)]
        imported = {name: path.parent.joinpath(name).resolve() for _, name in _IMPORT.findall(text)}
        for other in imported.values():
            visit(other)
        order.extend(STYLES if is_style else [path])

        def fetched(match: re.Match[str]) -> str:
            return f"const {{{match.group(1)}}} = {_local(imported[match.group(2)])};\n"

        # Every module becomes a function that returns its exports; imports read from its constant.
        body = _EXPORT.sub("", _IMPORT.sub(fetched, text))
        given = ", ".join(names[path])
        parts.append(f"const {_local(path)} = (() => {{\n{body}return {{ {given} }};\n}})();\n")

    visit(entry.resolve())
    given = ", ".join(names[entry.resolve()])
    ending = f"export const {{ {given} }} = {_local(entry)};\n" if given else ""
    return "\n".join([*parts, ending]), order


def _local(path: Path) -> str:
    return f"${path.stem}"


def reasons_table() -> str:
    """Return the table of reasons why there is no cuer, from `src/reasons.js`."""
    text = (HERE / "src" / "reasons.js").read_text(encoding="utf-8")
    entries = re.findall(r'^  "?([\w-]+)"?: \{\n    en: "((?:[^"\\]|\\.)*)"', text, re.MULTILINE)
    unescaped = ((name, words.replace('\\"', '"').replace("<", "&lt;")) for name, words in entries)
    return "| `reason` | text |\n|---|---|\n" + "".join(f"| `{n}` | {w} |\n" for n, w in unescaped)


def with_tables(text: str) -> str:
    """Return a page with the table between its two comments made anew."""
    pattern = r"(<!-- reasons -->\n).*?(<!-- end of reasons -->)"
    return re.sub(pattern, lambda m: m[1] + reasons_table() + m[2], text, flags=re.DOTALL)


def write_package(folder: Path, voice: Voice) -> None:
    """Write the npm package: the files checked in, with a voice and the licence."""
    (folder / "dist").mkdir(parents=True)
    for name in (*ENTRIES, WASM.name):
        shutil.copyfile(DIST / name, folder / "dist" / name)
    write_voice(folder / "dist", voice)
    (folder / "types").mkdir()
    for path in HERE.glob("types/*.d.ts"):
        shutil.copyfile(path, folder / "types" / path.name)
    for path in (README, HERE / "package.json", HERE.parents[1] / "LICENSE"):
        shutil.copyfile(path, folder / path.name)


def record_of() -> dict[str, str]:
    """SHA-256 of all sources by their path in `receiver`, and of the built files."""
    files = {source for entry in ENTRIES.values() for source in bundle(HERE / "src" / entry)[1]}
    made = [DIST / name for name in ENTRIES] + [WASM]
    digests = {
        path.relative_to(HERE.parent).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted([*files, *made])
    }
    return {**digests, "native sources": source_digest()}


def stale() -> list[str]:
    """Name the sources that changed since `dist` was made; none if it is up to date."""
    known = json.loads(RECORD.read_text(encoding="utf-8"))
    now = record_of()
    return sorted(name for name in known.keys() | now.keys() if known.get(name) != now.get(name))


def main(arguments: list[str] | None = None) -> int:
    """Write `dist`."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--wasm", action="store_true", help="build the module too, by zig")
    parser.add_argument("--module", type=Path, help="take this module, just built")
    parser.add_argument(
        "--package", type=Path, metavar="DIR", help="write a folder for npm publish"
    )
    parser.add_argument("--voice", default="claire", metavar="V", help="the package's cuer")
    chosen = parser.parse_args(arguments)
    DIST.mkdir(exist_ok=True)
    if chosen.wasm:
        build_module(WASM)
    elif chosen.module:
        shutil.copyfile(chosen.module, WASM)
    elif RECORD.exists() and "native sources" in stale():
        print("sources of the module changed: add --wasm", file=sys.stderr)
        return 1
    if imports_of(WASM.read_bytes()):
        print("the module must import nothing", file=sys.stderr)
        return 1
    for name, entry in ENTRIES.items():
        (DIST / name).write_text(bundle(HERE / "src" / entry)[0], encoding="utf-8")
    RECORD.write_text(json.dumps(record_of(), indent=1) + "\n", encoding="utf-8")
    README.write_text(with_tables(README.read_text(encoding="utf-8")), encoding="utf-8")
    if chosen.package:
        write_package(chosen.package, load_voice(chosen.voice))
    return 0


if __name__ == "__main__":
    sys.exit(main())
