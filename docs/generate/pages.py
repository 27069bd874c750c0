"""The pages as they are read on a forge: generated ones, and the values that others state."""

import re
from pathlib import Path

import jinja2

from docs.generate.docstrings import package_page
from docs.generate.figures import records
from docs.generate.values import values
from docs.generate.verbs import verb_page

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TEMPLATES = DOCS / "templates"
PACKAGES = ("codec", "synth", "watermark", "receiver", "cuecast")

_VALUE = re.compile(r"(<!-- = (.*?) -->)(.*?)(<!-- / -->)")
_UNITS = (
    r"%|per cent|mm|cm|ms|s|dB|[kM]?bit/s|bits?|bytes?|[kKMG]B|k?Hz|hours?|minutes?|seconds?|px"
    r"|times|frames?|superframes?|keys?|clips?"
)
_FIGURE = re.compile(rf"(?<![\w./-])\d+(?:[.,]\d+)*(?: |\u00a0)?(?:{_UNITS})(?!\w)")
_COUNT = re.compile(r"(?<![\w./-])\d+ of \d+")


def pages() -> dict[Path, str]:
    """Return the text that every page of the project should have now, by path.

    Raises
    ------
    jinja2.UndefinedError
        If a page names a record or value that does not exist.
    """
    found = {DOCS / "reference" / "verbs.md": verb_page()}
    for package in PACKAGES:
        found[DOCS / "reference" / "api" / f"{package}.md"] = package_page(package)
    for template in sorted(TEMPLATES.rglob("*.md")):
        target = DOCS / template.relative_to(TEMPLATES)
        found[target] = expanded(template.read_text(encoding="utf-8"))
    for path in [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]:
        if path not in found and not path.is_relative_to(TEMPLATES):
            found[path] = with_values(path.read_text(encoding="utf-8"))
    return found


def expanded(template: str) -> str:
    """Return a page from its template: records and values by name."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined,
        autoescape=False,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.from_string(template).render({**values(), **records()})


def with_values(text: str) -> str:
    """Return a page with every marked value as the code defines it today.

    A value stands between ``<!-- = NAME -->`` and ``<!-- / -->``, which no reader sees; the name
    is one of `values()`.
    """
    known = values()

    def value(found: re.Match[str]) -> str:
        opening, name, _, closing = found.groups()
        return f"{opening}{known[name]}{closing}"

    return _VALUE.sub(value, text)


def typed_figures(text: str) -> list[str]:
    """Return the figures that a page's author typed: numbers with a unit, counts "N of M".

    Code, comments and marked values do not count.

    Examples
    --------
    >>> typed_figures("7 bytes, `8 bytes`, <!-- = markers -->64 mm<!-- / --> and 61 of 62.")
    ['7 bytes', '61 of 62']
    """
    prose = re.sub(r"\{\{.*?\}\}", " ~ ", _VALUE.sub(" ~ ", text))
    prose = re.sub(r"```.*?```|<!--.*?-->|`[^`\n]*`", " ~ ", prose, flags=re.DOTALL)
    prose = re.sub(r"\]\([^)]*\)", "]", prose)
    found = [*_FIGURE.finditer(prose), *_COUNT.finditer(prose)]
    return [match.group() for match in sorted(found, key=lambda m: m.start())]
