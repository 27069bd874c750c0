"""Tables, drawings and single figures of pages, from the records in `docs/records/`."""

import importlib
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from cuecast.evaluate.records import read_record
from cuecast.evaluate.tables import digest, rows_of, write_plot

RECORDS = Path(__file__).resolve().parents[1] / "records"
"""Where the records are."""

DRAWINGS = RECORDS.parent / "figures"
"""Where their drawings are: SVG, which pages show at any size."""

_ELSEWHERE = {
    "day_of_sound": "tests.bench.day_of_sound",
    "false_locks": "tests.bench.false_locks",
    "frugal_sound": "tests.bench.frugal_sound",
    "fuzz": "tests.fuzz.night",
    "mutation": "tests.mutation",
    "picture_peers": "tests.bench.picture_peers",
    "hearing": "tests.spec.hearing_record",
    "hunt": "tests.bench.hunt",
    "receiver": "tests.receiver.native.record",
}
"""What measures kinds of figures that `evaluate` does not."""

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Record:
    """A record under its name, and what pages ask of it."""

    name: str
    document: Mapping[str, Any]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Its results as rows."""
        return rows_of(self.document["results"])

    def where(self, **wanted: Any) -> "Record":
        """Return the record with those rows whose fields are as wanted: a value, or one of a list.

        Raises
        ------
        ValueError
            If there are none: a page would state nothing.
        """
        kept = [row for row in self.rows if all(_fits(row.get(k), v) for k, v in wanted.items())]
        if not kept:
            raise ValueError(f"record {self.name}: no row with {wanted}")
        return Record(self.name, {**self.document, "results": kept})

    def values(self, field: str) -> list[Any]:
        """Return a field of all rows that have it.

        Raises
        ------
        ValueError
            If none has it.
        """
        found = [row[field] for row in self.rows if row.get(field) is not None]
        if not found:
            raise ValueError(f"record {self.name}: no figures called {field!r}")
        return found

    def least(self, field: str) -> Any:
        """Return the least value of a field."""
        return min(self.values(field))

    def most(self, field: str) -> Any:
        """Return the greatest value of a field."""
        return max(self.values(field))

    def total(self, field: str) -> Any:
        """Return the sum of a field."""
        return sum(self.values(field))

    def span(self, field: str, form: str = ".2f") -> str:
        """Return least and greatest value as text, one where they print alike."""
        low, high = format(self.least(field), form), format(self.most(field), form)
        return low if low == high else f"{low} to {high}"

    def ratio(self, field: str, form: str = ".1f") -> str:
        """Return a speed as multiples of that of AAC coding in the same run, least to greatest."""
        yardstick = self.document["machine"]["aac_xrt"]
        shares = [value / yardstick for value in self.values(field)]
        low, high = format(min(shares), form), format(max(shares), form)
        return low if low == high else f"{low} to {high}"

    def table(self, **columns: str) -> str:
        """Return a Markdown table; each column is a format of a row's fields, as ``"{odg:.2f}"``.

        Underscores in a column's name print as spaces.
        """
        heads = [name.replace("_", " ") for name in columns]
        lines = [heads, ["---"] * len(heads)]
        lines += [[_cell(form, row) for form in columns.values()] for row in self.rows]
        return "\n".join("| " + " | ".join(line) + " |" for line in lines)

    def origin(self) -> str:
        """Return how the record came about, in Markdown: enough to make it again."""
        d, m = self.document, self.document["machine"]
        packages = ", ".join(f"{name} {version}" for name, version in m["packages"].items())
        lines = [
            f"Record `{self.name}.json`: `{d['command']}`, seed {d['seed']}, on {d['date']}, "
            f"version {d['version'] or 'unknown'}, commit `{d['commit']}`, "
            f"{m['cores']} × {m['processor']}, "
            f"Python {m['python']}, {packages}.",
            "",
            "| clip | licence | where from | SHA-256 |",
            "|---|---|---|---|",
        ]
        for clip in d["clips"]:
            digest = f"`{clip['sha256'][:16]}…`" if clip["sha256"] else "–"
            licence, source = clip["licence"] or "not stated", clip["source"] or "not stated"
            lines.append(f"| {clip['name']} | {licence} | {source} | {digest} |")
        return "\n".join(lines)

    def drawing(self, text: str) -> str:
        """Return the Markdown of the record's drawing; `text` describes it."""
        return f"![{text}](figures/{self.name}.svg)"


@cache
def records() -> dict[str, Record]:
    """Return all records by name; a dash in a file's name reads as an underscore."""
    paths = sorted(RECORDS.glob("*.json"))
    return {path.stem.replace("-", "_"): Record(path.stem, read_record(path)) for path in paths}


def module(kind: str) -> Any:
    """Return the module that measures a kind of figures and draws them."""
    return importlib.import_module(_ELSEWHERE.get(kind, f"cuecast.evaluate.{kind}"))


def outdated_drawings() -> dict[Path, bytes]:
    """Return drawings, as SVG, of the records whose results are not those of the file in docs/.

    A drawing names its results by a digest: another version of matplotlib alone changes nothing.
    """
    drawn: dict[Path, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        for record in records().values():
            plot: Callable[[Any, Any], None] | None = getattr(
                module(record.document["kind"]), "plot", None
            )
            target = DRAWINGS / f"{record.name}.svg"
            results = record.document["results"]
            if plot is None or (target.is_file() and digest(results) in target.read_text("utf-8")):
                continue
            write_plot(Path(folder) / target.name, results, plot)
            drawn[target] = (Path(folder) / target.name).read_bytes()
    return drawn


def _fits(value: Any, wanted: Any) -> bool:
    listed = isinstance(wanted, Iterable) and not isinstance(wanted, str)
    return value in wanted if listed else value == wanted


def _cell(form: str, row: Row) -> str:
    try:
        return form.format(**row)
    except (TypeError, ValueError, KeyError):
        return "–"  # a figure that this row does not have
