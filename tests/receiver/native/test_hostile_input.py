"""Random superframes under sanitizers; a state that is copied and its old place overwritten."""

import json
import random
import subprocess
from pathlib import Path

import pytest

from codec.cuer.voice import load_voice
from codec.superframe.coding import coding_for
from receiver.export.device_voice import device_voice
from spec.reference.stream_bytes import one
from tests.receiver.native.building import SANITIZE, SANITIZE_FAST, built


@pytest.fixture
def voice(tmp_path: Path) -> str:
    path = tmp_path / "voice.bin"
    path.write_bytes(device_voice(load_voice()))
    return str(path)


def fuzzed(voice: str, count: int, seed: int, flags: tuple[str, ...]) -> dict[str, int]:
    program = built("fuzz", *flags)
    done = subprocess.run(
        [program, str(count), str(seed), voice], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    report: dict[str, int] = json.loads(done.stdout)
    return report


def test_a_thousand_superframes_under_sanitizers(voice: str) -> None:
    report = fuzzed(voice, 1000, 1, SANITIZE)
    assert report["superframes"] == 1000
    assert report["drawn"] > 10
    assert report["events"] > 1500


@pytest.mark.slow
def test_a_million_superframes_under_sanitizers(voice: str) -> None:
    for seed in range(10):
        assert fuzzed(voice, 100_000, 100 + seed, SANITIZE_FAST)["drawn"] > 1000


def test_a_copied_state_goes_on(voice: str) -> None:
    coding, rng = coding_for(load_voice()).identity, random.Random(3)
    lines = "\n".join(one(rng, coding, 0, k % 64).hex() for k in range(60))
    done = subprocess.run(
        [built("poison"), voice], input=lines, capture_output=True, text=True, check=False
    )
    report = json.loads(done.stdout)
    assert report["same"] is True
    assert report["superframes"] == 60
    assert report["events"] > 1000
