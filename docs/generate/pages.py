"""Pages made whole by what is generated, and the rule that nobody types a figure."""

import ast
import importlib
import inspect
import re
from itertools import pairwise
from pathlib import Path

import jinja2

from docs.generate.figures import records
from docs.generate.values import values
from docs.generate.verbs import verb_page

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PACKAGES = ("codec", "synth", "watermark", "receiver", "cuecast")

_UNITS = (
    r"%|per cent|mm|cm|ms|s|dB|[kM]?bit/s|bits?|bytes?|[kKMG]B|k?Hz|hours?|minutes?|seconds?|px"
    r"|times|frames?|superframes?|keys?|clips?"
)
_FIGURE = re.compile(rf"(?<![\w./-])\d+(?:[.,]\d+)*(?: |\u00a0)?(?:{_UNITS})(?!\w)")
_COUNT = re.compile(r"(?<![\w./-])\d+ of \d+")


def expanded(text: str) -> str:
    """Return the text of a page with its figures, values and API filled in.

    Raises
    ------
    jinja2.UndefinedError
        If the page names a record or value that does not exist.
    """
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, autoescape=False, keep_trailing_newline=True
    )
    names = {"api": api, "face": face, **values(), **records()}
    return environment.from_string(text).render(names)


def api(package: str) -> str:
    """Return the directives that document a package's face, name by name."""
    module = importlib.import_module(package)
    parts = []
    for name in sorted(module.__all__, key=str.lower):
        item = getattr(module, name)
        if inspect.isclass(item):
            body = f"```{{eval-rst}}\n.. autoclass:: {package}.{name}\n   :members:\n```"
        elif inspect.isfunction(item):
            body = f"```{{eval-rst}}\n.. autofunction:: {package}.{name}\n```"
        else:
            body = said_of(package, name)
        parts.append(f"## `{name}`\n\n{body}")
    return "\n\n".join(parts)


def said_of(package: str, name: str) -> str:
    """Return the text that stands below the definition of a constant or type of a face.

    Raises
    ------
    LookupError
        If there is none.
    """
    home = importlib.import_module(package)._HOMES.get(name, package).partition(":")[0]
    body = ast.parse(inspect.getsource(importlib.import_module(home))).body
    for node, after in pairwise(body):
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        if name in (getattr(target, "id", None) for target in targets):
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                return str(after.value.value)
            break
    raise LookupError(f"{home}.{name} says nothing of itself")


def face(package: str) -> str:
    """Return what a package says of itself, with its example, in Markdown."""
    lines: list[str] = []
    inside = False
    text = inspect.cleandoc(importlib.import_module(package).__doc__ or "")
    for line in text.replace("Examples\n--------\n", "").splitlines():
        starts = line.startswith(">>> ")
        if starts and not inside:
            lines.append("```pycon")
        inside = inside or starts
        lines.append(line)
    return "\n".join([*lines, *(["```"] if inside else [])])


def typed_figures(text: str) -> list[str]:
    """Return the figures that a page's author typed: numbers with a unit, counts of so many.

    Code, comments and what is generated do not count.

    Examples
    --------
    >>> typed_figures("It takes 7 bytes, `8 bytes`, {{ superframe_s }} s and 61 of 62.")
    ['7 bytes', '61 of 62']
    """
    prose = re.sub(r"```.*?```|<!--.*?-->|\{\{.*?\}\}|`[^`\n]*`", " ~ ", text, flags=re.DOTALL)
    prose = re.sub(r"\]\([^)]*\)", "]", prose)
    found = [*_FIGURE.finditer(prose), *_COUNT.finditer(prose)]
    return [match.group() for match in sorted(found, key=lambda m: m.start())]


def generated() -> dict[str, str]:
    """Return the pages that nobody wrote for `docs/`, by their path there."""
    pages = {"reference/verbs.md": verb_page()}
    for name, source in (("changelog.md", "CHANGELOG.md"), ("contributing.md", "CONTRIBUTING.md")):
        pages[name] = (ROOT / source).read_text(encoding="utf-8")
    for path in sorted((ROOT / "spec").glob("*.md")):
        name = "index.md" if path.name == "README.md" else path.name
        pages[f"spec/{name}"] = path.read_text(encoding="utf-8")
    return pages
