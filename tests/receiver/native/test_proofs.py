"""Proofs by the native receiver: as the toolkit's verifier says, and from marked sound."""

import hashlib
import json
import re
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.authentication.announcement import Announcement, SigningKey
from codec.authentication.layout import EPOCH_S, SUPERFRAME_S
from codec.authentication.signer import Signer
from codec.authentication.verifier import Verifier
from codec.superframe.bits import Header
from codec.superframe.checks import proved, with_check, with_proof
from cuecast.conformance.program import Program
from tests.codec.authentication import test_authentication as genuine_stream
from tests.codec.quick_search import quick_search
from tests.receiver.native.building import NATIVE, built
from watermark import AudioEmbedder

BEGIN_S = EPOCH_S + 300 * 86400.0 + 0.3
KEY = SigningKey("Télé \N{OLD PERSIAN SIGN A}", bytes(range(32)))


@cache
def announced() -> Announcement:
    return KEY.announce(BEGIN_S - 3600, 2)


@pytest.fixture(scope="module")
def public(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("keys") / "public.json"
    announced().save(path)
    return path


@pytest.mark.parametrize(
    ("lost", "changed", "clock_s", "first"),
    [
        ([], [], 2.0, 3),
        ([20, 40], [50], 2.0, 0),
        ([], [], None, 5),
        ([31, 33], [7], None, 0),
        ([], [], 40.0, 0),
    ],
)
def test_the_verdicts_of_the_toolkit(
    public: Path, lost: list[int], changed: list[int], clock_s: float | None, first: int
) -> None:
    rng = np.random.default_rng(5)
    signer, verifier = Signer(KEY, BEGIN_S, 9), Verifier(announced(), 10.0)
    expected: dict[str, str] = {}
    with Program([built("cue_conform")]) as program, quick_search(KEY, announced().periods):
        program.ask("trust", file=public.read_bytes().hex(), tolerance_ms=10000)
        for index in range(80):
            covered = rng.bytes(18)
            proof = signer.take(covered)
            if index < first or index in lost:
                continue
            covered = bytes([covered[0] ^ (index in changed)]) + covered[1:]
            utc_s = None if clock_s is None else BEGIN_S + clock_s + SUPERFRAME_S * index
            clock = {} if utc_s is None else {"utc_ms": round(1000 * utc_s)}
            program.ask("proof", index=index, covered=covered.hex(), field=proof, width=9, **clock)
            found = verifier.take(index, covered, (proof, 9), utc_s=utc_s)
            expected |= {str(v.index): v.status for v in found}
        expected |= {str(v.index): v.status for v in verifier.finish()}
        assert program.ask("verdicts")["statuses"] == expected
    assert len(set(expected.values())) > 1 or clock_s == 40.0


@pytest.mark.parametrize("clock_s", [genuine_stream.BEGIN_S, None])
def test_a_wrong_key_beside_the_right_one(tmp_path: Path, clock_s: float | None) -> None:
    """The right one is the second: found by the clock, and by the key of the block after."""
    sent = genuine_stream.signed(33, seed=genuine_stream.TWO_KEYS_SEED)
    genuine_stream.announced().save(tmp_path / "public.json")
    with Program([built("cue_conform")]) as program:
        text = (tmp_path / "public.json").read_bytes()
        program.ask("trust", file=text.hex(), tolerance_ms=10000)
        for index, (covered, (field, width)) in enumerate(sent[: 16 if clock_s else 32]):
            clock = {"utc_ms": round(1000 * (clock_s + SUPERFRAME_S * index))} if clock_s else {}
            program.ask(
                "proof", index=index, covered=covered.hex(), field=field, width=width, **clock
            )
        statuses = program.ask("verdicts")["statuses"]
    assert "verified" in statuses.values()


def test_files_that_are_not_trusted(public: Path) -> None:
    text = public.read_text(encoding="utf-8")
    spaced = text.replace(":", " :\r\n\t").replace("T\\u00e9l", "T\\u00E9l")
    other_name = text.replace("T\\u00e9l", "Tel")
    assert other_name != text
    with Program([built("cue_conform")]) as program:
        for wrong, section in (
            (spaced, ""),
            (text[:-9], "E15"),
            (other_name, "E16"),
            ("[" * 5000, "E15"),
            ("", "E15"),
            (text.replace("public_key", "key"), "E15"),
            (text.replace('"until": ', '"until": 1'), "E15"),
        ):
            answer = program.ask("trust", file=wrong.encode().hex())
            assert answer.get("section", "") == section
            assert answer["trusted"] is (section == "")


def test_the_hosts_own_function(public: Path) -> None:
    for verdict in ("1", "0"):
        done = subprocess.run(
            [built("trust"), str(public), verdict], capture_output=True, text=True, check=True
        )
        report = json.loads(done.stdout)
        bare = re.sub(r",\s*\"signature\".*", "}", public.read_text(encoding="utf-8"), flags=re.S)
        message = json.dumps(json.loads(bare), sort_keys=True, separators=(",", ":")).encode()
        assert report["message"] == hashlib.sha256(message).hexdigest()
        assert report["status"] == (0 if verdict == "1" else -4)
        assert ("E16" in report["text"]) is (verdict == "0")


def test_vendored_sources_are_as_they_came() -> None:
    folder = NATIVE / "vendor" / "monocypher"
    stated = re.findall(r"^(\w{64})  (\S+)$", (folder / "README.md").read_text(), re.MULTILINE)
    assert len(stated) == 2
    for digest, name in stated:
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest


@cache
def marked_sound() -> NDArray[np.float32]:
    """Noise of 25 s with signed superframes of arbitrary content, (n, 1)."""
    signer, sent = Signer(KEY, BEGIN_S, 9), dict[int, bytes]()
    rng = np.random.default_rng(7)

    def payload(k: int) -> tuple[bytes, bytes]:
        if k not in sent:
            header = Header(0, k % 64, 2, signed=True).to_bytes()
            l0 = with_check(header + rng.bytes(16), 16 * "0")
            sent[k] = with_proof(l0, signer.take(proved(l0)))
        return sent[k], rng.bytes(7)

    embedder = AudioEmbedder(48000, 1, payload)
    noise = 0.03 * rng.standard_normal((48000 * 25, 1)).astype(np.float32)
    return np.concatenate([embedder.process(noise), embedder.flush()])


@pytest.mark.slow
@pytest.mark.parametrize("age_s", [3.0, 30.0])
def test_from_marked_sound(public: Path, age_s: float) -> None:
    """The first block is verified when the second one's checks and key have come."""
    sound = marked_sound()
    command = [
        built("cue_dec"), "--channels", "1", "--trust", str(public), "--utc", str(BEGIN_S + age_s)
    ]  # fmt: skip
    done = subprocess.run(command, input=sound.tobytes(), capture_output=True, check=True)
    events = [json.loads(line) for line in done.stdout.decode().splitlines()]
    proofs = [e for e in events if e["kind"] == "proof"]
    status = "verified" if age_s < 10 else "forged"
    assert [e["status"] for e in proofs[:16]] == [status] * 16
    places = [round(e["time_s"] / SUPERFRAME_S) for e in proofs[:16]]
    assert sorted(places) == list(range(16))  # each is reported when it is known
    assert proofs[0]["age_s"] == pytest.approx(age_s, abs=0.4)
    assert events[-1]["proofs" if status == "verified" else "forged"] >= 16
