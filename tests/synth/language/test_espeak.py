"""The espeak-ng part: transcription mended, speech repeatable, phone times known."""

import itertools

import numpy as np
import pytest

from codec.cues.phonology import PHONES
from codec.errors import CueError
from synth.language.text.espeak import to_phones, transcribe
from synth.units.speech.espeak_voice import MNEMONIC, render, speak


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


def test_rendered_phones_are_those_asked_for() -> None:
    line = ["ɥ", "i", "g", "ɑ", "_", "v", "u", "_", "_", *["l", "a"] * 40]
    rendering = render(line)
    assert [phone.symbol for phone in rendering.phones] == [s for s in line if s != "_"]
    assert rendering.phones[4].start > rendering.phones[3].end
    for before, after in itertools.pairwise(rendering.phones):
        assert before.start < before.end <= after.start
    assert rendering.phones[-1].end * 22_050 <= len(rendering.samples)


def test_unknown_phones_and_endless_lines_are_refused() -> None:
    with pytest.raises(CueError, match="unknown phone 'q'"):
        render(["q"])
    with pytest.raises(CueError, match="151 phones without a pause, more than 150"):
        render(["a"] * 200)
    assert render([]).phones == ()


def test_rate_is_checked() -> None:
    with pytest.raises(CueError, match=r"words_per_minute is 20, not within 80..450"):
        speak("Oui.", words_per_minute=20)
