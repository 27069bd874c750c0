"""Tables and vectors keep to the schemas of spec/data/schemas."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from spec.reference.tables import FILE, LANGUAGE, TABLES, n_vowels, using

SPEC = Path(__file__).parents[2] / "spec"
ROW = 32768
"""Sum of a row of frequencies (G5)."""


def schema(name: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(
        (SPEC / "data" / "schemas" / name).read_text(encoding="utf-8")
    )
    jsonschema.Draft202012Validator.check_schema(document)
    return document


def rows(table: list[Any]) -> list[list[int]]:
    """Return all rows of a table of any depth."""
    return [row for part in table for row in rows(part)] if isinstance(table[0], list) else [table]


def test_the_tables_keep_to_their_schema() -> None:
    tables = json.loads(FILE.read_text(encoding="utf-8"))
    jsonschema.validate(tables, schema("tables.schema.json"))
    frequencies = [t for name, t in tables["score"].items() if name != "usual"]
    for table in (*frequencies, tables["coefficient"]["magnitude"]):
        assert {sum(row) for row in rows(table)} == {ROW}
    language = tables["language"]
    assert set(language["phones"][1 : 1 + language["vowels"]]) == set(language["placement"])
    assert set(language["phones"][1 + language["vowels"] :]) == set(language["shape"])


@pytest.mark.parametrize(
    "path", sorted((SPEC / "data/languages").glob("*.json")), ids=lambda p: p.stem
)
def test_other_languages_keep_to_theirs(path: Path) -> None:
    jsonschema.validate(
        json.loads(path.read_text(encoding="utf-8")), schema("language.schema.json")
    )
    with using(path):
        phones, last = LANGUAGE["phones"], n_vowels()
        assert list(LANGUAGE["placement"]) == phones[1 : 1 + last]
        assert list(LANGUAGE["shape"]) == phones[1 + last :]
        places = LANGUAGE["placements"]
        assert {*LANGUAGE["placement"].values(), *LANGUAGE["movement"].values()} < set(places)
        for table in ("first", "next", "left", "length", "pause", "key", "gap", "held", "alone"):
            assert {sum(row) for row in rows(TABLES["score"][table])} == {ROW}


@pytest.mark.parametrize("change", ["phones", "vowels", "placements", "shape"])
def test_other_tables_do_not(change: str) -> None:
    tables = json.loads(FILE.read_text(encoding="utf-8"))
    value = tables["language"][change]
    if isinstance(value, list):
        value.append(value[0])
    elif isinstance(value, dict):
        value.pop(next(iter(value)))
    else:
        tables["language"][change] = value + 1
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tables, schema("tables.schema.json"))


@pytest.mark.parametrize("path", sorted((SPEC / "vectors").glob("*.json")), ids=lambda p: p.stem)
def test_vectors_keep_to_their_schema(path: Path) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    jsonschema.validate(document, schema("vectors.schema.json"))
