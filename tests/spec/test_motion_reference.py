"""From bytes to markers by the references alone, against the codec."""

from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.superframe.coding import FOLDER, coding_for
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from spec.reference.markers import markers, read_voice
from spec.reference.motion import parameters, read_coding
from spec.reference.superframe import decode
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text

ROOT = Path(__file__).parents[2]
BASES = ("residual", "loose", "plain", "filmed")


@pytest.mark.parametrize("scored", [True, False])
def test_markers_from_bytes(scored: bool) -> None:
    """Written from the text; within the text's own tolerance."""
    voice = load_voice()
    motion = motion_of(score_of_text("Un bon vin blanc, puis du pain.", start_s=0.7), voice)
    if not scored:
        motion = type(motion)(
            motion.params, motion.rate_hz, motion.start_s, motion.layout, motion.voice
        )
    encoder = SuperframeEncoder(voice, l0_bytes=26, l1_bytes=10)
    count = 5
    frames = [encoder.encode(motion, k) for k in range(count)]
    decoder = SuperframeDecoder(voice)
    for frame in frames:
        decoder.push(frame.l0, frame.l1, frame.index)
    coding = read_coding(FOLDER / f"{voice.identity}.npz")
    scales = [
        [[int(coding[f"{name}.scales"].at(c, f)) for f in range(32)] for c in range(31)]
        for name in BASES
    ]
    identity = coding_for(voice).identity
    parts = {f.index: decode(f.l0, f.l1, scales, identity) for f in frames}
    plain = read_voice(ROOT / "spec" / "data" / "voices" / f"{voice.name}.npz")
    for index in range(1, count - 1):
        expected = voice.reconstruct(decoder.render(index).params)
        found = parameters(index, parts, coding)
        for t in range(0, 32, 5):
            assert np.abs(np.array(markers(plain, found[t])) - expected[t]).max() < 0.01
