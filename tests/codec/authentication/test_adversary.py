"""An adversary who hears the broadcast and writes what a receiver gets: his means, their cost."""

import hashlib
import itertools
import types
from collections import Counter
from collections.abc import Iterator
from functools import cache, partial

import numpy as np
import pytest

from codec.authentication import chain as chain_module
from codec.authentication import search
from codec.authentication.announcement import Announcement
from codec.authentication.chain import Chain, agreeing, sent_bits, tag_of
from codec.authentication.checks import agree, checks_of
from codec.authentication.layout import LAYOUTS, PERIOD, SUPERFRAME_S, number_at, time_of
from codec.authentication.verifier import Verifier
from tests.codec.authentication import test_authentication as genuine_stream
from tests.codec.authentication.test_authentication import Sent, key, run, statuses
from tests.codec.quick_search import quick_search

BEGIN_S = time_of(10 * PERIOD + 8000)
"""Two hours into a period, so that its chain is short."""

TOLERANCE_S = 10.0
BLOCK = LAYOUTS[9].block
AGO = 3750
"""Superframes from an earlier broadcast to now: 40 minutes."""


signed = partial(genuine_stream.signed, on_air_s=BEGIN_S)


@cache
def announced() -> Announcement:
    return key().announce(time_of(10 * PERIOD), 1)


@pytest.fixture
def quick() -> Iterator[None]:
    with quick_search(key(), announced().periods):
        yield


def delivered(
    past: tuple[Sent, ...], now: tuple[Sent, ...], rng: np.random.Generator
) -> list[tuple[int, Sent] | None]:
    """Return for each slot the superframe, and its number, that the adversary lets arrive.

    He drops, delays, repeats and reorders superframes of now and of an earlier broadcast in a
    pattern that comes again with each block, or with each two, or is new at each place.
    """
    period = int(rng.choice([BLOCK, 2 * BLOCK, 40, len(now)]))
    kinds = rng.choice(6, period, p=rng.dirichlet([3.0, 0.4, 0.1, 0.1, 0.1, 0.1]))
    lag = int(rng.integers(1, 40))
    slots: list[tuple[int, Sent] | None] = []
    for slot in range(len(now)):
        held = max(0, slot - lag)
        match kinds[slot % period]:
            case 0:
                slots.append((slot, now[slot]))
            case 1:
                slots.append(None)
            case 2:
                slots.append((held, now[held]))
            case 3:
                slots.append(slots[-1] if slots else None)
            case 4:
                slots.append((slot - AGO, past[slot]))
            case _:  # genuine cues under proofs of before
                slots.append((slot, (now[slot][0], past[slot][1])))
    if rng.random() < 0.3:  # all of it a broadcast of before, of which some are taken out
        slots = [
            None if kinds[slot % period] == 1 else (slot - AGO, past[slot])
            for slot in range(len(now))
        ]
    for slot in range(0, len(now) - 1, 2):
        if rng.random() < 0.01:
            slots[slot], slots[slot + 1] = slots[slot + 1], slots[slot]
    return slots


def shown_too_old(count: int, seed: int) -> Counter[str]:
    """Return verdicts of so many patterns of five blocks and more, by how old they were."""
    rng, told = np.random.default_rng(seed), Counter[str]()
    begin_s = time_of(round(number_at(BEGIN_S)))
    past = tuple(signed(8 * BLOCK, on_air_s=begin_s - AGO * SUPERFRAME_S, seed=8))
    now = tuple(signed(8 * BLOCK, on_air_s=begin_s, seed=9))
    for _ in range(count):
        slots = delivered(past, now, rng)
        verifier = Verifier(announced(), TOLERANCE_S)
        stream = [(slot, None if one is None else one[1]) for slot, one in enumerate(slots)]
        for verdict in run(verifier, stream, begin_s):
            one = slots[verdict.index]
            assert one is not None
            age_s = (verdict.index - one[0]) * SUPERFRAME_S
            told[f"{'late' if age_s > TOLERANCE_S else 'timely'} {verdict.status}"] += 1
    return told


