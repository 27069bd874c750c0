"""No compiler warns about the sources; valgrind sees no read of uninitialised memory."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from receiver.export.device_voice import device_voice
from tests.receiver.native.building import FLAGS, INCLUDES, NATIVE, built
from tests.receiver.native.test_hearing import FS, payload, programme
from watermark import AudioEmbedder


def compile_silently(*command: str) -> None:
    files = [str(path) for path in NATIVE.glob("src/*.c")]
    assert len(files) > 30
    done = subprocess.run(
        [*command, *FLAGS, *INCLUDES, *files], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_no_warning(name: str) -> None:
    """`built` compiles the same files with optimisation, by the machine's own compiler."""
    if shutil.which(name) is None:
        pytest.skip(f"{name} is missing")
    compile_silently(name, "-fsyntax-only")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is missing")
def test_no_warning_by_zig(tmp_path: Path) -> None:
    library = str(tmp_path / "library.so")
    compile_silently(sys.executable, "-m", "ziglang", "cc", "-shared", "-fPIC", "-o", library)


@pytest.mark.slow
def test_valgrind_is_silent(tmp_path: Path) -> None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("valgrind is missing")
    voice = tmp_path / "voice.bin"
    voice.write_bytes(device_voice(load_voice()))
    embedder = AudioEmbedder(FS, 2, payload("standard"), profile="standard")
    sound = np.concatenate([embedder.process(programme()), embedder.flush()])[: 3 * FS]
    fuzz, hear = [built("fuzz"), "2000", "5", str(voice)], [built("cue_dec"), "--voice", str(voice)]
    for command in (fuzz, hear):
        done = subprocess.run(
            [valgrind, "--quiet", "--error-exitcode=9", *command],
            input=sound.astype("<f4").tobytes(),
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr.decode()[-3000:]
