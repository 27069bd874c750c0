"""Offline training of the tables: ``python -m codec.train``.

Score tables come from score files (JSON) or from the scores inside motion files. The result is
written to ``codec/assets/tables.json``; changing it changes the format.
"""

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from codec.errors import CueError
from codec.motion import load_motion
from codec.score import Score
from codec.train_coefficients import laplacian_tables
from codec.train_score import train_score

TABLES = Path(__file__).parent / "assets" / "tables.json"


def read_scores(paths: Sequence[str]) -> list[Score]:
    """Return the scores of JSON or motion files."""
    scores = []
    for path in paths:
        if path.endswith(".npz"):
            score = load_motion(path).score
            if score is None:
                raise CueError(f"{path}: motion without a score")
            scores.append(score)
        else:
            scores.append(Score.from_json(Path(path).read_text(encoding="utf-8")))
    return scores


def write_tables(document: dict[str, Any], path: Path = TABLES) -> None:
    """Write the tables, one row of numbers per line, through a temporary name."""
    text = json.dumps(document, separators=(",", ":")).replace("],", "],\n")
    handle, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text + "\n")
    Path(name).chmod(0o644)
    Path(name).replace(path)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the training; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m codec.train", description=__doc__)
    parser.add_argument("scores", nargs="+", help="score (.json) or motion (.npz) files")
    args = parser.parse_args(argv)
    try:
        document = json.loads(TABLES.read_text(encoding="utf-8")) if TABLES.exists() else {}
        document["score"] = train_score(read_scores(args.scores))
        document["coefficient"] = laplacian_tables()
        write_tables(document)
    except CueError as error:
        print(f"codec.train: {error}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
