"""The tables by which the reference decodes (spec/bitstream.md, S11, S12).

Those of version 4, or of another language. `TABLES` and `LANGUAGE` are filled in place: `load`
before anything of another language is decoded.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

DATA = Path(__file__).parents[1] / "data"
FILE = DATA / "tables.json"
TABLES: dict[str, Any] = {}
LANGUAGE: dict[str, Any] = {}

FRENCH = {
    "movement": {},
    "alternatives": ["œ̃", "ə", "œ"],
    "stand_ins": {"consonants": list("dksntlgj"), "vowels": ["a", "i", "ɛ", "ɛ̃", "e"]},
    "common": list("dkʁntlgj"),
}
"""(Table 8) Members of the language that its file may leave out."""


def load(path: Path) -> None:
    """(S11, S12) Take the tables of a file."""
    document = json.loads(path.read_text(encoding="utf-8"))
    LANGUAGE.clear()
    LANGUAGE.update(FRENCH | document["language"])
    TABLES.clear()
    TABLES["language"] = LANGUAGE
    TABLES["score"] = flat() | document.get("score", {})
    own = document if "coefficient" in document else json.loads(FILE.read_text(encoding="utf-8"))
    TABLES["coefficient"] = own["coefficient"]


@contextmanager
def using(path: Path) -> Iterator[None]:
    """Decode by the tables of a file within a block."""
    load(path)
    try:
        yield
    finally:
        load(FILE)


def n_phones() -> int:
    """(Table 7) Return N."""
    return len(LANGUAGE["phones"])


def n_vowels() -> int:
    """(Table 7) Return V."""
    return int(LANGUAGE["vowels"])


def n_placements() -> int:
    """(Table 7) Return L."""
    return len(LANGUAGE["placements"])


def n_shapes() -> int:
    """(Table 7) Return S."""
    shapes: list[int] = [*LANGUAGE["shape"].values(), LANGUAGE["shape_without_consonant"]]
    return 1 + max(shapes)


def silence() -> int:
    """(Table 7) Return Q."""
    return (n_shapes() - 1) * (n_placements() - 1)


def equal(n: int) -> list[int]:
    """(Table 2) Return the frequencies of n equal symbols."""
    return [32768 - (n - 1) * (32768 // n)] + (n - 1) * [32768 // n]


def of_the_language() -> dict[str, Any]:
    """Return what spec/syntax.md calls by these names."""
    return {
        "N": n_phones(),
        "V": n_vowels(),
        "S": n_shapes(),
        "L": n_placements(),
        "Q": silence(),
        "alternatives": LANGUAGE["alternatives"],
        "equal": equal,
    }


def flat() -> dict[str, Any]:
    """(S12) Return the rows of a language of which nothing was counted."""
    n, q = n_phones(), silence()
    return {
        "first": equal(n),
        "next": (n + 1) * [n * [equal(n)]],
        "left": n * [equal(33)],
        "length": n * [4 * [equal(33)]],
        "opening": equal(n),
        "pause": equal(17),
        "usual": n * [80],
        "key": (q + 2) * [equal(q + 2)],
        "gap": (q + 2) * [equal(17)],
        "held": equal(33),
        "alone": equal(q + 1),
    }


load(FILE)
