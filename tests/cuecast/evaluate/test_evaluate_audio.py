import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile
from matplotlib.figure import Figure

from codec.errors import CueError
from cuecast.evaluate.audio import evaluate, evaluate_audio, plot, unmarked_sound
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.sound_channels import CHANNELS, SPEEDS
from cuecast.evaluate.tables import wilson_interval

FS = 48000


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pink noise of 5 s as a sound file."""
    spectrum = np.fft.rfft(np.random.default_rng(0).standard_normal(5 * FS))
    spectrum /= np.sqrt(np.maximum(np.arange(spectrum.size), 100.0))
    x = np.fft.irfft(spectrum)
    path = tmp_path_factory.mktemp("clips") / "pink.wav"
    soundfile.write(path, 0.07 * x / x.std(), FS)
    return path


def test_rows(clip: Path) -> None:
    (row,) = evaluate_audio([clip], ["high:none"], starts=1)
    assert (row.profile, row.channel) == ("high", "none")
    assert (row.superframes_lost, row.wrong) == (0, 0)
    assert row.superframes_sent >= 5
    assert row.tune_in_median_s is not None
    assert row.tune_in_median_s < 3
    assert -1 < row.odg_advanced < 0.22


def test_verb_writes_figures(clip: Path, tmp_path: Path) -> None:
    said: list[str] = []
    options = EvaluateOptions(clip.parent, ("none",), 0, tmp_path, said.append)
    results = evaluate(options)
    assert results[0]["superframes_lost"] == 0
    assert said[0].startswith("pink standard:none: 0 of ")
    figure = Figure()
    plot(results, figure)
    assert len(figure.axes) == 1
    with pytest.raises(CueError, match=r"no sound files in it$"):
        evaluate(EvaluateOptions(tmp_path, None, 0, tmp_path, said.append))


def test_unmarked_sound_comes_first(clip: Path) -> None:
    row = evaluate_audio([clip], ["standard+none:none"], starts=0, after_s=3.0)[0]
    assert row.after_s == 3.0
    assert row.found_s is not None
    assert 0.6 < row.found_s < 4.0
    assert (row.superframes_lost, row.wrong) == (0, 0)


def test_unmarked_sound_is_of_any_length(clip: Path) -> None:
    sound = unmarked_sound([clip], 12.5, 44100, np.random.default_rng(0))
    assert sound.shape == (round(12.5 * 44100), 2)
    assert np.abs(sound[-44100:]).max() > 0.01


NEEDS = {"he_aac": "fdkaac", "rubberband": "rubberband"}
"""Optional programs by the beginning of a channel's name."""

ALTERED = ("announcer", "night_mode", "radio_multiband", "widened_20ms", "dialogue_enhanced")
"""Channels that change a steady tone's level as they do."""


@pytest.mark.parametrize("name", sorted(set(CHANNELS) - {"side_alone", "two_languages"}))
def test_each_channel_keeps_the_programme(name: str) -> None:
    t = np.arange(3 * FS)
    x = 0.2 * np.sin(2 * np.pi * 440 / FS * t)[:, np.newaxis].astype(np.float32)
    for begin, program in NEEDS.items():
        if name.startswith(begin) and shutil.which(program) is None:
            pytest.skip(f"the program {program} is optional")
    y = CHANNELS[name](x, FS)
    assert y.dtype == np.float32
    middle = y[FS : FS + FS // 4, 0]
    strength = np.abs(np.fft.rfft(middle * np.hanning(middle.size)))
    peak_hz = int(strength.argmax()) * FS / middle.size
    speed = SPEEDS.get(name.removeprefix("speed_"), 1.0) if name.startswith("speed_") else 1.0
    assert abs(peak_hz - 440 * speed) <= 4
    if name in ALTERED:
        return
    gains_db = {
        "gain_minus_10db": -10,
        "gain_minus_20db": -20,
        "gain_plus_10db": 10,
        "gain_plus_20db": 20,
        "multiband": -6,
    }
    gain = 10 ** (gains_db.get(name, 0) / 20)
    assert 0.05 < np.sqrt(2 * np.mean(middle**2)) / gain < 0.22


def test_he_aac_needs_its_encoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CueError, match=r"^HE-AAC needs the program fdkaac"):
        CHANNELS["he_aac_64"](np.zeros((FS, 1), dtype=np.float32), FS)


def test_durations_change_and_pitch_stays() -> None:
    x = np.random.default_rng(0).normal(0, 0.1, (3 * FS, 1)).astype(np.float32)
    for name in ("tempo_25_24", "vocoder_25_24", "speed_25_24", "speed_plus_6pct"):
        speed = 1.06 if name == "speed_plus_6pct" else 25 / 24
        assert abs(len(CHANNELS[name](x, FS)) * speed - len(x)) < 0.06 * FS


def test_channels_are_taken_apart() -> None:
    rng = np.random.default_rng(0)
    common, own = rng.normal(0, 0.1, (2, FS))
    x = np.stack([common + own, common - own], axis=1).astype(np.float32)
    side, languages = CHANNELS["side_alone"](x, FS), CHANNELS["two_languages"](x, FS)
    np.testing.assert_allclose(side[:, 0], own, atol=1e-6)
    np.testing.assert_allclose(languages[:, 0], common, atol=1e-6)
    left, right = languages.T
    assert abs(np.dot(left, right)) < 0.05 * np.linalg.norm(left) * np.linalg.norm(right)
    late = CHANNELS["right_late_3ms"](x, FS)
    np.testing.assert_allclose(late[144:, 1], x[:-144, 1], atol=1e-5)


def test_dynamics_are_compressed() -> None:
    """A tone 20 dB louder comes out hardly louder."""
    t = np.arange(FS)
    x = np.sin(2 * np.pi * 440 / FS * t)[:, np.newaxis] * np.repeat([0.05, 0.5], FS // 2)[:, None]
    for name in ("night_mode", "radio_multiband"):
        y = CHANNELS[name](x.astype(np.float32), FS)
        first, second = y[FS // 4 : FS // 2].std(), y[3 * FS // 4 : FS - 2000].std()
        assert 20 * np.log10(second / first) < 10


def test_phases_change_and_magnitudes_stay() -> None:
    click = np.zeros((FS, 2), dtype=np.float32)
    click[FS // 2] = 0.5
    for name in ("rotator", "crossover", "right_inverted", "right_late"):
        y = CHANNELS[name](click, FS)
        np.testing.assert_allclose(np.abs(np.fft.rfft(y, axis=0))[:-1], 0.5, atol=0.01)
        assert np.abs(y - click).max() > 0.01


def test_unknown_channel() -> None:
    with pytest.raises(CueError, match=r"^unknown channel 'smoke', known: none, mp2_192"):
        evaluate_audio([], ["smoke"])


def test_wilson_interval_holds_the_share() -> None:
    for count in range(0, 21, 5):
        low, high = wilson_interval(count, 20)
        assert 0 <= low <= count / 20 <= high <= 1
    assert wilson_interval(0, 0) == (0.0, 1.0)
