"""The native receiver as WebAssembly under node passes the vectors: needs zig and node."""

import importlib.util
import shutil
from pathlib import Path

import pytest

from cuecast.conformance.examine import examine
from cuecast.conformance.verdict import CLASSES
from receiver.native.build import HERE, build_conformer

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is missing"),
    pytest.mark.skipif(shutil.which("node") is None, reason="node is missing"),
]


def test_wasm_passes_all_vectors(tmp_path: Path) -> None:
    module = tmp_path / "cue_conform.wasm"
    build_conformer(module)
    driver = str(HERE / "tools" / "cue_conform.mjs")
    report = examine(["node", "--no-warnings", driver, str(module)])
    assert report.failed == ()
    assert report.reached() == tuple(CLASSES)
