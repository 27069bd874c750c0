"""An adversary who has inverted a chain's end: whom his keys convince, and what they cost."""

import hashlib
import sys
import types
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import gamma

from codec.authentication import chain as chain_module
from codec.authentication.announcement import Announcement, SigningKey
from codec.authentication.chain import Chain
from codec.authentication.layout import LAYOUTS, PERIOD, time_of
from codec.authentication.signer import Signer
from codec.authentication.verifier import Verifier
from tests.codec.authentication.test_authentication import Sent, run, statuses

BITS, HIDDEN = 16, 4
"""Bits of a reduced key, and those of them that are not sent."""

WIDTH, NUMBER = 9, 10
LENGTH = LAYOUTS[WIDTH].block
FIRST, TAKEN_OVER, LAST = 20, 24, 28
"""Blocks of the period with which the programme begins, the forged one begins, and it ends."""

BEGIN = NUMBER * PERIOD + FIRST * LENGTH


def shortened(digest: bytes) -> bytes:
    """Return a key of which all bits but `BITS` are 0, in proportion among sent and hidden ones."""
    value = int.from_bytes(digest[:8], "big")
    sent, hidden = value >> 16 & (1 << BITS - HIDDEN) - 1, value & (1 << HIDDEN) - 1
    return (sent << 16 | hidden).to_bytes(8, "big")


class ReducedSha256:
    """SHA-256 of which the steps of chains give reduced keys."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def digest(self) -> bytes:
        found = hashlib.sha256(self._data).digest()
        return shortened(found) if len(self._data) == 44 else found


@pytest.fixture
def reduced(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(chain_module, "hashlib", types.SimpleNamespace(sha256=ReducedSha256))
    hidden = [value.to_bytes(2, "big") for value in range(1 << HIDDEN)]
    monkeypatch.setattr(chain_module, "hidden_parts", lambda: hidden)
    yield
    chain_module.keys_of.cache_clear()  # no other test may get these keys


def forged_keys(
    chain: Chain, end: bytes, rng: np.random.Generator, spent: list[int] | None = None
) -> list[bytes]:
    """Return keys of the adversary's own, by block, that lead to the end.

    The hashes that finding them took are appended to `spent`.
    """
    hashes = 0
    prefix = chain._prefix
    numbers = [block.to_bytes(4, "big") for block in range(LAST, -1, -1)]
    while True:
        key = guess = shortened(rng.bytes(8))
        for number in numbers:
            key = shortened(hashlib.sha256(prefix + number + key).digest())
        hashes += len(numbers)
        if key == end:
            if spent is not None:
                spent.append(hashes)
            keys = [guess]
            for block in range(LAST, 0, -1):
                keys.insert(0, chain.before(keys[0], block))
            return keys


def signed(keys: Any, seed: int) -> list[Sent]:
    """Return superframes from the first block to the last one, signed with some keys."""
    rng = np.random.default_rng(seed)
    signer = Signer(cast(SigningKey, keys), time_of(BEGIN), WIDTH)
    covered = [rng.bytes(18) for _ in range((LAST + 1 - FIRST) * LENGTH)]
    return [(data, (signer.take(data), WIDTH)) for data in covered]


def verified(announced: Announcement, sent: list[Sent], first: int) -> int:
    """Return how many superframes of the last blocks a set verifies that tuned in at a block."""
    skipped = (first - FIRST) * LENGTH
    stream = list(enumerate(sent))[skipped:]
    found = statuses(run(Verifier(announced, 10.0), stream, time_of(BEGIN)))
    border = (TAKEN_OVER - FIRST) * LENGTH
    return sum(found[at] == "verified" for at in range(border, len(sent)))


@pytest.mark.usefixtures("reduced")
def test_who_followed_the_genuine_programme_is_not_convinced() -> None:
    """Keys that lead to the end convince a set that has just tuned in (E27).

    They meet the genuine chain at a block of chance: only if that lies after the latest key that a
    set has verified do they convince it, too; here after 24 of 29 steps.
    """
    genuine = SigningKey("reduced", bytes([77]) * 32)
    announced = genuine.announce(time_of(NUMBER * PERIOD), 1)
    chain = announced.chain(NUMBER, WIDTH)
    now = signed(genuine, 1)
    all_of_it = (LAST - TAKEN_OVER) * LENGTH + 1  # and one by the last block's quick tag
    assert verified(announced, now, FIRST) == verified(announced, now, TAKEN_OVER) == all_of_it
    known = genuine.keys(NUMBER, WIDTH)[TAKEN_OVER - 1]
    rng, convinced = np.random.default_rng(5), []
    for trial in range(24):
        keys = forged_keys(chain, announced.end_of(NUMBER, WIDTH), rng)
        convinced.append(keys[TAKEN_OVER - 1] == known)
        if trial >= 4 and not convinced[-1]:  # all that meet it late, some of the others
            continue
        own = types.SimpleNamespace(channel=genuine.channel, keys=lambda *_, k=tuple(keys): k)
        forged = signed(own, 100 + trial)
        assert verified(announced, forged, TAKEN_OVER) == all_of_it
        spliced = now[: (TAKEN_OVER - FIRST) * LENGTH] + forged[(TAKEN_OVER - FIRST) * LENGTH :]
        assert (verified(announced, spliced, FIRST) > 0) == convinced[-1]
    assert 0 < sum(convinced) < len(convinced) / 2  # 5 of 29 in the mean of all chains


@pytest.mark.slow
@pytest.mark.usefixtures("reduced")
@pytest.mark.parametrize(("bits", "trials"), [(20, 8), (22, 3), (24, 1)])
def test_an_end_costs_as_many_hashes_as_there_are_keys(
    bits: int, trials: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ends are inverted by steps of the product, and the keys convince its verifier.

    One function for all steps, as in the first edition, made it 2 / 29 of this.
    """
    monkeypatch.setattr(sys.modules[__name__], "BITS", bits)
    genuine = SigningKey(f"reduced to {bits}", bytes([bits]) * 32)
    announced = genuine.announce(time_of(NUMBER * PERIOD), 1)
    chain, end = announced.chain(NUMBER, WIDTH), announced.end_of(NUMBER, WIDTH)
    rng, spent = np.random.default_rng(bits), list[int]()
    keys = [forged_keys(chain, end, rng, spent) for _ in range(trials)]
    own = types.SimpleNamespace(channel=genuine.channel, keys=lambda *_: tuple(keys[0]))
    all_of_it = (LAST - TAKEN_OVER) * LENGTH + 1
    assert verified(announced, signed(own, bits), TAKEN_OVER) == all_of_it
    mean = sum(spent) / trials / 2**bits
    print(f"{bits} bits: {mean:.2f} times 2^{bits} hashes in the mean of {trials}")
    # The sum of exponential variables: less once in a thousand cases.
    assert mean > gamma.ppf(1e-3, trials, scale=1 / trials)
