import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile
from matplotlib.figure import Figure

from codec.errors import CueError
from cuecast.evaluate.audio import evaluate, evaluate_audio, plot
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.sound_channels import CHANNELS
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
    rows = evaluate_audio([clip], ["none", "high:none"], starts=1)
    assert [(row.profile, row.channel) for row in rows] == [
        ("standard", "none"),
        ("high", "none"),
    ]
    for row in rows:
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


@pytest.mark.parametrize("name", CHANNELS)
def test_each_channel_keeps_the_programme(name: str) -> None:
    t = np.arange(3 * FS)
    x = 0.2 * np.sin(2 * np.pi * 440 / FS * t)[:, np.newaxis].astype(np.float32)
    if name.startswith("he_aac") and shutil.which("fdkaac") is None:
        pytest.skip("the program fdkaac is optional")
    y = CHANNELS[name](x, FS)
    assert y.dtype == np.float32
    middle = y[FS : FS + FS // 4, 0]
    strength = np.abs(np.fft.rfft(middle * np.hanning(middle.size)))
    peak_hz = int(strength.argmax()) * FS / middle.size
    speed = {"speed_25_24": 25 / 24, "speed_24_25": 24 / 25}.get(name, 1.0)
    assert abs(peak_hz - 440 * speed) <= 4
    gains_db = {"gain_minus_20db": -20, "gain_plus_10db": 10, "gain_plus_20db": 20, "multiband": -6}
    gain = 10 ** (gains_db.get(name, 0) / 20)
    assert 0.05 < np.sqrt(2 * np.mean(middle**2)) / gain < 0.22


def test_he_aac_needs_its_encoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(CueError, match=r"^HE-AAC needs the program fdkaac"):
        CHANNELS["he_aac_64"](np.zeros((FS, 1), dtype=np.float32), FS)


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
