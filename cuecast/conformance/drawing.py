"""Superframes that follow one another: keys and markers, with losses, windows and the lips."""

from collections.abc import Iterator
from typing import Any

from cuecast.conformance.program import Program
from cuecast.conformance.verdict import CaseVerdict, difference, verdict_on, worst

TOLERANCE_MM = 0.01
"""Limit of section 9 for marker positions."""

_HEAD_BYTES = 26
"""Of a stream file, with its checksum (spec/bitstream.md, F1)."""

_TICKS = 32
"""Of a superframe (spec/bitstream.md, G3)."""


def examine_files(program: Program, document: dict[str, Any]) -> Iterator[CaseVerdict]:
    """Yield verdicts on the files of constant superframes in `spec/vectors/stream.json`.

    Their superframes are pushed one by one, as from a carrier; broken ones are lost.
    """
    shown = document["shown"]
    for case in document["cases"]:
        if not case["valid"] or "markers" not in case or not case["span"][2]:
            continue
        first, _, n0, n1 = case["span"]
        data = bytes.fromhex(case["file"])[_HEAD_BYTES:]
        parts = [data[i : i + n0 + n1] for i in range(0, len(data), n0 + n1)]
        superframes = [
            {"index": first // _TICKS + i, "l0": part[:n0].hex(), "l1": part[n0:].hex()}
            for i, part in enumerate(parts)
        ]
        start = _TICKS * (first // _TICKS)
        wanted = {
            start + int(frame): dict(zip(shown, points, strict=True))
            for frame, points in case["markers"].items()
        }
        _push(program, superframes)
        detail = _compare_markers(program, wanted, lips=False)
        group = "losses: markers" if "number" in case["id"] else "superframes: coefficients"
        yield verdict_on(case, group, detail)


def examine_reception(program: Program, document: dict[str, Any]) -> Iterator[CaseVerdict]:
    """Yield verdicts on the cases of `spec/vectors/reception.json`."""
    for case in document["cases"]:
        _push(program, case["superframes"])
        wanted = {
            int(tick): {int(m): point for m, point in points.items()}
            for tick, points in case.get("markers", {}).items()
        }
        detail = _compare_keys(program, case) if "keys" in case else ""
        detail = detail or _compare_markers(program, wanted, lips=case["lips"])
        yield verdict_on(case, case["group"], detail)


def _push(program: Program, superframes: list[dict[str, Any]]) -> None:
    program.ask("reset")
    for superframe in superframes:
        program.ask("push", **superframe)


def _compare_keys(program: Program, case: dict[str, Any]) -> str:
    """Return where the keys that start in each superframe differ."""
    for index, keys in case["keys"].items():
        answer = program.ask("draw", index=int(index), frames=[], lips=0)
        detail = difference(keys, answer.get("keys"))
        if detail:
            return f"keys of superframe {index}{detail}"
    return ""


def _compare_markers(
    program: Program, wanted: dict[int, dict[int, list[float]]], *, lips: bool
) -> str:
    """Return which frame is farther off than the tolerance, empty if none is."""
    for index in sorted({tick // _TICKS for tick in wanted}):
        frames = [tick - _TICKS * index for tick in wanted if tick // _TICKS == index]
        answer = program.ask("draw", index=index, frames=frames, lips=int(lips))
        drawn = answer.get("markers", {})
        for frame in frames:
            points = wanted[_TICKS * index + frame]
            found = drawn.get(str(frame), [])
            if len(found) <= max(points):
                return f"superframe {index}, frame {frame}: no markers"
            off = worst(list(points.values()), [found[m] for m in points])
            if not off <= TOLERANCE_MM:
                return (
                    f"superframe {index}, frame {frame}: a marker is {off:.3f} mm off, the limit "
                    f"is {TOLERANCE_MM} mm"
                )
    return ""
