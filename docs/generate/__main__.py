"""Builds the pages: fills them in, generates the others, and has Sphinx make HTML of all.

``python -m docs.generate [SITE]``; needs no network. A warning is an error.
``python -m docs.generate --readme`` draws README's figure of a record anew.
"""

import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd.build import main as sphinx

from docs.generate.figures import README_PICTURE, drawings
from docs.generate.pages import DOCS, expanded, generated


def prepare(folder: Path) -> None:
    """Write the sources of all pages, filled in, into an empty folder."""
    for path in sorted(DOCS.rglob("*")):
        place = path.relative_to(DOCS)
        if path.is_dir() or place.parts[0] in ("generate", "records", "__pycache__"):
            continue
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            target.write_text(expanded(path.read_text(encoding="utf-8")), encoding="utf-8")
        else:
            shutil.copy(path, target)
    for name, text in generated().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    for name, drawn in drawings().items():
        target = folder / "figures" / name
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(drawn)


def main(site: str = "site") -> int:
    """Build the pages into the folder `site`; return Sphinx's exit status."""
    if site == "--readme":
        README_PICTURE.write_bytes(drawings()[README_PICTURE.name])
        return 0
    with tempfile.TemporaryDirectory(prefix="cuecast-docs-") as folder:
        prepare(Path(folder))
        return int(sphinx(["-W", "--keep-going", "-q", "-b", "html", folder, site]))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
