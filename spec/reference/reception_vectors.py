"""The vectors of reception: superframes drawn at random, with losses, windows and lips.

``python -m spec.reference.reception_vectors spec/vectors/reception.json`` writes them, the same
ones each time. To be run for a new version of the format, of the built-in voice or of its tables
only.
"""

import json
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from spec.reference.identity import identity as identity_of
from spec.reference.markers import Array, identity, markers, read_voice
from spec.reference.motion import BASES, read_coding
from spec.reference.purposes import described
from spec.reference.reception import (
    line_of_windows,
    line_with_holes,
    lips,
    parameters,
    reported,
    scores_near,
)
from spec.reference.stream_bytes import EVEN, one
from spec.reference.superframe import Decoded, decode

DATA = Path(__file__).parents[1] / "data"
ORIGIN = (
    "bytes drawn at random by spec/reference/reception_vectors.py, given checks, decoded, joined "
    "and drawn by spec/reference, which was written from the text"
)
SHOWN = (5, 12, 17, 19, 25, 70, 93)
"""Markers that are stated: nose bridge, lips, chin, two of the hand."""

FRAMES = (3, 19)
FIRST = 40
"""Number of the first superframe of a case."""

Case = dict[str, Any]


def compact(rng: random.Random, coding: str, size: int, sequence: int) -> bytes:
    """Return a compact L0 part of random bytes with the identity of a coding (M2)."""
    body = bytearray(rng.randbytes(size))
    body[0] = 0x20 | sequence % 16
    told = int(coding[:4], 16) >> 14 - 2 * (sequence % 8) & 3
    body[-1] = body[-1] & 0xFC | told
    return bytes(body)


def following(rng: random.Random, coding: str, size: int, count: int) -> list[bytes]:
    """Return compact L0 parts of which each goes on about where the one before ended."""
    frames: list[bytes] = []
    end = 32 * FIRST
    for k in range(FIRST, FIRST + count):
        while True:
            frame = compact(rng, coding, size, k)
            score = decode(frame, None, EVEN, coding).score or {}
            begin = 32 * k + score["begin"]
            if -3 <= begin - end <= 12 and 24 <= 32 * k + score["end"] - end <= 44:
                break
        frames.append(frame)
        end = 32 * k + score["end"]
    return frames


def runs(coding: str) -> Iterator[tuple[str, str, str, list[bytes], set[int], bool]]:
    """Yield identifier, group, section, superframes, which are lost, and whether lips are shown."""
    rng = random.Random(20)
    for i in range(10):
        frames = [one(rng, coding, int(i > 7 and k % 4 == 2), FIRST + k) for k in range(8)]
        lost = set(rng.sample(range(1, 7), 2 + i % 3))
        yield f"lost-{i}", "losses: keys", "J1 to J5, J8", frames, lost, False
    for i in range(8):
        frames = following(rng, coding, 6 + i % 6, 8)
        lost = set(rng.sample(range(1, 7), i % 3))
        yield f"windows-{i}", "windows", "M1 to M7, J4, J6, J7", frames, lost, False
    for i in range(3):
        frames = [one(rng, coding, 0, FIRST + k) for k in range(4)]
        yield f"lips-{i}", "lips", "K1 to K5", frames, set(), True
    frames = following(rng, coding, 9, 6)
    yield "lips-of-windows", "lips", "K1 to K5", frames, set(), True


def keys_by_index(parts: dict[int, Decoded], count: int) -> dict[str, list[list[int]]]:
    """Return the keys that are reported, by the superframe in which they start."""
    if any(part.mode == 2 for part in parts.values()):
        scores = {k: part.score for k, part in parts.items() if part.score is not None}
        line = line_of_windows(scores)
        indices = sorted(parts)
    else:
        scores = scores_near(parts, FIRST, FIRST + count)
        line = line_with_holes(scores)
        indices = sorted(scores)
    # The ends of the line hang on what is behind them.
    inner = [k for k in indices if FIRST < k < FIRST + count - 1]
    found: dict[str, list[list[int]]] = {str(k): [] for k in inner}
    for cue in reported(line, scores):
        if str(cue.start // 32) in found:
            found[str(cue.start // 32)].append([cue.number, cue.start, cue.end])
    return found


def case_of(
    name: str,
    group: str,
    section: str,
    frames: list[bytes],
    lost: set[int],
    shown_lips: bool,
    tables: tuple[dict[str, Array], dict[str, Array], list[list[list[int]]], str],
) -> Case:
    """Return a case with what the reference says."""
    voice, coding, scales, own = tables
    parts = {
        FIRST + k: decode(l0, None, scales, own) for k, l0 in enumerate(frames) if k not in lost
    }
    stated: dict[str, dict[str, list[float]]] = {}
    for k in list(parts)[1:-1] if group != "losses: keys" else []:
        params, line = parameters(k, parts, coding)
        if shown_lips:
            params = lips(params, 32 * k, line, voice)
        for t in FRAMES:
            places = markers(voice, params[t])
            stated[str(32 * k + t)] = {str(m): [round(x, 3) for x in places[m]] for m in SHOWN}
    return {
        "id": name,
        "group": group,
        "section": section,
        "valid": True,
        "lips": shown_lips,
        **described("reception", name),
        "superframes": [
            {"index": FIRST + k, "l0": "" if k in lost else l0.hex(), "l1": ""}
            for k, l0 in enumerate(frames)
        ],
        "keys": keys_by_index(parts, len(frames)),
        "markers": stated,
    }


def main(path: str) -> None:
    """Write the vectors."""
    voice = read_voice(DATA / "voices" / "claire.npz")
    file = DATA / "coding" / f"{identity(voice)}.npz"
    coding = read_coding(file)
    own = identity_of(DATA / "tables.json", file, identity(voice))
    scales = [
        [
            [int(coding[f"{basis}.scales"].at(c, f)) for f in range(32)]
            for c in range(coding[f"{basis}.scales"].shape[0])
        ]
        for basis in BASES
    ]
    tables = (voice, coding, scales, own)
    cases = [case_of(*run, tables) for run in runs(own)]
    lines = ",\n".join("  " + json.dumps(case) for case in cases)
    start = json.dumps({"section": "3.1, 4, 5", "origin": ORIGIN})[:-1]
    Path(path).write_text(f'{start}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
