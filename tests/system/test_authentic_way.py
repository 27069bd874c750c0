"""From a key to a verdict through the command line."""

import json
import os
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import soundfile

from cuecast.command.cli import main

pytestmark = pytest.mark.long(7)

ON_AIR = "2027-03-01T20:00:00Z"
SECONDS, LINES = 36, 9
UNSIGNED_S = 12
"""Of the programme's begin, dubbed without a key."""

WORDS = (
    "Bonjour madame.", "Il fait beau.", "Tu viens demain ?", "Le chat dort.", "Nous partons.",
    "Elle chante bien.", "Où est la gare ?", "Merci beaucoup.", "Le train arrive.",
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("authentic")
    rng = np.random.default_rng(1)
    host = np.convolve(rng.normal(0, 1, SECONDS * 48000), np.exp(-np.arange(60) / 9), "same")
    soundfile.write(folder / "p.wav", 0.03 * host, 48000)
    soundfile.write(folder / "begin.wav", 0.03 * host[: UNSIGNED_S * 48000], 48000)
    times = [f"00:00:{2 * n + 1:02d},000 --> 00:00:{2 * n + 2:02d},900" for n in range(LINES)]
    lines = [f"{n + 1}\n{time}\n{WORDS[n]}\n" for n, time in enumerate(times)]
    (folder / "p.srt").write_text("\n".join(lines), encoding="utf-8")
    for name in ("one", "two"):
        files = ["--secret", str(folder / f"{name}.key"), "--public", str(folder / f"{name}.pub")]
        assert main(["key", "new", name, *files, "--days", "1", "--from", "2027-03-01"]) == 0
    dub = ["dub", str(folder / "p.wav"), "--subtitles", str(folder / "p.srt"), "--no-grade"]
    dub += ["--no-read-back"]
    signed = ["--sign", str(folder / "one.key"), "--on-air", ON_AIR]
    begin = ["dub", str(folder / "begin.wav"), *dub[2:]]
    assert main([*begin, "-o", str(folder / "plain.wav")]) == 0
    assert main([*dub, "-o", str(folder / "signed.wav"), *signed]) == 0
    sound, rate = soundfile.read(folder / "signed.wav")
    soundfile.write(folder / "first.wav", sound[: UNSIGNED_S * rate], rate)
    return folder


def received(
    folder: Path, capsys: pytest.CaptureFixture[str], name: str, *options: str
) -> dict[str, object]:
    capsys.readouterr()
    status = main(["receive", str(folder / name), "--json", *options])
    written = capsys.readouterr()
    document: dict[str, object] = json.loads(written.out)
    document |= {"exit": status, "told": written.err}
    return document


def test_signed_cues_are_verified_and_complete(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = received(folder, capsys, "plain.wav")
    assert plain["authenticity"] is None
    signed = received(folder, capsys, "signed.wav", "--verify", str(folder / "one.pub"))
    told = signed["authenticity"]
    assert isinstance(told, dict)
    assert told["status"] == "verified"
    assert told["of"] == "one"
    assert told["verified_s"] <= 26.0  # two blocks, since nothing tells the hour
    assert told["on_air"].startswith("2027-03-01T20:00:0") or told["on_air"].startswith(
        "2027-03-01T19:59:5"
    )
    assert told["superframes"]["forged"] == 0
    keys, plain_keys = signed["keys"], plain["keys"]
    assert isinstance(keys, list)
    assert isinstance(plain_keys, list)
    assert len(keys) > 20
    both = [
        [(k["shape"], k["placement"]) for k in one if k["start"] < UNSIGNED_S - 2]
        for one in (keys, plain_keys)
    ]
    assert both[0] == both[1]
    assert len(both[0]) > 8


@pytest.mark.parametrize(("begin_s", "how"), [(7.92, "file"), (10.48, "told")])
def test_verified_soon_after_tuning_in(
    folder: Path, capsys: pytest.CaptureFixture[str], begin_s: float, how: str
) -> None:
    """From any place of the sound on, with the time told or taken from the file."""
    sound, rate = soundfile.read(folder / "signed.wav")
    path = folder / f"from-{begin_s}.wav"
    soundfile.write(path, sound[round(begin_s * rate) :], rate)
    moment = datetime.fromisoformat(ON_AIR) + timedelta(seconds=begin_s)
    options = ["--on-air", moment.isoformat()]
    if how == "file":
        os.utime(path, 2 * (moment.timestamp() + 1800,))
        options = []
    told = received(folder, capsys, path.name, "--verify", str(folder / "one.pub"), *options)
    authenticity = told["authenticity"]
    assert isinstance(authenticity, dict)
    assert authenticity["status"] == "verified"
    assert authenticity["verified_s"] <= (15.5 if how == "told" else 26.0)


def test_who_trusts_another_sees_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, key in (("first.wav", "two.pub"), ("plain.wav", "one.pub")):
        found = received(folder, capsys, name, "--trust", str(folder / key))
        assert found["exit"] == 1
        assert found["keys"] == []
        told = found["authenticity"]
        assert isinstance(told, dict)
        assert told["status"] == ("unknown" if name == "first.wav" else "unsigned")


def test_who_trusts_him_sees_what_is_verified(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right = ["--trust", str(folder / "one.pub")]
    found = received(folder, capsys, "signed.wav", *right, "--on-air", ON_AIR)
    assert found["exit"] == 0
    keys = found["keys"]
    assert isinstance(keys, list)
    assert len(keys) > 20
    assert "superframes are not shown: nothing proves them" in str(found["told"])
    late = received(folder, capsys, "signed.wav", *right, "--on-air", "2027-03-01T21:00:00Z")
    assert late["keys"] == []
    told = late["authenticity"]
    assert isinstance(told, dict)
    assert told["status"] == "forged"
    assert str(told["reason"]).startswith("from another time, 36")
