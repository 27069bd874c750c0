"""What lasts in a sound taken out: notes go, speech stays, whatever the length."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synth.planning.alignment.recogniser import FS
from synth.planning.alignment.sound import mono
from synth.planning.alignment.sustained import without_lasting
from synth.units.speech.espeak_voice import speak


def test_a_chord_goes_and_speech_stays() -> None:
    speech = mono(*speak("Les enfants jouent sous la pluie, dans le jardin du voisin."))
    times = np.arange(len(speech)) / FS
    notes = np.array([[196.0], [247.3], [392.1], [784.0], [1568.0]])
    chord = np.sin(2 * np.pi * notes * times + notes).sum(axis=0)
    chord *= speech.std() / chord.std()
    assert without_lasting(chord).std() < 0.35 * chord.std()
    kept = without_lasting(speech)
    assert np.corrcoef(kept, speech)[0, 1] > 0.9
    before = speech.std() / chord.std()
    mixed = without_lasting(speech + chord)
    gain = float(mixed @ speech / (speech @ speech))
    after = gain * speech.std() / (mixed - gain * speech).std()
    assert after > 1.5 * before


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 5000))
def test_any_length_stays(length: int) -> None:
    x = np.random.default_rng(length).normal(size=length)
    found = without_lasting(x)
    assert found.shape == x.shape
    assert np.isfinite(found).all()


@pytest.mark.parametrize("level", [0.0, 1e-12, 1e6])
def test_silence_and_any_level(level: float) -> None:
    x = level * np.random.default_rng(1).normal(size=FS)
    found = without_lasting(x)
    assert np.isfinite(found).all()
    assert found.std() <= x.std()
