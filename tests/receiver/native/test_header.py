"""The header's example is the one that is built and run."""

import subprocess
from pathlib import Path

import numpy as np

from codec.cuer.voice import load_voice
from receiver.export.device_voice import device_voice
from tests.receiver.native.building import NATIVE, built


def test_example_is_the_same_text() -> None:
    header = (NATIVE / "include" / "cuecast.h").read_text(encoding="utf-8")
    example = (NATIVE / "examples" / "keys.c").read_text(encoding="utf-8")
    shown = "".join(f" *     {line}".rstrip() + "\n" for line in example.splitlines())
    assert shown in header
    body = example[example.index("int main") :].strip().splitlines()
    assert len(body) <= 22


def test_example_runs_over_silence_and_refuses_a_page(tmp_path: Path) -> None:
    (tmp_path / "voice.bin").write_bytes(device_voice(load_voice()))
    (tmp_path / "page.bin").write_bytes(b"<html>not found</html>")
    silence = np.zeros((48000, 2), np.float32).tobytes()
    program = built("keys")
    for name, code in (("voice.bin", 0), ("page.bin", 3)):
        done = subprocess.run(
            [program, str(tmp_path / name)], input=silence, capture_output=True, check=False
        )
        assert (done.returncode, done.stdout) == (code, b"")
