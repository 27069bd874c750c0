"""Vectors of proofs: by hashlib alone, by the plain reference, and by the toolkit."""

import base64
import json
from collections.abc import Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from codec.authentication import chain, search, verifier
from codec.authentication import checks as toolkit_checks
from codec.authentication.announcement import load_announcement
from codec.authentication.chain import Chain, tag_of
from codec.authentication.layout import PERIOD, time_of
from codec.authentication.verifier import Verifier
from codec.errors import CueError
from spec.reference import authentication as plain
from spec.reference import ed25519

PATH = Path(__file__).parents[2] / "spec" / "vectors" / "authentication.json"
DOCUMENT: dict[str, Any] = json.loads(PATH.read_text(encoding="utf-8"))
CHANNEL = bytes.fromhex(DOCUMENT["channel"])


def of(kind: str) -> pytest.MarkDecorator:
    chosen = [case for case in DOCUMENT["cases"] if case["id"].startswith(kind)]
    assert chosen
    return pytest.mark.parametrize("case", chosen, ids=lambda case: case["id"])


def arrivals(case: dict[str, Any]) -> dict[int, tuple[bytes, int, float]]:
    """Return what arrives of a stream, by public number: what is covered, field, age in seconds."""
    stream = DOCUMENT["streams"][str(case["width"])]
    taken = {}
    for at, (text, field) in enumerate(zip(stream["covered"], stream["fields"], strict=True)):
        covered = bytearray.fromhex(text)
        covered[0] ^= at in case["changed"]
        age_s = case["ages_s"][-1 if at in case["aged"] else 0]
        if at not in case["lost"]:
            taken[case["first"] + at] = bytes(covered), field, age_s
    return taken


def letters(case: dict[str, Any], found: dict[int, str]) -> str:
    count = len(DOCUMENT["streams"][str(case["width"])]["fields"])
    return "".join(found.get(case["first"] + at, "-")[0] for at in range(count))


@of("step")
def test_a_step(case: dict[str, Any]) -> None:
    key, period, width, block = (case[name] for name in ("key", "period", "width", "block"))
    prefix = sha256(b"cuecast-step-3" + CHANNEL + bytes([0, 0, 0, period, width])).hexdigest()
    by_hand = sha256(bytes.fromhex(prefix + f"{block:08x}" + key)).hexdigest()[:16]
    assert case["before"] == by_hand
    assert plain.before(bytes.fromhex(key), CHANNEL, period, width, block).hex() == by_hand
    found = Chain(CHANNEL, period, width).before(bytes.fromhex(key), block)
    assert found.hex() == by_hand


@of("tag")
def test_a_tag(case: dict[str, Any]) -> None:
    key, covered, distance = bytes.fromhex(case["key"]), case["covered"], case["distance"]
    data = b"cuecast-tag-3" + CHANNEL + key + bytes.fromhex(f"{distance:04x}{covered}")
    assert f"{case['tag']:06x}" == sha256(data).hexdigest()[:6]
    assert plain.tag_of(bytes.fromhex(covered), CHANNEL, key, distance) == case["tag"]
    assert tag_of(CHANNEL, key, distance, bytes.fromhex(covered)) == case["tag"]


@of("checks")
def test_checks(case: dict[str, Any]) -> None:
    tags = {place: tag for place, tag in enumerate(case["tags"]) if tag is not None}
    missing = [place for place, tag in enumerate(case["tags"]) if tag is None]
    checks = dict(enumerate(case["checks"]))
    assert plain.agree(checks, tags, len(case["tags"])) is case["agree"]
    assert toolkit_checks.agree(checks, tags, missing) is case["agree"]
    if not missing:
        assert toolkit_checks.checks_of(tags, len(checks)) == case["checks"]
        assert plain.checks_of(tags, len(checks)) == case["checks"]


@pytest.fixture(scope="module")
def each_key_found_once() -> Iterator[None]:
    """The streams' cases share their keys: what was found by trying is remembered."""
    find, remembered = Chain.find, cache(chain.agreeing)

    @cache
    def found(prefix: bytes, sent: int, place: int, known: bytes, steps: int) -> bytes | None:
        return find(chains[prefix], sent, place, known, steps)

    def find_once(self: Chain, sent: int, place: int, known: bytes, steps: int) -> bytes | None:
        chains[self._prefix] = self
        return found(self._prefix, sent, place, known, steps)

    chains: dict[bytes, Chain] = {}
    with (
        mock.patch.object(Chain, "find", find_once),
        mock.patch.object(search, "agreeing", remembered),
        mock.patch.object(verifier, "agreeing", remembered),
        mock.patch.object(plain, "key_of_block", cache(plain.key_of_block)),
    ):
        yield


@pytest.fixture(scope="module")
def public(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("keys") / "third.pub"
    document = next(case["public"] for case in DOCUMENT["cases"] if case["id"] == "file-third")
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.usefixtures("each_key_found_once")
@of("stream")
def test_a_stream(case: dict[str, Any], public: Path) -> None:
    announced = load_announcement(public)
    assert announced.channel == CHANNEL
    taken, tolerance_s = arrivals(case), case["tolerance_s"]
    receiver = Verifier(announced, tolerance_s)
    verdicts = []
    for number, (covered, field, age_s) in taken.items():
        utc_s = time_of(number) + age_s
        verdicts += receiver.take(number, covered, (field, case["width"]), utc_s=utc_s)
    verdicts += receiver.finish()
    assert letters(case, {v.index: v.status for v in verdicts}) == case["statuses"]
    end = announced.end_of(case["first"] // PERIOD, case["width"])
    found = plain.statuses(taken, CHANNEL, case["width"], end, tolerance_s)
    assert letters(case, found) == case["statuses"]


@of("file")
def test_a_file(case: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "one.pub"
    path.write_text(json.dumps(case["public"]), encoding="utf-8")
    bare = {name: value for name, value in case["public"].items() if name != "signature"}
    message = json.dumps(bare, sort_keys=True, separators=(",", ":")).encode()
    owner, signature = (base64.b64decode(case["public"][n]) for n in ("public_key", "signature"))
    assert ed25519.holds(owner, message, signature) is case["valid"]
    if case["valid"]:
        held = load_announcement(path)
        assert (held.first, held.until) == (case["public"]["first"], case["public"]["until"])
        return
    first = case["public"]["format"] == "cuecast-key-1"
    with pytest.raises(CueError, match="first edition" if first else "signature"):
        load_announcement(path)


def test_a_signature_of_rfc_8032() -> None:
    """Test 1 of its section 7.1."""
    secret = bytes.fromhex("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60")
    public = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"
    assert ed25519.public_key_of(secret).hex() == public
    signature = ed25519.sign(secret, b"")
    assert signature.hex().startswith("e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065")
    assert ed25519.holds(bytes.fromhex(public), b"", signature)
