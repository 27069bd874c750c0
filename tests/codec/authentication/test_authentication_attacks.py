"""A million superframes of forgers, replayers and splicers against a trusting receiver."""

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from codec.authentication.layout import LAYOUTS, SUPERFRAME_S, number_at
from codec.authentication.signer import Signer
from codec.authentication.verifier import Verifier
from tests.codec.authentication.test_authentication import BEGIN_S, announced, key
from tests.codec.quick_search import quick_search

Attack = tuple[bytes | None, tuple[int, int] | None, bool]
"""What is covered, its field, and whether it is genuine."""

ATTACKS = (
    "change", "noise", "replay", "replay of seconds", "tags of others", "run", "field", "drop",
    "swap",
)  # fmt: skip


TOLERATED = math.ceil(Verifier(announced()).tolerance_s / SUPERFRAME_S) + 1
"""Superframes that pass while a receiver still takes what it gets for late and no more (E24)."""


def programme(width: int) -> Iterator[tuple[bytes, int]]:
    rng = np.random.default_rng(width)
    signer = Signer(key(), BEGIN_S, width)
    while True:
        data = rng.bytes(18 if width == 9 else 7)
        yield data, signer.take(data)


def attacked(width: int, rng: np.random.Generator) -> Iterator[Attack]:
    """A programme into which somebody cuts, every few seconds, what he can have."""
    past: list[tuple[bytes, int]] = []
    genuine = programme(width)
    fields = 1 << width
    while True:
        for _ in range(int(rng.integers(1, 4 * LAYOUTS[width].block))):
            data, value = next(genuine)
            past.append((data, value))
            yield data, (value, width), True
        del past[:-20_000]
        kind = ATTACKS[int(rng.integers(len(ATTACKS)))]
        length = 1 if rng.random() < 0.4 else int(rng.integers(1, 3 * LAYOUTS[width].block))
        oldest = len(past) - length - TOLERATED
        begin = int(rng.integers(max(1, oldest)))
        if kind == "replay" and oldest < 1:
            continue
        for step in range(length):
            data, value = next(genuine)
            old_data, old_value = past[min(begin + step, len(past) - 1)]
            recent = past[-1 - int(rng.integers(min(16, len(past))))]
            noise, chance = rng.bytes(len(data)), int(rng.integers(fields))
            match kind:
                case "change":
                    place = int(rng.integers(len(data)))
                    changed = bytearray(data)
                    changed[place] ^= 1 << int(rng.integers(8))
                    yield bytes(changed), (value, width), False
                case "noise":
                    yield noise, (chance, width), False
                case "replay":
                    yield old_data, (old_value, width), False
                case "replay of seconds":
                    yield recent[0], (recent[1], width), False
                case "tags of others":
                    yield noise, (old_value, width), False
                case "run":
                    yield noise, (value, width), False
                case "field":  # the cues are genuine: what is verified of them may be shown
                    yield data, (chance, width), True
                case "drop":
                    yield None, None, False
                case "swap":
                    yield old_data, (value, width), False
            past.append((data, value))


@pytest.fixture
def quick() -> Iterator[None]:
    with quick_search(key(), announced().periods):
        yield


def shown(width: int, count: int, seed: int) -> Counter[str]:
    """Attack for `count` superframes that are not genuine; count verdicts by what they are of."""
    rng = np.random.default_rng(seed)
    verifier = Verifier(announced())
    told: Counter[str] = Counter()
    genuine: dict[int, bool] = {}
    forged = index = 0
    stream = attacked(width, rng)
    begin = number_at(BEGIN_S)
    last = announced().until - begin - 1000
    while forged < count and index < last:
        data, field, is_genuine = next(stream)
        genuine[index] = is_genuine
        forged += not is_genuine
        utc_s = BEGIN_S + index * SUPERFRAME_S
        for verdict in verifier.take(index, data, field, utc_s=utc_s):
            kind = "genuine" if genuine.pop(verdict.index) else "forged"
            told[f"{kind} {verdict.status}"] += 1
        index += 1
        if len(genuine) > 5000:
            genuine = {k: v for k, v in genuine.items() if k > index - 1000}
    told["sent forged"] = forged
    return told


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("width", "count"),
    [
        (9, 300),
        (2, 100),
        *(pytest.param(*c, marks=pytest.mark.slow) for c in ((9, 1500), (2, 400))),
    ],
)
def test_many_attacks(width: int, count: int) -> None:
    told = shown(width, count, 1)
    assert told["forged verified"] == 0
    assert told["sent forged"] >= count
    assert told["genuine verified"] > 0.05 * told["sent forged"]
    assert told["genuine forged"] + told["genuine unknown"] > 0


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_a_million_attacks() -> None:
    """A day's announcement holds 135000 superframes; so many days with other attacks."""
    total: Counter[str] = Counter()
    for seed in range(40):
        total += shown(9, 1_000_000, 100 + seed)
        if total["sent forged"] >= 1_000_000:
            break
    print(dict(total))
    assert total["sent forged"] >= 1_000_000
    assert total["forged verified"] == 0