@pytest.mark.usefixtures("quick")
def test_nothing_late_is_verified_whatever_he_drops_delays_repeats_or_reorders() -> None:
    told = shown_too_old(60, 1)
    assert told["late verified"] == 0, told
    assert told["timely verified"] > 1000
    assert told["late forged"] + told["late unknown"] > 1500


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_nothing_late_is_verified_in_thousands_of_patterns() -> None:
    assert shown_too_old(5000, 2)["late verified"] == 0


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("missing", list(itertools.product((0, 7), (1, 3))))
def test_a_replay_with_holes_is_not_verified(missing: tuple[int, int]) -> None:
    """A block's first superframe taken out let 25 of them pass in the first edition."""
    place, count = missing
    sent = signed(160, on_air_s=BEGIN_S - 2400)
    for period in (BLOCK, 40):
        stream = [(i, None if (i - place) % period < count else one) for i, one in enumerate(sent)]
        verifier = Verifier(announced(), TOLERANCE_S)
        assert "verified" not in statuses(run(verifier, stream, BEGIN_S)).values()
        assert verifier.verified_after is None


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("delay_s", [0.0, 5.12, 9.6, 10.88, 20.48, 58.24])
def test_a_relay_is_bound_by_the_tolerance(delay_s: float) -> None:
    """Who holds all back until the keys are public can sign it anew; its age says so."""
    forged = signed(96, seed=77)
    begin_s = time_of(round(number_at(BEGIN_S))) + delay_s
    verifier = Verifier(announced(), TOLERANCE_S)
    found = statuses(run(verifier, enumerate(forged), begin_s))
    assert verifier.age_s == pytest.approx(delay_s)
    assert ("verified" in found.values()) == (delay_s <= TOLERANCE_S)


def test_no_relay_is_quicker_than_the_key() -> None:
    """From the first bit of a tag to the last of its key: what a relay has to hold back."""
    for layout, least_s, most_s in ((LAYOUTS[9], 4.4, 9.6), (LAYOUTS[2], 22.4, 60.8)):
        last = layout.block - 1
        assert (last - layout.quick - 1) * SUPERFRAME_S == pytest.approx(least_s, abs=0.1)
        assert last * SUPERFRAME_S == pytest.approx(most_s, abs=0.1)


def reduced(bits: int) -> types.SimpleNamespace:
    """Return `hashlib` whose chains have keys of so many bits: the highest ones are 0."""

    class Sha256:
        def __init__(self, data: bytes) -> None:
            self._data = data

        def digest(self) -> bytes:
            found = hashlib.sha256(self._data).digest()
            if len(self._data) != 44:  # no step of a chain
                return found
            return (int.from_bytes(found[:8], "big") & (1 << bits) - 1).to_bytes(8, "big")

    return types.SimpleNamespace(sha256=Sha256)


def inverted(chain: Chain, end: bytes, place: int, bits: int, rng: np.random.Generator) -> int:
    """Return the hashes it takes to find a key of the block at `place` that leads to an end."""
    hashes = 0
    while True:
        guess = int(rng.integers(1 << bits)).to_bytes(8, "big")
        hashes += place + 1
        if chain.before(guess, place, place + 1) == end:
            return hashes


def inverted_as_before(end: int, steps: int, bits: int, rng: np.random.Generator) -> int:
    """Return the same for the first edition: one function for all steps, all ways shared."""

    def step(value: int) -> int:
        data = b"one function" + value.to_bytes(8, "big")
        return int.from_bytes(hashlib.sha256(data).digest()[:8], "big") & (1 << bits) - 1

    hashes = 0
    while True:
        value = int(rng.integers(1 << bits))
        for _ in range(2 * steps):
            value, hashes = step(value), hashes + 1
            if value == end:
                return hashes


@pytest.mark.parametrize("bits", [14])
def test_inverting_a_chain_s_end_costs_all_keys(monkeypatch: pytest.MonkeyPatch, bits: int) -> None:
    """About 2^N hashes, however long the chain is; with one function, 2N/steps (issue 1)."""
    monkeypatch.setattr(chain_module, "hashlib", reduced(bits))
    rng, tries, place = np.random.default_rng(4), 24, 175
    costs = []
    for period in range(tries):
        chain = Chain(b"channel!", period, 9)
        secret = int(rng.integers(1 << bits)).to_bytes(8, "big")
        end = chain.before(secret, place, place + 1)
        costs.append(inverted(chain, end, place, bits, rng))
    mean = float(np.mean(costs)) / (1 << bits)
    assert 0.4 < mean < 2.5
    before = []
    for _ in range(tries):
        value = int(rng.integers(1 << bits))
        for _ in range(place + 1):
            data = b"one function" + value.to_bytes(8, "big")
            value = int.from_bytes(hashlib.sha256(data).digest()[:8], "big") & (1 << bits) - 1
        before.append(inverted_as_before(value, place + 1, bits, rng))
    assert np.mean(before) / (1 << bits) < 0.1


