"""Vectors of proofs: steps, tags, checks, blocks of both widths, and files of keys.

``python -m spec.reference.authentication_vectors spec/vectors/authentication.json`` writes them,
the same ones each time.
"""

import base64
import json
import random
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

from spec.reference import authentication as plain
from spec.reference import ed25519

ORIGIN = (
    "random bytes; steps, tags, checks and statuses by spec/reference/authentication.py, which was "
    "written from the text; signatures by spec/reference/ed25519.py"
)
PERIOD, BLOCKS, TOLERANCE_S = 10, 3, 10.0
Case = dict[str, Any]


def base64_of(data: bytes) -> str:
    """Return bytes as a file of keys has them (E15)."""
    return base64.b64encode(data).decode("ascii")


def signed_stream(
    rng: random.Random, channel: bytes, width: int, first: int, last_key: bytes
) -> tuple[list[bytes], list[int], bytes]:
    """Return what is covered of three blocks, their fields, and the end of the chain (E6)."""
    length, count, quick = plain.LAYOUTS[width]
    keys = [last_key]
    for block in range(first + BLOCKS - 1, -1, -1):
        keys.insert(0, plain.before(keys[0], channel, PERIOD, width, block))
    covered = [rng.randbytes(18 if width == 9 else 7) for _ in range(BLOCKS * length)]
    fields = []
    for at in range(BLOCKS):
        key, begin = keys[1 + first + at], at * length
        earlier = {
            place: plain.tag_of(covered[begin - length + place], channel, key, 2 * length - place)
            for place in range(length if at else 0)
        }
        number = 0
        for check in plain.checks_of(earlier, count):
            number = number << 12 | check
        number = number << 24 | plain.tag_of(covered[begin + quick], channel, key, length - quick)
        number = number << 48 | int.from_bytes(key, "big") >> 16
        fields += [number >> width * (length - 1 - i) & (1 << width) - 1 for i in range(length)]
    return covered, fields, keys[0]


def stream_cases(
    width: int, first: int, covered: list[bytes], fields: list[int], channel: bytes, end: bytes
) -> list[Case]:
    """Return one stream, and what a receiver says of it as it arrives in several ways."""
    length, count, quick = plain.LAYOUTS[width]
    most = count // 2 - 1
    lost = [3 + 2 * i for i in range(most)]
    kinds: list[tuple[str, str, list[int], list[int], float, str, str]] = [
        ("whole", "E22", [], [], 2.0, "three blocks: all of the first two, one of the last",
         "the order of the fields (E6), the distance d (E11), the matrix (E14)"),
        ("lost", "E21", lost, [], 2.0, "as many lost as the checks bear",
         "two checks have to be left over, not more; lost symbols are eliminated"),
        ("too-many-lost", "E21", [*lost, length - 1 - quick % 2], [], 2.0,
         "one more lost: its block is unknown", "fewer than two checks left over prove nothing"),
        ("changed", "E22", [], [4], 2.0, "one superframe changed on its way",
         "taking it for lost leaves enough checks that agree: only that one is forged"),
        ("late-key", "E19", [2 * length - 2], [], 2.0, "the second block's key is lost",
         "keys that were lost follow from later ones"),
        ("held-back", "E24", [], [], 0.0, "12 s old from the second block on, 10 s are allowed",
         "the time of arrival is compared with that of the public number"),
        ("part-held-back", "E24", [], [], 0.0, "one superframe of the second block comes 12 s late",
         "the time of each superframe of both blocks counts, not that of the stream"),
    ]  # fmt: skip
    start = PERIOD * plain.PERIOD + first * length
    cases = []
    for name, section, gone, changed, age_s, purpose, suggests in kinds:
        ages = [age_s] * len(covered)
        if name == "part-held-back":
            ages[length + 2] = 12.0
        if name == "held-back":
            ages[length:] = [12.0] * (2 * length)
        data = list(covered)
        for at in changed:
            data[at] = bytes([data[at][0] ^ 1]) + data[at][1:]
        taken = {
            start + at: (data[at], fields[at], ages[at])
            for at in range(len(data))
            if at not in gone
        }
        found = plain.statuses(taken, channel, width, end, TOLERANCE_S)
        letters = "".join(found.get(start + at, "-")[0] for at in range(len(data)))
        cases.append({
            "id": f"stream-{width}-{name}", "section": section, "valid": True, "width": width,
            "first": start, "lost": gone, "changed": changed, "ages_s": sorted(set(ages)),
            "aged": [at for at, age in enumerate(ages) if age != min(ages)],
            "tolerance_s": TOLERANCE_S, "statuses": letters, "purpose": purpose,
            "failure_suggests": suggests,
        })  # fmt: skip
    return cases


