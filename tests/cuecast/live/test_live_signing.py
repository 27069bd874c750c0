"""A running programme that is signed: verified by who receives it, over its changes too."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from codec.authentication.layout import LAYOUTS, number_at
from codec.cuer.motion import Motion
from codec.cuer.voice import load_voice
from codec.superframe.encoder import SuperframeEncoder
from cuecast.command.cli import main
from cuecast.demo.content import make_sound
from cuecast.demo.run import as_srt
from cuecast.dubbing.signing import Source
from cuecast.live.signing import LiveSigning

ON_AIR_S, ON_AIR = 1_801_422_176.0, "2027-01-31T19:02:56Z"
BEGIN = 6
"""Place in its block of the superframe that is due then: a block ends after 10 superframes, and the
next one, with the checks of these, within `SECONDS`."""
SECONDS = 18


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A key, and a programme as plain samples."""
    folder = tmp_path_factory.mktemp("signed")
    files = ["--secret", str(folder / "k.key"), "--public", str(folder / "k.pub")]
    assert main(["key", "new", "one", *files, "--days", "1", "--from", "2027-01-31"]) == 0
    _, subtitles = make_sound()
    (folder / "a.srt").write_text(as_srt(subtitles[:4]), encoding="utf-8")
    rng = np.random.default_rng(3)
    pcm = rng.normal(0, 2000, (SECONDS * 48_000, 2)).astype("<i2")
    (folder / "a.pcm").write_bytes(pcm.tobytes())
    return folder


def test_a_live_programme_is_verified(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    live = ["playout", str(folder / "a.pcm"), str(folder / "b.pcm"), "--low-delay"]
    live += ["--samples", "s16le:48000:2", "--subtitles", str(folder / "a.srt")]
    assert main([*live, "--sign", str(folder / "k.key"), "--on-air", ON_AIR]) == 0
    marked = np.fromfile(folder / "b.pcm", "<i2").reshape(-1, 2)
    wavfile.write(folder / "b.wav", 48_000, marked)
    capsys.readouterr()
    receive = ["receive", str(folder / "b.wav"), "--json", "--verify", str(folder / "k.pub")]
    assert main([*receive, "--on-air", ON_AIR]) == 0
    told = json.loads(capsys.readouterr().out)["authenticity"]
    assert told["status"] == "verified"
    assert told["superframes"]["forged"] == 0
    length = LAYOUTS[9].block
    assert round(number_at(ON_AIR_S)) % length == BEGIN
    assert told["superframes"]["verified"] == length - BEGIN + 1  # and one by the second quick tag


def test_a_secret_that_is_none(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    live = ["playout", str(folder / "a.pcm"), str(folder / "c.pcm")]
    assert main([*live, "--sign", str(folder / "a.srt")]) == 3
    assert "a.srt" in capsys.readouterr().err


def unsigned() -> Source:
    """Superframes with a place for a proof, all of them the same."""
    voice = load_voice("claire")
    rest = np.zeros((32, len(voice.layout)), np.float32)
    still = Motion(rest, 50.0, 0.0, voice.layout, voice.identity)
    encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=0, signed=True)
    made = encoder.encode(still, 0)
    return lambda k: (made.l0, b"")


def test_no_number_is_used_twice_and_memory_does_not_grow(folder: Path) -> None:
    """A run that ends after one superframe and begins anew, again and again."""
    signing = LiveSigning(str(folder / "k.key"), ON_AIR_S, 5.0)
    source, used = unsigned(), 0
    for first in range(40):
        one = signing.run(0.3 * first, first)
        one.source(source, first)(0)
        assert one.signer is not None
        assert one.signer.number > used
        used = one.signer.number
    assert used - number_at(ON_AIR_S) == pytest.approx(40, abs=1)
    long = signing.run(100.0, 40)
    signed = long.source(source, 40)
    for k in range(200):
        signed(k)
    assert len(long._signed) <= 64
    assert long.signer is not None
    assert long.signer.number >= used + 200
    assert len(long.signer._sent) <= 32
