"""The plain decoder as a program of `cuecast conform`: ``python -m spec.reference.conform``."""

import json
import sys
from pathlib import Path
from typing import Any

from spec.reference.markers import Array, markers, read_voice
from spec.reference.motion import BASES, read_coding
from spec.reference.reception import (
    line_of_windows,
    line_with_holes,
    lips,
    parameters,
    reported,
    scores_near,
)
from spec.reference.superframe import Decoded, MalformedError, decode

Answer = dict[str, Any]


class Plain:
    """Answers requests by the modules of this folder."""

    def __init__(self) -> None:
        self.bases: list[list[list[int]]] = []
        self.identity = ""
        self.own: list[list[list[int]]] = []
        self.own_identity = ""
        self.voice: dict[str, Array] = {}
        self.coding: dict[str, Array] = {}
        self.parts: dict[int, Decoded] = {}

    def answer(self, request: Answer) -> Answer:
        """Return the answer to a request."""
        what = request["do"]
        if what == "hello":
            does = ["superframe", "draw"]
            return {"name": "reference", "protocol": 1, "format": 4, "does": does}
        if what == "voice":
            self.voice = read_voice(Path(request["voice"]))
            self.coding = read_coding(Path(request["coding"]))
            self.own_identity = request["identity"]
            self.own = [
                rows(self.coding[f"{basis}.scales"].numbers, 32 * len(self.coding["mean"].numbers))
                for basis in BASES
            ]
            return {"loaded": True}
        if what == "bases":
            self.identity = request["identity"]
            count = 32 * request["channels"]
            scales = request["scales"]
            self.bases = [rows(scales[i : i + count], count) for i in range(0, len(scales), count)]
            return {}
        if what == "superframe":
            return self.superframe(bytes.fromhex(request["l0"]), bytes.fromhex(request["l1"]))
        if what == "reset":
            self.parts = {}
            return {}
        if what == "push":
            return self.push(request)
        if what == "draw":
            return self.draw(request)
        return {"unsupported": True}

    def superframe(self, l0: bytes, l1: bytes) -> Answer:
        """Return the integers of a superframe, or the paragraph that it breaks."""
        try:
            out = decode(l0, l1, self.bases, self.identity)
        except MalformedError as error:
            return {"valid": False, "section": str(error)}
        return {
            "valid": True,
            "header": [out.mode, out.sequence, out.lead, out.signed, out.proof],
            "slow": out.slow,
            "setting": [out.step, out.basis, out.level, out.course, out.shift, *out.shares],
            "score": out.score,
            "previews": out.previews,
            "indices": {str(i): q for i, q in enumerate(out.indices) if q},
            "values": {str(i): v for i, v in enumerate(out.values) if v},
        }

    def push(self, request: Answer) -> Answer:
        """Take a superframe; an empty or a broken one is lost."""
        try:
            self.parts[request["index"]] = decode(
                bytes.fromhex(request["l0"]),
                bytes.fromhex(request["l1"]),
                self.own,
                self.own_identity,
            )
        except MalformedError as error:
            return {"section": str(error)}
        return {}

    def draw(self, request: Answer) -> Answer:
        """Return keys and markers of a superframe."""
        index = request["index"]
        shown: Answer = {}
        if request["frames"] and index in self.parts:
            params, line = parameters(index, self.parts, self.coding)
            for t in request["frames"]:
                frame = params[t]
                if request["lips"]:
                    frame = lips([frame], 32 * index + t, line, self.voice)[0]
                shown[str(t)] = markers(self.voice, frame)
        return {"arrived": index in self.parts, "keys": self.keys(index), "markers": shown}

    def keys(self, index: int) -> list[list[int]]:
        """Return the keys that start in a superframe."""
        if any(part.mode == 2 for part in self.parts.values()):
            scores = {k: part.score for k, part in self.parts.items() if part.score is not None}
            line = line_of_windows(scores)
        else:
            scores = scores_near(self.parts, min(self.parts), max(self.parts) + 1)
            line = line_with_holes(scores)
        return [
            [cue.number, cue.start, cue.end]
            for cue in reported(line, scores)
            if cue.start // 32 == index
        ]


def rows(numbers: list[Any], count: int) -> list[list[int]]:
    """Return rows of 32 whole numbers."""
    return [[int(x) for x in numbers[i : i + 32]] for i in range(0, count, 32)]


def main() -> None:
    """Answer requests until the input ends."""
    plain = Plain()
    for line in sys.stdin:
        print(json.dumps(plain.answer(json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
