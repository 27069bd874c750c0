"""The video carriers against their specifications: vectors, the plain reference, citations."""

import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spec.reference import video_carrier as reference
from watermark.a335.profile import PROFILES as LINE_PROFILES
from watermark.video.embed import VideoEmbedder
from watermark.video.grid import Grid
from watermark.video.lattices import PILOT_TEXTURES
from watermark.video.layout import make_layout
from watermark.video.profile import (
    COARSE,
    LONE,
    NUMBERS,
    PILOT_SPREADS,
    PILOT_STEP,
    POSITIONS,
    PROFILES,
    STEPS,
    TEXTURE,
)
from watermark.video.timing import Timing

ROOT = Path(__file__).parents[3]


@pytest.mark.vectors("video-carrier")
def test_vectors(case: dict[str, Any]) -> None:
    checks = {"2": check_times, "3": check_amplitudes, "4": check_textures, "5": check_layout}
    checks[case["section"]](case)


def check_layout(case: dict[str, Any]) -> None:
    for profile in (*PROFILES.values(), LONE):
        layout = make_layout(profile, case["key"])
        dither = [*layout.dither[:6], *layout.dither[-2:]]
        np.testing.assert_allclose(dither, case["dither"], atol=1e-9)
        assert [*layout.pilots[:12], *layout.pilots[-4:]] == case["pilots"]
        assert [*layout.data[:12], *layout.data[-4:]] == case["data"]
        for rung in range(len(STEPS)):
            bits = "".join(map(str, make_layout(profile, case["key"], rung).pilot_bits[:24]))
            assert bits == case["pilot_bits"][str(profile.number + NUMBERS * rung)]


def check_times(case: dict[str, Any]) -> None:
    timing = Timing(Fraction(case["fps"]).limit_denominator(1000))
    for frame, superframe, share in case["shares"]:
        found, phase = timing.phase(frame)
        assert found == superframe
        fades = superframe > 0 or phase > 0.5
        shown = min(1.0, 0.5 + 4 * min(phase, 1 - phase)) if fades else 1.0
        assert shown == pytest.approx(share, abs=1e-6)
    for superframe, start, length in case["windows"]:
        assert (timing.window_start(superframe), timing.window) == (start, length)


def check_amplitudes(case: dict[str, Any]) -> None:
    luma = ramps(case["width"], case["height"])
    found = Grid(case["width"], case["height"]).project(luma).reshape(-1)
    for value, amplitude in case["amplitudes"]:
        assert found[value] == pytest.approx(amplitude, abs=0.003)


def check_textures(case: dict[str, Any]) -> None:
    luma = ramps(case["width"], case["height"])
    found = Grid(case["width"], case["height"]).texture(luma)
    for row, column, texture in case["textures"]:
        assert found[row, column] == pytest.approx(texture, abs=1e-6)


def ramps(width: int, height: int) -> np.ndarray:
    y, x = np.mgrid[:height, :width]
    return np.asarray((7 * x + 13 * y + x * y // 5) % 256, dtype=np.uint8)


@pytest.mark.parametrize("name", ["robust", "standard"])
def test_reference_reads_what_is_embedded(name: str) -> None:
    assert (reference.COARSE, reference.TEXTURE) == (COARSE, TEXTURE)
    assert (reference.PILOT_STEP, reference.PILOT_WIDTHS) == (PILOT_STEP, PILOT_SPREADS)
    assert (reference.STEPS, reference.PILOT_TEXTURES) == (STEPS, PILOT_TEXTURES)
    # Noise on the left, nothing on the right: narrow and wide lattices are in use.
    scene = np.random.default_rng(1).integers(40, 200, (360, 640)).astype(np.uint8)
    scene[:, 320:] = 128
    profile = PROFILES[name]
    embedder = VideoEmbedder(
        640, 360, 25, lambda k: (bytes(20), bytes([k]) * profile.l1_bytes), profile=name, key=5
    )
    frames = [out for _ in range(32) for out in embedder.process(scene)] + embedder.flush()
    dither = reference.dither(5)
    pilots, _ = reference.positions(5)
    for superframe in (0, 1):
        rung = 2 - superframe  # the opening's, and that of cells of 8 by 8 pixels
        bits = reference.pilot_bits(profile.number, rung, 5, superframe)
        shown = [frames[n].tolist() for n in reference.window(superframe, 25)[::4]]
        wrong = 0
        for value, bit in list(zip(pilots, bits, strict=True))[:24]:
            mean = sum(reference.amplitude(luma, value) for luma in shown) / len(shown)
            texture = reference.texture(shown[0], value // 80 % 45, value % 80)
            width = reference.pilot_width_of(texture)
            wrong += reference.hard_bit(mean, dither[value], reference.PILOT_STEP, width) != bit
        assert wrong == 0


def test_tables_of_the_specifications() -> None:
    text = (ROOT / "spec" / "video-carrier.md").read_text(encoding="utf-8")
    for p in (*PROFILES.values(), LONE):
        row = (p.number, p.name, p.l0_bytes, p.l1_bytes, p.l0_coded, p.l1_coded, round(p.net_bps))
        assert "| " + " | ".join(map(str, row)) + " |" in text
    for number, step in enumerate(STEPS):
        assert f"| {number} | {step:g} | {COARSE * step:g} |" in text
    assert sum((PROFILES["high"].l0_coded, PROFILES["high"].l1_coded, 320)) == POSITIONS
    line = (ROOT / "spec" / "a335-carrier.md").read_text(encoding="utf-8")
    for q in LINE_PROFILES.values():
        sizes = f"| {q.l0_bytes} | {q.l1_bytes} | {q.net_bps:.0f} |"
        assert f"| {q.name} | {q.system.name} | {q.message_id:#04x} {sizes}".lower() in line.lower()


@pytest.mark.parametrize("name", ["video-carrier.md", "a335-carrier.md"])
def test_cited_sections_exist(name: str) -> None:
    text = (ROOT / "spec" / name).read_text(encoding="utf-8")
    sections = set(re.findall(r"^## (\d+)\.", text, flags=re.MULTILINE))
    cited: set[str] = set()
    for path in (ROOT / "watermark").rglob("*.py"):
        # A citation may be broken over two lines of a docstring.
        source = re.sub(r"\s+", " ", path.read_text(encoding="utf-8"))
        for match in re.findall(rf"spec/{name}, sections? ([\d and]+)", source):
            cited |= set(re.findall(r"\d+", match))
    assert cited
    assert cited <= sections


def test_cited_paragraphs_exist() -> None:
    text = (ROOT / "spec" / "video-carrier.md").read_text(encoding="utf-8")
    paragraphs = set(re.findall(r"\*\*(V\d+)\*\*", text))
    source = (ROOT / "spec" / "reference" / "video_carrier.py").read_text(encoding="utf-8")
    cited = set(re.findall(r"\bV\d+", source))
    assert cited
    assert cited <= paragraphs