@pytest.mark.usefixtures("quick")
def test_one_superframe_of_another_width_changes_nothing() -> None:
    sent = [*signed(64)]
    sent[20] = (b"compact", (1, 2))
    verifier = Verifier(announced(), TOLERANCE_S)
    found = statuses(run(verifier, enumerate(sent), BEGIN_S))
    assert {found[at] for at in range(48) if at != 20} == {"verified"}
    assert found[20] == "forged"
    assert verifier.status == "verified"


def test_checks_prove_with_24_bits_whatever_is_lost() -> None:
    """Forged tags that pass with two checks left over: once in 2**24, so never in a search."""
    rng = np.random.default_rng(6)
    for _ in range(300):
        layout = LAYOUTS[int(rng.choice([9, 2]))]
        tags = {place: int(rng.integers(1 << 24)) for place in range(layout.block)}
        checks = dict(enumerate(checks_of(tags, layout.checks)))
        lost = int(rng.integers(layout.checks // 2))
        missing = {int(p) for p in rng.choice(layout.block, lost, replace=False)}
        left = rng.permutation(layout.checks)[: int(rng.integers(2 * lost + 2, layout.checks + 1))]
        told = {int(check): checks[int(check)] for check in left}
        there = {place: tag for place, tag in tags.items() if place not in missing}
        assert agree(told, there, missing) is True
        forged = dict(there)
        for place in rng.choice(list(there), int(rng.integers(1, 4)), replace=False):
            forged[int(place)] = int(rng.integers(1 << 24))
        assert forged == there or agree(told, forged, missing) is False


@pytest.mark.parametrize("kind", ["another broadcaster", "tags under keys of his own"])
def test_proofs_that_lead_nowhere_cost_little(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """256 s with a year's announcement: 134 s of processor time in the first edition."""
    spent, own = Counter[str](), announced()
    year = type(own)(
        own.name,
        own.public_key,
        own.first,
        own.first + 366 * 135_000,
        {9: own.ends[9] * 14, 2: own.ends[2] * 14},
        own.signature,
    )
    tried: dict[int, list[bytes]] = {}

    def count_tries(
        channel: bytes, sent: int, distance: int, covered: bytes, tag: int
    ) -> list[bytes]:
        spent["tries"] += 1
        if kind == "another broadcaster":
            return agreeing(channel, sent, distance, covered, tag) if spent["tries"] < 3 else []
        fake = tried.setdefault(sent, [(sent << 16 | 7).to_bytes(8, "big")])
        return [k for k in fake if tag_of(channel, k, distance, covered) == tag]

    def count_steps(self: Chain, known: bytes, place: int, steps: int = 1) -> bytes:
        spent["steps"] += steps
        return bytes(8)

    def count_places(self: Chain, known: bytes, earlier: bytes, places: range) -> list[int]:
        spent["steps"] += len(places)
        return []

    rng, count = np.random.default_rng(3), 400
    sent = signed(count, number=1)
    if kind != "another broadcaster":
        sent = []
        for _ in range(count // BLOCK):
            fake = (int(rng.integers(1 << 48)) << 16 | 7).to_bytes(8, "big")
            data = [rng.bytes(18) for _ in range(BLOCK)]
            quick = tag_of(own.channel, fake, BLOCK - LAYOUTS[9].quick, data[LAYOUTS[9].quick])
            number = quick << 48 | sent_bits(fake)
            fields = [number >> 9 * (BLOCK - 1 - at) & 511 for at in range(BLOCK)]
            sent += [(one, (value, 9)) for one, value in zip(data, fields, strict=True)]
    monkeypatch.setattr(search, "agreeing", count_tries)
    monkeypatch.setattr(Chain, "before", count_steps)
    monkeypatch.setattr(Chain, "places", count_places)
    for clock_s in (None, BEGIN_S):
        spent.clear()
        run(Verifier(year, TOLERANCE_S), enumerate(sent), clock_s)
        assert spent["tries"] <= 130
        assert spent["steps"] <= search._FIRST_HASHES + count * search._HASHES
        assert (spent["steps"] > 0) == (kind != "another broadcaster")