def part_cases(rng: random.Random, channel: bytes) -> list[Case]:
    """Return steps of chains, tags, and checks with losses."""
    cases: list[Case] = []
    for width, block in ((9, 0), (9, 259199), (2, 43199)):
        key = rng.randbytes(8)
        cases.append({
            "id": f"step-{width}-{block}", "section": "E10", "valid": True, "width": width,
            "period": PERIOD, "block": block, "key": key.hex(),
            "before": plain.before(key, channel, PERIOD, width, block).hex(),
            "purpose": "a step of the chain", "failure_suggests": "the prefix is hashed first; "
            "period and block's number in 32 bits, highest byte first; 8 bytes of the digest",
        })  # fmt: skip
    for distance in (1, 9, 192):
        key, covered = rng.randbytes(8), rng.randbytes(18)
        cases.append({
            "id": f"tag-{distance}", "section": "E11", "valid": True, "key": key.hex(),
            "distance": distance, "covered": covered.hex(),
            "tag": plain.tag_of(covered, channel, key, distance),
            "purpose": "a superframe's tag", "failure_suggests": "channel, key, then d in 16 bits",
        })  # fmt: skip
    for width in (9, 2):
        length, count, _ = plain.LAYOUTS[width]
        tags = {place: rng.randrange(1 << 24) for place in range(length)}
        checks = dict(enumerate(plain.checks_of(tags, count)))
        gone = rng.sample(range(length), count // 2 - 1)
        for name, without, change in (
            ("all", [], None),
            ("lost", gone, None),
            ("changed", gone, next(p for p in tags if p not in gone)),
            ("too-many", [*gone, next(p for p in tags if p not in gone)], None),
        ):
            there = {place: tag for place, tag in tags.items() if place not in without}
            if change is not None:
                there[change] ^= 0x001000
            cases.append(
                {
                    "id": f"checks-{width}-{name}",
                    "section": "E14, E21",
                    "valid": True,
                    "width": width,
                    "checks": list(checks.values()),
                    "tags": [there.get(place) for place in range(length)],
                    "agree": plain.agree(checks, there, length),
                    "purpose": "checks against the tags that arrived; null: too few are left over",
                    "failure_suggests": "GF(2^12) with 0x1053; symbol 2 i is the tag's higher "
                    "half; j XOR (16 + s)",
                }
            )
    return cases


def file_cases(public: dict[str, Any]) -> list[Case]:
    """Return files of keys: one that holds, one that was changed, one of the first edition."""
    changed = public | {"until": public["until"] + 1}
    first = {name: public[name] for name in ("kind", "name", "public_key", "ends", "signature")}
    first |= {"format": "cuecast-key-1", "first_period": 7}
    return [
        {"id": f"file-{name}", "section": section, "valid": valid, "public": document,
         "purpose": purpose, "failure_suggests": suggests}
        for name, section, valid, document, purpose, suggests in (
            ("third", "E15, E16", True, public, "a file that holds",
             "signed is the JSON with sorted names and no blanks"),
            ("changed", "E16", False, changed, "a date that was changed after it was signed",
             "the signature covers the dates"),
            ("first-edition", "E18", False, first, "a file of the first edition",
             "refused, with a message that says so"),
        )
    ]  # fmt: skip


def main(path: Path) -> None:
    """Write the vectors."""
    rng = random.Random(29)
    secret = rng.randbytes(32)
    public_key = ed25519.public_key_of(secret)
    channel = sha256(public_key).digest()[:8]
    streams, cases, ends = {}, part_cases(rng, channel), {}
    for width, first in ((9, 5), (2, 1)):
        covered, fields, end = signed_stream(rng, channel, width, first, rng.randbytes(8))
        ends[str(width)] = base64_of(end)
        streams[str(width)] = {"covered": [one.hex() for one in covered], "fields": fields}
        cases += stream_cases(width, first, covered, fields, channel, end)
    public: dict[str, Any] = {
        "format": "cuecast-key-3",
        "kind": "public",
        "name": "Télé",
        "ends": ends,
        "public_key": base64_of(public_key),
        "first": PERIOD * plain.PERIOD,
        "until": PERIOD * plain.PERIOD + 135_000,
    }
    data = json.dumps(public, sort_keys=True, separators=(",", ":")).encode()
    public["signature"] = base64_of(ed25519.sign(secret, data))
    cases += file_cases(public)
    lines = ",\n".join("  " + json.dumps(case, ensure_ascii=False) for case in cases)
    head = json.dumps({"origin": ORIGIN, "channel": channel.hex(), "streams": streams})[:-1]
    path.write_text(f'{head}, "cases": [\n{lines}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
