"""The audio carrier against its specification: vectors, the plain reference, citations."""

import hashlib
import wave
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spec.reference import audio_carrier as reference
from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.signal.layout import make_layout, make_pilots
from watermark.audio.signal.masking import band_edges, make_masker
from watermark.audio.signal.profile import PROFILES, STANDARD
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.crc import crc_bits
from watermark.link.link import Link
from watermark.link.polar import make_code

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / "spec" / "audio-carrier.md").read_text(encoding="utf-8")


@pytest.mark.vectors("audio-layout")
def test_layout(case: dict[str, Any]) -> None:
    key = case["key"]
    pilots = make_pilots(key)
    assert pilots.cells.signs[:16].tolist() == case["pilot_signs"]
    assert pilots.slots[:8].tolist() == case["pilot_slots"]
    for name in ("standard", "robust", "discreet"):
        layout = make_layout(PROFILES[name], key)
        cells = np.stack(np.divmod(layout.order[:16], layout.cells.dither.size), axis=1)
        assert cells.tolist() == case[f"{name}_cells"]


@pytest.mark.vectors("audio-check")
def test_check(case: dict[str, Any]) -> None:
    bits = np.unpackbits(np.frombuffer(bytes.fromhex(case["data"]), dtype=np.uint8))
    check = int("".join(map(str, crc_bits(bits, case["width"]))), 2)
    assert check == case["check"]


@pytest.mark.vectors("audio-coded")
def test_coded_bits(case: dict[str, Any]) -> None:
    link = Link(PROFILES[case["profile"]])
    coded = link.encode(bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"]))
    assert coded.size == case["bits"]
    assert "".join(map(str, coded[:96])) == case["first"]
    assert hashlib.sha256(bytes(coded.tolist())).hexdigest() == case["sha256"]


def sound(name: str) -> list[float]:
    with wave.open(str(ROOT / "spec" / "vectors" / name)) as file:
        words = np.frombuffer(file.readframes(file.getnframes()), dtype="<i2")
    return [float(word) / 32768 for word in words]


@pytest.mark.vectors("audio-sound")
def test_sound(case: dict[str, Any]) -> None:
    samples = sound(case["file"])
    expected = (bytes.fromhex(case["l0"]), bytes.fromhex(case["l1"]))
    name, key, level = case["profile"], case["key"], case["level"]
    assert reference.decode_superframe(samples, name, key, level) == expected
    tape = SampleBuffer()
    tape.append(np.array(samples))
    demodulator = Demodulator(PROFILES[name], key)
    reading = demodulator.read(read_view(tape, case["start"], 1.0, make_masker()), [level])
    assert (reading.decoded.l0, reading.decoded.l1) == expected
    soft = demodulator.layout.gather(reading.soft)
    plain = reference.soft_values(samples, name, key, level)
    np.testing.assert_allclose(soft, plain, atol=2e-5)  # spectra have single precision


def test_bands_and_code_are_the_reference_s() -> None:
    assert band_edges().tolist() == reference.bands()
    np.testing.assert_allclose(make_masker().matrix.T, reference.spread_matrix(), rtol=1e-9)
    for message, length in ((184, 1536), (72, 640), (304, 4096), (80, 1344), (120, 1856)):
        free = np.flatnonzero(make_code(message, length).frozen == 0).tolist()
        assert free == reference.information(message, length)


def test_profile_table_is_the_code_s() -> None:
    for p in PROFILES.values():
        row = (p.name, p.number, p.cell_bins, p.first_bin, p.last_bin)
        row += (f"{p.strength:g}", p.lowest_tier, f"{p.alphas[0]:g} to {p.alphas[1]:g}")  # type: ignore[assignment]
        row += (p.l0_bytes, p.l1_bytes, p.l0_coded, p.l1_coded, f"{p.net_bps:g}")  # type: ignore[assignment]
        assert "| " + " | ".join(map(str, row)) + " |" in TEXT
    assert STANDARD.data_cells == len(reference.data_cells("standard", 0))
