import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cues.phonology import CONSONANTS, PAUSE, PHONES, VOWELS
from codec.errors import CueError
from lab.durations import _SAMPA
from synth.planning.prosody.duration import features, predict_durations

LABELS = Path(__file__).resolve().parents[4] / "shared/data/text/enst-camille-data.yaml"
LINES = st.lists(st.sampled_from(PHONES), max_size=60)


@given(LINES)
def test_durations_are_plausible(symbols: list[str]) -> None:
    durations = predict_durations(symbols)
    assert durations.shape == (len(symbols),)
    pause = np.array([s == PAUSE for s in symbols], dtype=np.bool_)
    assert (durations[pause] == 0).all()
    assert ((durations[~pause] >= 0.02) & (durations[~pause] < 0.5)).all()


@given(LINES, LINES)
def test_groups_between_pauses_stand_alone_up_to_three_phones(a: list[str], b: list[str]) -> None:
    far = [PAUSE] * 3
    together = predict_durations(a + far + b)
    np.testing.assert_array_equal(together[: len(a)], predict_durations(a))
    np.testing.assert_array_equal(together[len(a) + 3 :], predict_durations(b))


def test_features_count_to_both_ends() -> None:
    rank = np.arange(38, dtype=np.uint8)
    table = features(["p", "a", PAUSE, "t"], rank)
    assert table.shape == (4, 19)
    # phones and vowels since the pause, then until it, then all phones of the group
    np.testing.assert_array_equal(
        table[:, 14:], [[1, 0, 2, 1, 3], [2, 1, 1, 1, 3], [0, 0, 0, 0, 0], [1, 0, 1, 0, 2]]
    )


def test_the_last_vowel_of_a_group_is_longer() -> None:
    line = ["l", "a", "t", "a", "p", "a", "l", "a"]
    durations = predict_durations(line)
    assert durations[7] > 1.4 * durations[3]


def test_unknown_phone() -> None:
    with pytest.raises(CueError, match="unknown phone 'q'"):
        predict_durations(["q"])
    assert set(_SAMPA.values()) <= {*VOWELS, *CONSONANTS}


def test_figures_on_sentences_that_were_not_trained_on() -> None:
    if not LABELS.exists():
        pytest.skip("needs the labels enst-camille of ../shared/data/text")
    sentences = LABELS.read_text("utf-8").split("- prompt:")[1:]
    predicted, real = [], []
    for text in sentences[9::10]:
        labels = re.findall(r"lab: '?([^'\n]+)'?\n    dur: ([0-9.]+)", text)
        symbols = [_SAMPA.get(name, name) for name, _ in labels]
        spoken = np.array([s != PAUSE for s in symbols])
        predicted.append(predict_durations(symbols)[spoken])
        real.append(np.array([float(d) for _, d in labels])[spoken])
    p, y = np.concatenate(predicted), np.concatenate(real)
    assert len(y) > 5000
    # Measured: 46.0 ms and 0.605; espeak-ng's own durations give 61.5 ms and 0.28.
    assert np.sqrt(np.mean((p - y) ** 2)) < 0.048
    assert np.corrcoef(p, y)[0, 1] > 0.60
