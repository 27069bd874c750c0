"""Writes the generated pages, or checks them, or makes HTML of all pages.

``python -m docs.generate`` writes pages and drawings into docs/ as a forge shows them;
``python -m docs.generate --check`` lists those that would change, with exit status 1;
``python -m docs.generate SITE`` has Sphinx build HTML into the folder SITE, warnings as errors.
No network is used.
"""

import re
import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd.build import main as sphinx

from docs.generate.figures import outdated_drawings
from docs.generate.pages import DOCS, ROOT, pages

_LINK = re.compile(r"\]\(([\w/.-]+?)\.md\)")
_FRONT = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")


def outdated() -> dict[Path, bytes]:
    """Return the files that differ from what the code and the records say, with their bytes."""
    texts = {path: text.encode() for path, text in pages().items()}
    changed = {p: d for p, d in texts.items() if not p.is_file() or p.read_bytes() != d}
    return changed | outdated_drawings()


def prepare(folder: Path) -> None:
    """Copy all pages into a folder, placed as in the repository, so that their links hold.

    README becomes the front page; the contents of the sidebar follow the lists of docs/README.md.
    """
    for name in _FRONT:
        shutil.copy(ROOT / name, folder / ("index.md" if name == "README.md" else name))
    for part in ("docs", "spec"):
        for path in sorted((ROOT / part).rglob("*")):
            place = path.relative_to(ROOT)
            apart = {"templates", "data"} & set(place.parts)
            if path.suffix in (".md", ".png", ".svg") and not apart:
                (folder / place).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, folder / place)
    lists = folder / "docs" / "README.md"
    lists.write_text(lists.read_text("utf-8").replace("(../README.md)", "(../index.md)"), "utf-8")
    shutil.copytree(DOCS / "static", folder / "static")
    shutil.copy(DOCS / "conf.py", folder)
    with (folder / "index.md").open("a", encoding="utf-8") as front:
        front.write(_contents((DOCS / "README.md").read_text(encoding="utf-8")))


def _contents(lists: str) -> str:
    """Return hidden tables of contents: one for each heading above links to pages."""
    tables = ["\n```{toctree}\n:hidden:\n\ndocs/README\n```\n"]
    for part in lists.split("\n## ")[1:]:
        title = part.splitlines()[0]
        linked = [(DOCS / f"{name}.md").resolve() for name in _LINK.findall(part)]
        names = "\n".join(str(path.relative_to(ROOT).with_suffix("")) for path in linked)
        tables.append(f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{names}\n```\n")
    return "".join(tables)


def main(what: str = "") -> int:
    """Do what the module's docstring says; return the exit status."""
    if what and what != "--check":
        with tempfile.TemporaryDirectory(prefix="cuecast-docs-") as folder:
            prepare(Path(folder))
            return int(sphinx(["-W", "--keep-going", "-q", "-b", "html", folder, what]))
    changed = outdated()
    for path, data in changed.items():
        print(path.relative_to(ROOT))
        if not what:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    return int(bool(what and changed))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
