"""Markers from a voice file as spec/voice.md says, against the codec's."""

from pathlib import Path

import numpy as np

from codec.cuer.layout import FACE_MARKERS, HAND_MARKERS
from codec.cuer.voice import load_voice
from spec.reference.markers import identity, markers, read_voice

ROOT = Path(__file__).parents[2]
VOICE = ROOT / "spec" / "data" / "voices" / "claire.npz"


def test_markers_are_those_of_the_codec() -> None:
    voice, plain = load_voice(), read_voice(VOICE)
    rng = np.random.default_rng(3)
    params = rng.normal(0, 2.0, (4, len(voice.layout)))
    params[0] = 0.0
    expected = voice.reconstruct(params)
    for frame, row in zip(expected, params.tolist(), strict=True):
        assert np.abs(np.array(markers(plain, row)) - frame).max() < 0.01


def test_the_identity_is_that_of_the_codec() -> None:
    assert identity(read_voice(VOICE)) == load_voice().identity


def test_the_text_names_the_markers_in_their_order() -> None:
    text = (ROOT / "spec" / "voice.md").read_text(encoding="utf-8")
    blocks = [part.split() for part in text.split("```")[1::2]]
    assert blocks == [list(FACE_MARKERS), list(HAND_MARKERS)]
