"""The espeak-ng part: transcription mended, speech repeatable, phone times known."""

import numpy as np
import pytest

from codec.errors import CueError
from codec.phonology import PHONES
from synth.speech.espeak_voice import MNEMONIC, speak, speak_phones
from synth.text.espeak import to_phones, transcribe


@pytest.mark.parametrize(
    ("word", "phones"),
    [("mouchouent", "muʃu"), ("nuageux", "nɥaʒø"), ("bilbique", "bilbik"), ("", "")],
)
def test_transcribe(word: str, phones: str) -> None:
    assert "".join(transcribe(word)) == phones


def test_foreign_sounds_become_french() -> None:
    assert to_phones("(en)θ_ɹ_ˈɪ_l_ɚ(fr)") == ("s", "ʁ", "i", "l", "œ")


def test_every_phone_has_a_mnemonic() -> None:
    assert set(MNEMONIC) == set(PHONES)


def test_speech_is_repeatable() -> None:
    first, rate = speak("Bonjour à tous.")
    speak("Autre chose.")
    again, _ = speak("Bonjour à tous.")
    assert rate == 22_050
    assert np.array_equal(first, again)
    assert 0.05 < np.abs(first).max() <= 1


def test_phone_starts_rise() -> None:
    rendering = speak_phones(["v", "u", "l", "e", "_", "v", "u"])
    names, starts = zip(*rendering.starts, strict=True)
    assert names[:7] == ("v", "u", "l", "e", "_", "v", "u")
    assert (np.diff(starts) >= 0).all()
    assert starts[-1] <= len(rendering.samples)


def test_rate_is_checked() -> None:
    with pytest.raises(CueError, match=r"words_per_minute is 20, not within 80..450"):
        speak("Oui.", words_per_minute=20)
