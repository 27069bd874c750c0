"""The vectors of a second language, American English (spec/bitstream.md, S11, S12, P12).

``python -m spec.reference.language_vectors spec/vectors/language.json`` writes them, the same ones
each time: bytes drawn at random, decoded by the reference with that language's tables.
"""

import json
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from spec.reference import files
from spec.reference.joining import keys_of, line_of, stand_in
from spec.reference.markers import Array
from spec.reference.motion import NAMES, REST_GAPS, strokes
from spec.reference.stream_bytes import head, whole
from spec.reference.superframe import Decoded, MalformedError, decode
from spec.reference.superframe_vectors import BASES, IDENTITY, compact, full
from spec.reference.tables import DATA, LANGUAGE, n_phones, n_placements, n_shapes, using

TABLES = DATA / "languages" / "american-english.json"
ORIGIN = (
    "bytes drawn at random by spec/reference/language_vectors.py, decoded by spec/reference with "
    "spec/data/languages/american-english.json; it was written from the text"
)
MOVEMENT = (
    0.62, 0.3, 0.4, 0.1, 0.2, 0.0005, 0.16, 0.4, 0.12, 1.5, 0.06, 0.3, 0.2, 0.4, 0.3,
    0.01, -0.02, 0.02, 0.03, 0.01, 0.02, 1.0, 0.12, 0.25,
)  # fmt: skip
"""(Table 5) Constants of no voice; none is 0 and no two that are times are alike."""

HURRIED = 17
"""Number of the first superframe where a placement moves late, as the hand reaches it late."""

Case = dict[str, Any]


def places() -> list[list[float]]:
    """Return where the hand is for each key, mm: no two ways alike."""
    return [
        [11.0 * (n % n_placements()), 3.0 * (n % n_placements()) ** 1.5 // 1, 2.0 * (n // 9)]
        for n in range(n_shapes() * n_placements())
    ]


def coding() -> dict[str, Array]:
    """Return the arrays that strokes take."""
    rows = places()
    flat = [x for row in rows for x in row]
    return {
        "targets.movement": Array((len(NAMES),), list(MOVEMENT), b""),
        "targets.places": Array((len(rows), 3), flat, b""),
    }


def told(out: Decoded) -> Case:
    """Return the fields of a case that a superframe of mode 0 says."""
    case: Case = {
        "header": [out.mode, out.sequence, out.lead, out.signed, out.proof],
        "slow": out.slow,
        "setting": [out.step, out.basis, out.level, out.course, out.shift, *out.shares],
        "score": out.score,
        "previews": out.previews,
        "indices": {},
        "values": {},
    }
    if out.mode == 0 and out.score is not None:
        scores = {0: out.score}
        cues = keys_of(line_of(scores), scores)
        case["keys"] = [[cue.number, cue.start, cue.end] for cue in cues]
        found = strokes(cues, REST_GAPS[out.score["rest_gap"]], coding())
        case["strokes"] = [[one.number, one.leave, one.reach] for one in found[1:]]
    case["previewed"] = {}
    for distance, preview in out.previews.items():
        scores = {0: stand_in(preview)}
        cues = keys_of(line_of(scores), scores)
        case["previewed"][distance] = [[cue.number, cue.start, cue.end] for cue in cues]
    return case


def superframes() -> Iterator[Case]:
    """Yield cases of superframes."""
    rng = random.Random(15)
    makers: dict[str, Callable[[], bytes]] = {
        "spoken": lambda: full(rng, 0, 30, 63),
        "filmed": lambda: full(rng, 0, 12, None, 1),
        "compact": lambda: compact(rng, 12),
        "hurried": lambda: full(random.Random(HURRIED), 0, 30, 63),
    }
    for kind, make in makers.items():
        for i in range({"spoken": 24, "filmed": 4, "compact": 6, "hurried": 1}[kind]):
            l0 = make()
            while kind == "filmed" and decode(l0, None, BASES, IDENTITY).step != 63:
                l0 = make()
            yield {
                "id": f"{kind}-{i}",
                "section": "S11, S12, P12" if kind in {"spoken", "hurried"} else "S11, S12",
                "valid": True,
                "l0": l0.hex(),
                "l1": "",
                **told(decode(l0, None, BASES, IDENTITY)),
                "purpose": "a superframe of a language with 42 phones and nine placements",
                "failure_suggests": "a number of table 7 taken from French; rows that are absent "
                "(S12); strokes of placements that move (P12); a stand-in without a vowel (J8)",
            }


def lines() -> Iterator[Case]:
    """Yield cases of files that tell their score once."""
    rng = random.Random(16)
    for form in (0, 1):
        made = 0
        while made < 4:
            data = bytearray(rng.randbytes(40))
            data[0] = form << 7 | data[0] & 0x7F
            file = whole(head(0, 128, IDENTITY), [bytes(data)] + 4 * [b"\xfc"])
            try:
                out = files.read(file)
            except MalformedError:
                continue
            if len(out.line or []) < 8:
                continue
            yield {
                "id": f"file-{'keyed' if form else 'spoken'}-{made}",
                "section": "S11, F10, F11",
                "valid": True,
                "file": file.hex(),
                "line": out.line,
                "keys": [[cue.number, cue.start, cue.end] for cue in files.keys(out)],
                "purpose": "a file of a language with 42 phones and nine placements",
                "failure_suggests": "a number of table 7, or `common` of table 8, from French",
            }
            made += 1


def main(path: str) -> None:
    """Write the vectors."""
    with using(TABLES):
        cases = [*superframes(), *lines()]
        moving = [
            LANGUAGE["placements"][stroke[0] % n_placements()]
            for case in cases
            for stroke in case.get("strokes", ())
        ]
        assert set(moving) == set(LANGUAGE["placements"]), set(moving)
        assert n_phones() == 42
        document = {
            "origin": ORIGIN,
            "identity": IDENTITY,
            "bases": BASES,
            "tables": "data/languages/american-english.json",
            "movement": MOVEMENT,
            "places": places(),
        }
    rows = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    text = f'{json.dumps(document)[:-1]}, "cases": [\n{rows}\n]}}\n'
    Path(path).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
