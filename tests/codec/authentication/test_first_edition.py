"""A stream signed by the rules of the first edition is recognised and verifies nothing."""

import hashlib

import numpy as np
import pytest

from codec.authentication.announcement import SigningKey
from codec.authentication.first_edition import MESSAGE
from codec.authentication.layout import PERIOD, time_of
from codec.authentication.verifier import Verifier
from tests.codec.authentication.test_authentication import Sent, run, statuses

RULES = {9: (8, (12, 9, 24), (12, 7, 7)), 2: (44, (24, 45, 88), (16, 32, 35))}
"""Superframes of a block; bits, nearest and farthest distance of whole and quick tag."""


def signed(width: int, count: int, seed: int) -> list[Sent]:
    """Return superframes with the fields that section 8 of spec/authentication.md states."""
    rng = np.random.default_rng(seed)
    covered = [rng.bytes(18) for _ in range(count)]
    length, *tags = RULES[width]
    fields: list[int] = []
    for begin in range(0, count, length):
        key, number = rng.bytes(8), 0
        for bits, nearest, farthest in tags:
            data = b"cuecast-data-1"
            for distance in range(nearest, farthest + 1):
                at = begin + length - distance
                if at >= 0:
                    data += distance.to_bytes(2, "big") + len(covered[at]).to_bytes(2, "big")
                    data += covered[at]
            tag = b"cuecast-tag-1" + bytes([farthest - nearest + 1]) + key
            found = hashlib.sha256(tag + hashlib.sha256(data).digest()).digest()
            number = number << bits | int.from_bytes(found[:4], "big") >> 32 - bits
        number = number << 48 | int.from_bytes(key[:6], "big")
        fields += [
            number >> width * (length - 1 - place) & (1 << width) - 1 for place in range(length)
        ]
    return [(data, (proof, width)) for data, proof in zip(covered, fields, strict=False)]


@pytest.mark.parametrize(
    ("width", "count", "first"),
    [
        (9, 56, 0),
        *(pytest.param(*row, marks=pytest.mark.slow) for row in ((9, 56, 3), (2, 264, 0))),
    ],
)
def test_it_is_recognised_and_verifies_nothing(width: int, count: int, first: int) -> None:
    announced = SigningKey("new", bytes([3]) * 32).announce(time_of(PERIOD), 1)
    verifier = Verifier(announced, 10.0)
    sent = list(enumerate(signed(width, count, 7)))[first:]
    found = statuses(run(verifier, sent, time_of(PERIOD + 5)))
    assert set(found.values()) == {"unknown"}
    assert verifier.reason == MESSAGE


@pytest.mark.slow
def test_random_fields_are_not_taken_for_it() -> None:
    announced = SigningKey("new", bytes([3]) * 32).announce(time_of(PERIOD), 1)
    rng = np.random.default_rng(1)
    verifier = Verifier(announced, 10.0)
    sent = [(k, (rng.bytes(18), (int(rng.integers(512)), 9))) for k in range(64)]
    run(verifier, sent, time_of(PERIOD))
    assert verifier.reason != MESSAGE
