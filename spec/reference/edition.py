"""The hashes of all binding files, so that none changes unnoticed.

``python -m spec.reference.edition`` writes them to ``spec/edition.json``, as long as its status is
"draft". "frozen" is set by hand, once: from then on only ``--mends`` writes, which a new entry in
``spec/changes.md`` has to justify.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

SPEC = Path(__file__).parents[1]
FILE = SPEC / "edition.json"
BINDING = (
    "README.md", "bitstream.md", "voice.md", "audio-carrier.md", "video-carrier.md",
    "a335-carrier.md", "authentication.md", "hearing.md",
)  # fmt: skip
"""Documents that README calls binding, and itself."""


def hashes() -> dict[str, str]:
    """Return the SHA-256 of each binding document, of all data and vectors, by its path."""
    folders = (SPEC / "data", SPEC / "vectors")
    others = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    paths = sorted([*(SPEC / name for name in BINDING), *others])
    return {
        path.relative_to(SPEC).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in paths
    }


def stated() -> dict[str, Any]:
    """Return what the file of the edition says."""
    document: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return document


def main(arguments: list[str]) -> None:
    """Write the hashes of today's files."""
    document = stated() if FILE.exists() else {"edition": 2, "status": "draft"}
    if document["status"] == "frozen" and arguments != ["--mends"]:
        sys.exit("the format is frozen: words and vectors are mended with --mends")
    document["files"] = hashes()
    FILE.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
