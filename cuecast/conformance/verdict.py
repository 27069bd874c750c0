"""Verdicts on cases, and the class that a decoder reaches."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

CLASSES: dict[str, tuple[str, ...]] = {
    "keys": ("superframes: score", "losses: keys"),
    "markers": ("superframes: coefficients", "losses: markers", "windows"),
    "picture": ("lips",),
    "files": ("files: score", "files: markers"),
    "proofs": ("proofs",),
    "hearing 1": ("sound",),
}
"""Groups of cases by class of section 9; the first three need those before them, too."""


@dataclass(frozen=True, slots=True)
class CaseVerdict:
    """What became of one case.

    Attributes
    ----------
    case, group : str
        Name of the case, and the group that it belongs to.
    section : str
        Paragraphs that it tests, or the one that is violated where that is known.
    passed : bool
    detail : str
        The expected and the received value; empty where it passed.
    suggests : str
        Where to look if it did not.
    """

    case: str
    group: str
    section: str
    passed: bool
    detail: str = ""
    suggests: str = ""


def verdict_on(case: dict[str, Any], group: str, detail: str) -> CaseVerdict:
    """Return the verdict on a case of a vector file; no detail means that it passed."""
    suggests = case.get("failure_suggests", "") if detail else ""
    return CaseVerdict(case["id"], group, case["section"], not detail, detail, suggests)


@dataclass(frozen=True, slots=True)
class ConformanceReport:
    """All verdicts on one decoder.

    Attributes
    ----------
    name : str
        The decoder's name for itself.
    verdicts : tuple of CaseVerdict
    skipped : tuple of str
        Groups that the decoder says it does not do.
    """

    name: str
    verdicts: tuple[CaseVerdict, ...]
    skipped: tuple[str, ...] = ()

    @property
    def failed(self) -> tuple[CaseVerdict, ...]:
        """Verdicts of cases that did not pass."""
        return tuple(v for v in self.verdicts if not v.passed)

    def reached(self) -> tuple[str, ...]:
        """Return the classes whose groups were all tested and passed, in their order.

        Examples
        --------
        >>> fine = [CaseVerdict("a", group, "", True) for group in CLASSES["keys"]]
        >>> ConformanceReport("one", tuple(fine)).reached()
        ('keys',)
        >>> ConformanceReport("one", (*fine, CaseVerdict("b", "lips", "K3", False))).reached()
        ('keys',)
        """
        tested = Counter(v.group for v in self.verdicts)
        broken = {v.group for v in self.failed}
        found = []
        for name, groups in CLASSES.items():
            if not all(tested[group] for group in groups) or broken & set(groups):
                continue
            found.append(name)
        chain = list(CLASSES)[:3]
        whole = next((i for i, name in enumerate(chain) if name not in found), len(chain))
        return tuple(name for name in found if name not in chain[whole:])

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON."""
        return {
            "decoder": self.name,
            "classes": list(self.reached()),
            "groups": self.counts(),
            "skipped": list(self.skipped),
            "failed": [asdict(v) for v in self.failed],
        }

    def counts(self) -> dict[str, dict[str, int]]:
        """Return cases and passed ones by group."""
        groups: dict[str, dict[str, int]] = {}
        for verdict in self.verdicts:
            count = groups.setdefault(verdict.group, {"cases": 0, "passed": 0})
            count["cases"] += 1
            count["passed"] += verdict.passed
        return groups


def difference(expected: Any, found: Any) -> str:
    """Return where two values differ, empty if they do not.

    Examples
    --------
    >>> difference([1, 2], [1, 3]), difference({"a": [0]}, {"a": [0]})
    ('[1]: 2 expected, got 3', '')
    >>> difference({"a": 1}, {"b": 1})
    '.a: 1 expected, got nothing'
    """
    if isinstance(expected, dict) and isinstance(found, dict):
        for name in [*expected, *(n for n in found if n not in expected)]:
            if name not in found or name not in expected:
                given = found.get(name, "nothing")
                return f".{name}: {expected.get(name, 'nothing')} expected, got {given}"
            inside = difference(expected[name], found[name])
            if inside:
                return f".{name}{inside}"
        return ""
    if isinstance(expected, list) and isinstance(found, list):
        for i, (one, two) in enumerate(zip(expected, found, strict=False)):
            inside = difference(one, two)
            if inside:
                return f"[{i}]{inside}"
        if len(expected) != len(found):
            return f": {len(expected)} items expected, got {len(found)}"
        return ""
    return "" if expected == found else f": {expected} expected, got {found}"


def worst(points: Sequence[Sequence[float]], others: Sequence[Sequence[float]]) -> float:
    """Return the greatest distance between points of the same number, mm.

    Examples
    --------
    >>> worst([(0, 0, 0), (1, 2, 3)], [(0, 0, 0), (1, 2, 3.5)])
    0.5
    """
    return max(math.dist(a, b) for a, b in zip(points, others, strict=True))
