"""The Python reference in Markdown, from the docstrings of what each package exports."""

import ast
import importlib
import inspect
import re
import textwrap
from itertools import pairwise
from typing import Any

_SECTION = re.compile(r"^([A-Z][A-Za-z ]+)\n-{3,}$", re.M)
_LISTED = ("Parameters", "Attributes", "Returns", "Yields", "Raises")
_LINE = 88
"""Characters of a call that stands in one line; longer ones have an argument in each."""

_ITEM = re.compile(r"^(\S.*?)(?: : (.*))?$")


def package_page(package: str) -> str:
    """Return the page of a package: its docstring, then every exported name.

    Parameters
    ----------
    package : str
        Name of a package with ``__all__``.

    Returns
    -------
    str
        Markdown; each name is a heading of the second level, each method one of the third.
    """
    module = importlib.import_module(package)
    parts = [f"# Python: `{package}`", as_markdown(inspect.getdoc(module) or "")]
    for name in sorted(module.__all__, key=str.lower):
        item = getattr(module, name)
        parts.append(f"## `{name}`")
        if inspect.isclass(item):
            parts += _class(name, item)
        elif callable(item) and inspect.getdoc(item):
            parts += [_signature(name, item), as_markdown(inspect.getdoc(item) or "")]
        else:
            parts.append(docstring_of_constant(package, name))
    return "\n\n".join(part for part in parts if part) + "\n"


def as_markdown(docstring: str) -> str:
    r"""Return a docstring in numpydoc's form as Markdown.

    Examples
    --------
    >>> print(as_markdown("Return it.\n\nParameters\n----------\nx : int\n    In mm."))
    Return it.
    <BLANKLINE>
    **Parameters**
    <BLANKLINE>
    - `x` (int): In mm.
    """
    lead, *rest = _SECTION.split(docstring)
    parts = [_with_examples(lead.strip())]
    for title, body in zip(rest[::2], rest[1::2], strict=True):
        listed = title in (
            "Parameters",
            "Attributes",
            "Returns",
            "Yields",
            "Raises",
            "Other Parameters",
        )
        text = _items(body.strip("\n")) if listed else _with_examples(body.strip())
        parts += [f"**{title}**", text]
    return "\n\n".join(part for part in parts if part)


def docstring_of_constant(package: str, name: str) -> str:
    """Return the text below the definition of a constant or type that a package exports.

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
                return inspect.cleandoc(str(after.value.value))
            break
    raise LookupError(f"{home}.{name} has no docstring")


def _class(name: str, item: type) -> list[str]:
    parts = [_signature(name, item), as_markdown(inspect.getdoc(item) or "")]
    for method, member in vars(item).items():
        if method.startswith("_"):
            continue
        target = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if isinstance(target, property):
            target = target.fget
        if inspect.isfunction(target) and target.__doc__:
            parts.append(f"### `{name}.{method}`")
            if not isinstance(member, property):
                parts.append(_signature(method, target))
            parts.append(as_markdown(inspect.getdoc(target) or ""))
    return parts


def _signature(name: str, item: Any) -> str:
    """Return a call with the names of its arguments; their types are in the docstring."""
    try:
        found = inspect.signature(item)
    except (TypeError, ValueError):
        return ""
    bare = [
        argument.replace(annotation=inspect.Parameter.empty, default=_default(argument.default))
        for argument in found.parameters.values()
        if argument.name not in ("self", "cls")
    ]
    call = f"{name}{inspect.Signature(bare)}"
    if len(call) > _LINE:
        call = f"{name}(\n" + "".join(f"    {argument},\n" for argument in bare) + ")"
    return f"```python\n{call.replace('Ellipsis', '...')}\n```"


def _default(value: Any) -> Any:
    """Return a default that is short to read; an ellipsis stands for an object."""
    plain = value is inspect.Parameter.empty or re.fullmatch(r"[^<]{,30}", repr(value))
    return value if plain else ...


def _items(body: str) -> str:
    """Return the entries of a section as a list: a name or type, then an indented description."""
    lines: list[str] = []
    for line in textwrap.dedent(body).splitlines():
        if line and not line[0].isspace():
            found = _ITEM.match(line)
            assert found is not None
            name, kind = found.groups()
            lines.append(f"- `{name}`" + (f" ({kind})" if kind else ""))
        elif line.strip() and lines:
            joint = " " if ": " in lines[-1] or not lines[-1].startswith("- ") else ": "
            lines[-1] += joint + line.strip()
    return "\n".join(lines)


def _with_examples(text: str) -> str:
    """Return text with its interactive examples as blocks of code."""
    lines: list[str] = []
    inside = False
    for line in text.splitlines():
        if line.startswith(">>> ") and not inside:
            lines += ["```pycon"]
            inside = True
        elif inside and not line.strip():
            lines += ["```"]
            inside = False
        lines.append(line)
    return "\n".join([*lines, *(["```"] if inside else [])])
