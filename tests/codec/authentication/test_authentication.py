"""Authentic cues: genuine ones are verified soon, forged, replayed and spliced ones never."""

import itertools
import stat
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from codec.authentication.announcement import (
    Announcement,
    SigningKey,
    load_announcement,
    load_signing_key,
    new_key,
)
from codec.authentication.chain import Chain, agreeing, keys_of, sent_bits, tag_of
from codec.authentication.layout import (
    EPOCH_S,
    HIDDEN_BITS,
    LAYOUTS,
    PERIOD,
    SUPERFRAME_S,
    number_at,
    time_of,
)
from codec.authentication.signer import Signer
from codec.authentication.verifier import Verdict, Verifier
from codec.errors import CueError
from spec.reference import authentication as reference

pytestmark = pytest.mark.long(13)

BEGIN_S = EPOCH_S + 300 * 86400.0 + 0.3
Sent = tuple[bytes, tuple[int, int]]


@cache
def key(number: int = 0) -> SigningKey:
    return SigningKey(f"channel {number}", bytes([number]) * 32)


@cache
def announced(number: int = 0) -> Announcement:
    return key(number).announce(BEGIN_S, 1)


def signed(
    count: int, width: int = 9, *, on_air_s: float = BEGIN_S, number: int = 0, seed: int = 1
) -> list[Sent]:
    """Return superframes of a signed programme: what is covered, and their fields."""
    rng = np.random.default_rng(seed)
    signer = Signer(key(number), on_air_s, width)
    covered = [rng.bytes(18 if width == 9 else 7) for _ in range(count)]
    return [(data, (signer.take(data), width)) for data in covered]


def run(
    verifier: Verifier, stream: Iterable[tuple[int, Sent | None]], clock_s: float | None = None
) -> list[Verdict]:
    verdicts = []
    for index, sent in stream:
        utc_s = None if clock_s is None else clock_s + index * SUPERFRAME_S
        covered, proof = (None, None) if sent is None else sent
        verdicts += verifier.take(index, covered, proof, utc_s=utc_s)
    return verdicts + verifier.finish()


def statuses(verdicts: list[Verdict]) -> dict[int, str]:
    return {verdict.index: verdict.status for verdict in verdicts}


@pytest.mark.parametrize(("width", "most_s"), [(9, 5.2), (2, 28.2)])
@pytest.mark.parametrize("clock_s", [None, BEGIN_S + 3.0])
def test_a_genuine_programme_is_verified(width: int, most_s: float, clock_s: float | None) -> None:
    count = 300 if width == 2 else 80
    verifier = Verifier(announced())
    verdicts = run(verifier, enumerate(signed(count, width)), clock_s)
    assert verifier.verified_after is not None
    assert verifier.verified_after * SUPERFRAME_S <= most_s
    assert verifier.status == "verified"
    assert [v.index for v in verdicts] == list(range(count))
    found = [v.status for v in verdicts]
    tail = LAYOUTS[width].whole.farthest
    assert set(found[:-tail]) == {"verified"}
    assert "forged" not in found


@pytest.mark.parametrize(
    ("width", "phases"),
    [
        (9, (0, 3, 7)), (2, (0, 27)),
        pytest.param(9, tuple(range(LAYOUTS[9].block)), marks=pytest.mark.slow),
        pytest.param(2, (0, 10, 27), marks=pytest.mark.slow),
    ],
)  # fmt: skip
@pytest.mark.parametrize("how", ["clock", "likely"])
def test_tuned_in_anywhere(width: int, phases: tuple[int, ...], how: str) -> None:
    """Within ten seconds at 9 bits, a minute at 2, whatever the phase; so with a good guess."""
    layout = LAYOUTS[width]
    sent = signed(6 * layout.block, width)
    after = []
    for start in phases:
        verifier = Verifier(announced(), likely_s=(BEGIN_S - 3000, BEGIN_S + 2e6))
        stream = list(enumerate(sent))[start + layout.block :]
        for index, (data, field) in stream:
            utc_s = BEGIN_S + index * SUPERFRAME_S if how == "clock" else None
            verifier.take(index, data, field, utc_s=utc_s)
            if verifier.verified_after is not None:
                break
        assert verifier.verified_after is not None
        after.append(verifier.verified_after * SUPERFRAME_S)
    assert max(after) <= (9.0 if width == 9 else 50.0)
    assert np.mean(after) <= (6.8 if width == 9 else 39.1)


