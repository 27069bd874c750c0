"""Vectors that aim at one thing: rare superframes, foreign parts, registers, a voice, pictures."""

import base64
import json
import zlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.errors import BitstreamError, VoiceError
from codec.superframe.bits import version_of
from codec.superframe.checks import is_own
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.foreign import ForeignStream
from codec.superframe.slow_channel import SlowReceiver
from codec.superframe.transform import Basis
from spec.reference import superframe as reference
from tests.spec.test_bitstream_reference import decode_both, said
from watermark.link.link import Link
from watermark.video.demodulate import soft_bits
from watermark.video.grid import Grid
from watermark.video.modes import make_modes
from watermark.video.profile import LONE, PROFILES

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
MEANINGS = ("programme", "stream", "language", "coding", "host")
IDENTITY = "9c3a5b17f0e2d468"


@pytest.mark.vectors("misread")
def test_rare_superframes(case: dict[str, Any]) -> None:
    document = json.loads((VECTORS / "misread.json").read_text(encoding="utf-8"))
    l0, l1 = bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"])
    scales = document["bases"]
    decode_both(l0, l1, tuple(Basis(np.eye(len(s)), np.array(s, dtype=np.int64)) for s in scales))
    found = said(reference.decode(l0, l1, scales, document["identity"]))
    assert found == {name: case[name] for name in found}


@pytest.mark.vectors("identity")
def test_foreign_parts(case: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    decoder = SuperframeDecoder(load_voice())
    monkeypatch.setattr(decoder, "_coding", SimpleNamespace(identity=IDENTITY))
    found = []
    for part in case["parts"]:
        try:
            found.append("own" if decoder.admits(bytes.fromhex(part)) else "lost")
        except VoiceError:
            found.append("another")
        except BitstreamError as error:
            found.append({"H2": "version"}.get(error.section, "malformed"))
    assert found == case["verdicts"]
    assert [version_of(bytes.fromhex(part)) for part in case["parts"]] == case["versions"]


@pytest.mark.vectors("slow")
def test_registers(case: dict[str, Any]) -> None:
    receiver = SlowReceiver()
    for piece in case["pieces"]:
        receiver.take(piece)
    assert {str(k): v for k, v in receiver.registers.items()} == case["registers"]
    for name in MEANINGS:
        assert getattr(receiver, name) == case[name], name


@pytest.mark.vectors("foreign")
def test_foreign_streams(case: dict[str, Any]) -> None:
    foreign = ForeignStream()
    for part in map(bytes.fromhex, case["parts"]):
        if is_own(part, IDENTITY):
            foreign.own()
        else:
            foreign.take(part)
    assert {str(k): v for k, v in foreign.slow.registers.items()} == case["registers"]
    for name in MEANINGS:
        assert getattr(foreign.slow, name) == case[name], name


@pytest.mark.vectors("voice")
def test_markers_of_a_random_voice(case: dict[str, Any]) -> None:
    voice = load_voice(VECTORS / case["file"])
    assert voice.identity == case["identity"]
    found = voice.reconstruct(np.array([case["parameters"]]))[0]
    assert np.abs(found - np.array(case["markers"])).max() < 0.01


@pytest.mark.vectors("picture")
def test_marked_pictures(case: dict[str, Any]) -> None:
    raw = zlib.decompress(base64.b64decode(case["luma"]))
    luma = np.frombuffer(raw, dtype=np.uint8).reshape(case["height"], case["width"])
    profile = next(p for p in (*PROFILES.values(), LONE) if p.number == case["profile"])
    grid = Grid(case["width"], case["height"])
    mode = make_modes(profile, case["key"], 1.0)[case["step"]]
    amplitudes = grid.project(luma).reshape(-1)
    for value, amplitude in case["amplitudes"]:
        assert amplitudes[value] == pytest.approx(amplitude, abs=0.003)
    soft = soft_bits(amplitudes, np.zeros(amplitudes.size), mode, grid.texture(luma).reshape(-1))
    assert soft.parity == case["place"] % 2
    decoded = Link(profile).decode(soft.ratios)
    assert decoded.l0 is not None
    assert decoded.l1 is not None
    assert (decoded.l0.hex(), decoded.l1.hex()) == (case["l0"], case["l1"])
