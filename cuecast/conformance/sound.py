"""Sounds of `spec/vectors/hearing.json`: the superframe that each of them carries."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import soundfile

from cuecast.conformance.program import Program
from cuecast.conformance.verdict import CaseVerdict, verdict_on

SOUND = "sound"


def examine_sound(
    program: Program, document: dict[str, Any], vectors: Path, files: Path
) -> Iterator[CaseVerdict]:
    """Yield a verdict on each sound, which the program gets as raw float32 samples in a file."""
    for case in document["cases"]:
        samples, rate = soundfile.read(vectors / case["file"], dtype="float32", always_2d=True)
        path = files / "sound.f32"
        path.write_bytes(samples.astype("<f4").tobytes())
        answer = program.ask(
            "sound", path=str(path), rate=rate, channels=samples.shape[1], key=case["key"]
        )
        heard = [(s.get("l0"), s.get("l1")) for s in answer.get("superframes", [])]
        detail = ""
        if (case["l0"], case["l1"]) not in heard:
            detail = f"superframe {case['l0'][:16]}.. not heard, got {len(heard)} superframes"
            if any(l0 == case["l0"] for l0, _ in heard):
                detail = f"L0 heard, but not L1 {case['l1'][:16]}.."
        yield verdict_on(case, SOUND, detail)