def test_without_time_or_guess_a_whole_window_tells_the_hour() -> None:
    verifier = Verifier(announced())
    run(verifier, list(enumerate(signed(60)))[11:])
    assert verifier.verified_after is not None
    assert verifier.verified_after * SUPERFRAME_S <= 20.0
    assert verifier.status == "verified"


def test_the_hour_s_chain_goes_over_into_the_next() -> None:
    begin_s = time_of((number_at(BEGIN_S) // PERIOD + 1) * PERIOD - 30)
    for lost in (range(0), range(28, 33)):
        verifier = Verifier(announced())
        stream = [(i, None if i in lost else s) for i, s in enumerate(signed(80, on_air_s=begin_s))]
        found = statuses(run(verifier, stream, begin_s))
        assert verifier.status == "verified"
        assert "forged" not in found.values()
        assert found[50] == "verified" or lost


def test_losses_are_unknown_and_verified_again() -> None:
    """The keys of lost blocks follow from later ones."""
    rng = np.random.default_rng(3)
    stream = [(i, s if rng.random() > 0.03 else None) for i, s in enumerate(signed(250))]
    verifier = Verifier(announced())
    found = list(statuses(run(verifier, stream, BEGIN_S)).values())
    assert "forged" not in found
    assert verifier.verified_after is not None
    assert found.count("verified") > 0.3 * len(found)


def test_a_changed_superframe_is_not_verified() -> None:
    """At every place within a block."""
    sent = signed(60)
    for index in range(20, 45, 3):
        changed = list(sent)
        data, proof = changed[index]
        changed[index] = (bytes([data[0] ^ 1]) + data[1:], proof)
        found = statuses(run(Verifier(announced()), enumerate(changed), BEGIN_S))
        assert found[index] == "forged"
        assert found[index - 20] == "verified" or index < 36
        assert list(found.values())[:8] == ["verified"] * 8


@pytest.mark.parametrize("what", ["nothing", "noise", "another's", "zeros", "his own tags"])
def test_a_forged_programme_is_never_verified(what: str) -> None:
    """Also where the forger knows all keys that were on air until then."""
    rng = np.random.default_rng(5)
    genuine, forged = signed(40), []
    other = signed(40, number=1)
    for index, (_, (value, _)) in enumerate(genuine):
        data = rng.bytes(18)
        field = {
            "nothing": None, "noise": (int(rng.integers(512)), 9), "another's": other[index][1],
            "zeros": (0, 9), "his own tags": (value, 9),
        }[what]  # fmt: skip
        forged.append((data, field))
    verifier = Verifier(announced())
    verdicts = []
    for index, (data, field) in enumerate(forged):
        utc_s = BEGIN_S + index * SUPERFRAME_S
        verdicts += verifier.take(index, data, field, utc_s=utc_s)
    found = statuses(verdicts + verifier.finish())
    assert "verified" not in found.values()
    assert verifier.status != "verified"


@pytest.mark.parametrize("hours", [-0.05, 1.0, 5.0])
def test_a_replay_is_told(hours: float) -> None:
    then_s = BEGIN_S + 10 * 3600
    verifier = Verifier(announced())
    found = statuses(run(verifier, enumerate(signed(80, on_air_s=then_s)), then_s + hours * 3600))
    assert "verified" not in found.values()
    if abs(hours) < 1.5:
        assert verifier.status == "forged"
        assert verifier.reason.startswith("from another time")


def test_a_replay_without_a_clock_is_told_by_what_came_before() -> None:
    """Another hour of the same broadcaster, cut into a recording."""
    verifier = Verifier(announced())
    first = signed(60)
    later = signed(60, on_air_s=BEGIN_S + 7200, seed=2)
    verdicts = run(verifier, enumerate(first))
    assert statuses(verdicts)[5] == "verified"
    found = statuses(run(verifier, enumerate(later, start=60)))
    assert "verified" not in found.values()
    assert verifier.reason.startswith("from another time, +71")


def test_time_is_told() -> None:
    verifier = Verifier(announced())
    stream = list(enumerate(signed(40)))
    for index, (data, field) in stream:
        verifier.take(index, data, field)
    assert verifier.on_air_s == pytest.approx(BEGIN_S, abs=2.6)


def test_another_broadcaster_is_unknown() -> None:
    found = statuses(run(Verifier(announced()), enumerate(signed(40, number=1)), BEGIN_S))
    assert set(found.values()) == {"unknown"}


@pytest.mark.parametrize("width", [9, 2])
def test_all_keys_under_which_a_tag_agrees_are_found(width: int) -> None:
    """The quick search tells what trying each key with `tag_of` tells."""
    tag, digest, sent = LAYOUTS[width].quick, bytes(range(32)), 0x800012345678
    first = sent << HIDDEN_BITS
    keys = [(first | hidden).to_bytes(8, "big") for hidden in range(1 << HIDDEN_BITS)]
    tags = [tag_of(key, digest, tag) for key in keys]
    for told in (0, tags[0], max(tags), (1 << tag.bits) - 1):
        expected = [key for key, found in zip(keys, tags, strict=True) if found == told]
        assert agreeing(sent, digest, tag, told) == expected


def test_keys_lead_to_earlier_ones_only() -> None:
    keys = keys_of(b"s" * 32, b"channel!", 7, LAYOUTS[2])
    chain = Chain(b"channel!", 7, 2)
    assert len(set(keys)) == len(keys) == 128
    assert all(chain.before(b) == a for a, b in itertools.pairwise(keys))
    assert chain.before(keys[90], 50) == keys[40]
    assert chain.find(sent_bits(keys[5]), keys[3], 2) == keys[5]
    assert chain.find(sent_bits(keys[5]) ^ 1, keys[3], 2) is None
    assert chain.find(sent_bits(keys[6]), keys[5], 1) == keys[6]
    digest, tag = b"d" * 32, LAYOUTS[2].quick
    assert agreeing(sent_bits(keys[6]), digest, tag, tag_of(keys[6], digest, tag)) == [keys[6]]
    assert keys_of(b"s" * 32, b"channel!", 8, LAYOUTS[2])[0] != keys[0]
    assert keys_of(b"s" * 32, b"another!", 7, LAYOUTS[2])[0] != keys[0]


@pytest.mark.parametrize("width", [9, 2])
def test_the_specification_s_reference_agrees(width: int) -> None:
    """Blocks that it reads from the text only: keys, tags, places."""
    layout = LAYOUTS[width]
    signer = Signer(key(), BEGIN_S, width)
    first = signer.number
    sent = signed(3 * layout.block, width)
    for block in (1, 2):
        begin = -(-first // layout.block) * layout.block + (block - 1) * layout.block
        period, place = divmod(begin, PERIOD)
        at = begin - first
        fields = [value for _, (value, _) in sent[at : at + layout.block]]
        end = announced().end_of(period, width)
        assert end is not None
        found = reference.key_of_block(
            fields, width, place // layout.block, period, announced().channel, end
        )
        assert found is not None
        until = at + layout.block
        before = {until - i: data for i, (data, _) in enumerate(sent[:until])}
        told = reference.told_tags(fields, width)
        assert reference.tags_of(before, width, found) == told
        changed = before | {layout.block + 1: b"x"}
        assert reference.tags_of(changed, width, found)[0] != told[0]
        changed = before | {layout.quick.nearest: b"x"}
        assert reference.tags_of(changed, width, found)[1] != told[1]


def test_files(tmp_path: Path) -> None:
    secret, public = tmp_path / "channel.key", tmp_path / "channel.pub"
    made = new_key("Chaîne 1")
    made.save(secret)
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    with pytest.raises(CueError, match="cannot write: File exists"):
        made.save(secret)
    assert load_signing_key(secret) == made
    announcement = made.announce(BEGIN_S, 1)
    announcement.save(public)
    again = load_announcement(public)
    assert again == announcement
    assert again.continues(load_announcement(public))
    assert not again.continues(announced())
    assert len(again.fingerprint) == 39
    assert made.secret.hex() not in public.read_text()
    for path, kind in ((secret, "public"), (public, "secret")):
        with pytest.raises(CueError, match=f"not a {kind} key of cuecast"):
            (load_announcement if kind == "public" else load_signing_key)(path)


def test_an_announcement_that_was_changed_is_refused(tmp_path: Path) -> None:
    announcement = announced()
    ends = {width: bytes(8) + ends[8:] for width, ends in announcement.ends.items()}
    for changed in (
        replace(announcement, name="another"), replace(announcement, ends=ends),
        replace(announcement, first_period=announcement.first_period + 1),
        replace(announcement, public_key=key(1).public_key),
    ):  # fmt: skip
        changed.save(tmp_path / "x.pub")
        with pytest.raises(CueError, match="the signature is not that of the key in it"):
            load_announcement(tmp_path / "x.pub")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "cuecast-key-1"}', "[" * 5000, "\0"])
def test_damaged_files(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x"
    path.write_text(text)
    for load in (load_announcement, load_signing_key):
        with pytest.raises(CueError, match="key of cuecast"):
            load(path)
