"""The vectors of marked pictures: still pictures that bear a superframe, and what is read there.

``python -m spec.reference.picture_vectors spec/vectors/picture.json`` writes them. The sender is
that of sections 3 to 6 of spec/video-carrier.md: one picture, whose mean is the picture itself.
"""

import base64
import json
import math
import random
import sys
import zlib
from pathlib import Path
from typing import Any

from spec.reference import audio_carrier as code
from spec.reference import video_carrier as carrier

ORIGIN = (
    "pictures made by hand and marked by spec/reference/picture_vectors.py, read by "
    "spec/reference/video_carrier.py; both were written from the text"
)
WIDTH, HEIGHT = 320, 180
SIZES = {0: (20, 28, 3328), 1: (20, 140, 2560), 4: (20, 0, 6880)}
"""(V20) Bytes of L0 and L1, and coded bits of L0, of two profiles and of L0 alone (V28)."""
MOTHER, DATA = 1024, 6880
Luma = list[list[int]]


def host(textured: bool) -> Luma:
    """Return a picture: slopes, and on its right half stripes if wanted."""
    return [
        [
            round(90 + 0.2 * x + 0.15 * y + 20 * textured * (x > 160) * ((x // 2 + y // 2) % 2))
            for x in range(WIDTH)
        ]
        for y in range(HEIGHT)
    ]


def coded(payload: bytes, width: int, length: int, mother: int | None) -> list[int]:
    """(V20) Return the coded bits of a class."""
    bits = code.encode(payload, width, mother or length)
    return [bits[i % len(bits)] for i in range(length)]


def shape_of(template: int, row: int, column: int) -> dict[tuple[int, int], float]:
    """(V8) Return the template of a cell by its pixels."""
    across, down = carrier._places(WIDTH, 80, column), carrier._places(HEIGHT, 45, row)
    dipole = across if template == 0 else down
    mean = sum(math.sin(2 * math.pi * p) for p in dipole.values()) / len(dipole)
    return {
        (y, x): (math.sin(2 * math.pi * (a if template == 0 else b)) - mean)
        * math.sin(math.pi * (b if template == 0 else a)) ** 2
        for y, b in down.items()
        for x, a in across.items()
    }


def value_place(value: int) -> tuple[int, int, int]:
    """(V10) Return template, row and column of a value."""
    return value // 3600, value // 80 % 45, value % 80


def marked(luma: Luma, number: int, step: int, place: int, payload: tuple[bytes, bytes]) -> Luma:
    """(V11 to V19) Return a picture that bears a superframe of a profile and step at a place."""
    dither = carrier.dither(0)
    pilots, data = carrier.positions(0)
    bits = dict(zip(pilots, carrier.pilot_bits(number, step, 0, place), strict=True))
    first = SIZES[number][2]
    all_bits = coded(payload[0], 24, first, MOTHER)
    if first < DATA:
        all_bits += coded(payload[1], 16, DATA - first, None)
    bits |= dict(zip(data, all_bits, strict=True))
    out = [[float(x) for x in line] for line in luma]
    for value, bit in bits.items():
        template, row, column = value_place(value)
        fine, width_of = carrier.STEPS[step], carrier.width_of
        if value in pilots:
            fine, width_of = carrier.PILOT_STEP, carrier.pilot_width_of
        wide = width_of(carrier.texture(luma, row, column))
        own = carrier.amplitude(luma, value)
        n = round((own / fine - dither[value]) / wide - bit / 2)
        change = fine * (wide * (n + bit / 2) + dither[value]) - own
        for (y, x), weight in shape_of(template, row, column).items():
            out[y][x] += change * weight
    return [[min(max(round(x), 0), 255) for x in line] for line in out]


def read(luma: Luma, number: int, step: int) -> tuple[bytes | None, bytes | None]:
    """(V11, V20) Return the payloads of a picture by its soft values."""
    dither = carrier.dither(0)
    soft = []
    for value in carrier.positions(0)[1]:
        _, row, column = value_place(value)
        wide = carrier.width_of(carrier.texture(luma, row, column))
        at = carrier.amplitude(luma, value) / carrier.STEPS[step] - dither[value]
        soft.append(math.cos(2 * math.pi * at / wide))
    l0, l1, first = SIZES[number]
    folded = [sum(soft[:first][i::MOTHER]) for i in range(MOTHER)]
    return code.decode(folded, l0, 24), code.decode(soft[first:], l1, 16) if l1 else b""


def main(path: Path) -> None:
    """Write the vectors."""
    rng = random.Random(14)
    cases: list[dict[str, Any]] = []
    sent = (1, 0, 2, False), (1, 1, 3, True), (0, 2, 2, True), (4, 0, 5, True)
    for number, step, place, textured in sent:
        payload = rng.randbytes(SIZES[number][0]), rng.randbytes(SIZES[number][1])
        luma = marked(host(textured), number, step, place, payload)
        assert read(luma, number, step) == payload
        shown = sorted(rng.sample(range(7200), 40))
        raw = bytes(x for line in luma for x in line)
        cases.append({
            "id": f"profile-{number}-step-{step}-place-{place}", "section": "3 to 6", "valid": True,
            "profile": number, "step": step, "place": place,
            "width": WIDTH, "height": HEIGHT, "key": 0,
            "luma": base64.b64encode(zlib.compress(raw, 9)).decode("ascii"),
            "l0": payload[0].hex(), "l1": payload[1].hex(),
            "amplitudes": [[value, round(carrier.amplitude(luma, value), 4)] for value in shown],
            "purpose": "a small marked picture" + " with textured cells" * textured,
            "failure_suggests": "templates (V8, V9), order of values (V10, V17), "
            + ("coarse steps of textured cells (V13), " * textured)
            + "mother code of 1024 bits (V20)",
        })  # fmt: skip
    lines = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    head = json.dumps({"origin": ORIGIN})[:-1]
    path.write_text(f'{head}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
