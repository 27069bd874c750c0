"""Proofs of `spec/vectors/authentication.json`: steps, tags, checks, announcements, streams."""

import json
from collections.abc import Iterator
from typing import Any

from codec.authentication.layout import time_of
from cuecast.conformance.program import Program
from cuecast.conformance.verdict import CaseVerdict, difference, verdict_on

PROOFS = "proofs"

_LETTERS = {"unknown": "u", "verified": "v", "forged": "f"}
_LOST = -1
"""Stands for a tag that did not arrive."""


def examine_proofs(program: Program, document: dict[str, Any]) -> Iterator[CaseVerdict]:
    """Yield a verdict on each case."""
    files = (case for case in document["cases"] if case["id"].startswith("file"))
    public = next(case["public"] for case in files if case["valid"])
    for case in document["cases"]:
        kind = case["id"].split("-")[0]
        if kind == "step":
            answer = program.ask(
                "step",
                channel=document["channel"],
                period=case["period"],
                width=case["width"],
                block=case["block"],
                key=case["key"],
            )
            expected = {"before": case["before"]}
        elif kind == "tag":
            answer = program.ask(
                "tag",
                channel=document["channel"],
                key=case["key"],
                distance=case["distance"],
                covered=case["covered"],
            )
            expected = {"tag": case["tag"]}
        elif kind == "checks":
            tags = [_LOST if tag is None else tag for tag in case["tags"]]
            answer = program.ask("agree", width=case["width"], checks=case["checks"], tags=tags)
            expected = {"agree": case["agree"]}
        elif kind == "file":
            answer = _trust(program, case["public"])
            first = case["public"]["format"] == "cuecast-key-1"
            expected = {"trusted": case["valid"]}
            if not case["valid"]:
                expected["section"] = "E18" if first else case["section"]
        else:
            _trust(program, public, tolerance_s=case["tolerance_s"])
            answer = {"statuses": _statuses(program, case, document["streams"])}
            expected = {"statuses": case["statuses"]}
        yield verdict_on(case, PROOFS, difference(expected, answer))


def _trust(program: Program, public: dict[str, Any], tolerance_s: float = 10.0) -> dict[str, Any]:
    text = json.dumps(public, indent=1).encode()
    return program.ask("trust", file=text.hex(), tolerance_ms=round(1000 * tolerance_s))


def _statuses(program: Program, case: dict[str, Any], streams: dict[str, Any]) -> str:
    """Return a letter for each superframe of a stream, as the vectors do."""
    stream = streams[str(case["width"])]
    for at, (text, field) in enumerate(zip(stream["covered"], stream["fields"], strict=True)):
        if at in case["lost"]:
            continue
        covered = bytearray.fromhex(text)
        covered[0] ^= at in case["changed"]
        number, age_s = case["first"] + at, case["ages_s"][-1 if at in case["aged"] else 0]
        program.ask(
            "proof",
            index=number,
            covered=covered.hex(),
            field=field,
            width=case["width"],
            utc_ms=round(1000 * (time_of(number) + age_s)),
        )
    found = program.ask("verdicts").get("statuses", {})
    return "".join(
        _LETTERS.get(found.get(str(case["first"] + at), ""), "-")
        for at in range(len(stream["fields"]))
    )
