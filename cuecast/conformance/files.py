"""Stream files of `spec/vectors/stream.json`: refusals, keys, phones and markers."""

import zlib
from collections.abc import Iterator
from typing import Any

from cuecast.conformance.drawing import TOLERANCE_MM
from cuecast.conformance.program import Program
from cuecast.conformance.verdict import CaseVerdict, difference, verdict_on, worst

SYNTAX, MARKERS = "files: score", "files: markers"

_TICKS = 32
"""Of a superframe (spec/bitstream.md, G3)."""


def examine_stream_files(program: Program, document: dict[str, Any]) -> Iterator[CaseVerdict]:
    """Yield verdicts on each file; those for voices with other constants are left out."""
    shown = document["shown"]
    for case in document["cases"]:
        if "movement" in case:
            continue
        packed = bytes.fromhex(case["file"])
        data = zlib.decompress(packed) if case.get("packed") else packed
        if not case["valid"]:
            answer = program.ask("file", file=data.hex(), frames=[])
            detail = difference({"valid": False, "section": case["section"]}, answer)
            yield verdict_on(case, SYNTAX, detail)
            continue
        start = case["span"][0] // _TICKS * _TICKS
        first, last = case["span"][0], sum(case["span"][:2]) - 1
        marked = {start + int(frame): points for frame, points in case.get("markers", {}).items()}
        wanted = {tick: points for tick, points in marked.items() if first <= tick <= last}
        answer = program.ask("file", file=data.hex(), frames=list(wanted))
        if case["line"] is not None:
            phones = [phone for phone in case["line"] if phone[0]]
            expected = {"keys": case["keys"], "phones": phones}
            found = {name: answer.get(name) for name in expected}
            yield verdict_on(case, SYNTAX, difference(expected, found))
        if wanted:
            yield verdict_on(case, MARKERS, _compare(wanted, answer.get("markers", {}), shown))


def _compare(wanted: dict[int, list[list[float]]], found: dict[str, Any], shown: list[int]) -> str:
    """Return which frame is farther off than the tolerance, empty if none is."""
    for tick, points in wanted.items():
        markers = found.get(str(tick), [])
        if len(markers) <= max(shown):
            return f"tick {tick}: no markers"
        off = worst(points, [markers[m] for m in shown])
        if not off <= TOLERANCE_MM:
            return f"tick {tick}: a marker is {off:.3f} mm off, the limit is {TOLERANCE_MM} mm"
    return ""
