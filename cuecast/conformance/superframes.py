"""Superframes of `spec/vectors/superframe.json`: integers, and the paragraph that is broken."""

from collections.abc import Iterator
from typing import Any

from cuecast.conformance.program import Program
from cuecast.conformance.verdict import CaseVerdict, difference, verdict_on

SCORE, COEFFICIENTS = "superframes: score", "superframes: coefficients"

FIELDS = {
    SCORE: ("header", "slow", "score", "previews"),
    COEFFICIENTS: ("setting", "indices", "values"),
}
"""Fields of a vector that each group compares."""


def examine_superframes(program: Program, document: dict[str, Any]) -> Iterator[CaseVerdict]:
    """Yield a verdict on each case and group."""
    program.ask(
        "bases",
        identity=document["identity"],
        channels=len(document["bases"][0]),
        scales=[x for basis in document["bases"] for row in basis for x in row],
    )
    for case in document["cases"]:
        answer = program.ask("superframe", l0=case["l0"], l1=case["l1"])
        if not case["valid"]:
            yield _refusal(case, answer)
            continue
        for group, names in FIELDS.items():
            if answer.get("valid") is not True:
                detail = f"valid part refused by {answer.get('section', 'no paragraph')}"
            else:
                wanted = {name: case[name] for name in names}
                found = {name: answer[name] for name in names if name in answer}
                detail = difference(wanted, found)
            yield verdict_on(case, group, detail)


def _refusal(case: dict[str, Any], answer: dict[str, Any]) -> CaseVerdict:
    """Return the verdict on a part that breaks a rule."""
    section = case["section"]
    detail = ""
    if answer.get("valid") is not False:
        detail = f"accepted, though it violates {section}"
    elif answer.get("section") != section:
        detail = f"refused by {answer.get('section')}, it violates {section}"
    return verdict_on(case, SCORE, detail)
