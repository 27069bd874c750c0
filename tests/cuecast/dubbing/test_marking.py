"""The stage that marks a sound: as many samples out as in, whatever the rate and the blocks."""

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.dubbing.marking import MarkingStage
from receiver.media.programme import SoundFormat
from watermark.audio.signal.profile import find_profile

STANDARD = find_profile("standard")


def source(k: int) -> tuple[bytes, bytes]:
    rng = np.random.default_rng(k)
    return rng.bytes(STANDARD.l0_bytes), rng.bytes(STANDARD.l1_bytes)


def sound_of(fs: int, channels: int) -> SoundFormat:
    layout = {1: "mono", 2: "stereo", 6: "5.1", 7: "6.1"}[channels]
    return SoundFormat("pcm_s16le", fs, channels, layout, "s16", 0)


def noise(fs: int, channels: int, seconds: float = 2.5) -> NDArray[np.float32]:
    x = np.random.default_rng(0).normal(0, 0.1, (round(seconds * fs), channels))
    return x.astype(np.float32)


def marked(stage: MarkingStage, x: NDArray[np.float32], block: int) -> NDArray[np.float32]:
    parts = [stage.process(x[at : at + block]) for at in range(0, len(x), block)]
    return np.concatenate([*parts, stage.flush()])


@pytest.mark.parametrize(("fs", "channels"), [(48000, 2), (44100, 1), (96000, 2), (88200, 6)])
def test_marks_in_place(fs: int, channels: int) -> None:
    x = noise(fs, channels)
    y = marked(MarkingStage(sound_of(fs, channels), source, name="x", graded=False), x, 5000)
    assert y.shape == x.shape
    mark = y - x
    assert np.abs(mark[:, 0]).max() > 1e-4
    assert (mark**2).mean() < 0.05 * (x**2).mean()
    if channels == 6:
        assert mark[:, 2].any()
        assert not mark[:, 3:].any()


def test_higher_rate_gets_the_same_mark() -> None:
    """Marking at 96 kHz adds what marking the same sound at 48 kHz adds, brought up."""
    from scipy.signal import resample_poly

    x = noise(48000, 1)
    high = resample_poly(x, 2, 1).astype(np.float32)
    low_mark = marked(MarkingStage(sound_of(48000, 1), source, name="x", graded=False), x, 4096) - x
    stage = MarkingStage(sound_of(96000, 1), source, name="x", graded=False)
    mark = (marked(stage, high, 4096) - high)[::2]
    inner = slice(4800, len(x) - 4800)
    error = np.sqrt(((mark - low_mark)[inner] ** 2).mean() / (low_mark[inner] ** 2).mean())
    assert error < 0.3  # measured 0.04 to 0.13: another mark would differ by 1.4


def test_blocks_do_not_matter() -> None:
    x = noise(96000, 2)
    y = [
        marked(MarkingStage(sound_of(96000, 2), source, name="x", graded=False), x, block)
        for block in (1000, 77777)
    ]
    np.testing.assert_allclose(y[0], y[1], atol=1e-6)


def test_report_grades_the_mark() -> None:
    stage = MarkingStage(sound_of(48000, 2), source, name="x")
    marked(stage, noise(48000, 2), 4096)
    report = stage.report()
    assert report["net_bps"] == pytest.approx(STANDARD.net_bps, abs=0.1)
    assert report["snr_db"] > 10
    assert -4 <= report["odg"] <= 0.3
    assert stage.superframes == 4


@pytest.mark.parametrize(
    ("fs", "channels", "message"),
    [
        (8000, 1, "film: sound of 8000 Hz cannot carry a cuer, at least 32000 Hz can"),
        (48000, 7, "film: 7 channels"),
        (50000, 2, None),
    ],
)
def test_formats(fs: int, channels: int, message: str | None) -> None:
    if message is None:
        x = noise(fs, channels)
        stage = MarkingStage(sound_of(fs, channels), source, name="film", graded=False)
        assert marked(stage, x, 4096).shape == x.shape
        return
    with pytest.raises(CueError, match=message):
        MarkingStage(sound_of(fs, channels), source, name="film")


def test_silence_cannot_carry() -> None:
    stage = MarkingStage(sound_of(48000, 2), source, name="film", graded=False)
    with pytest.raises(CueError, match="film: the sound is silent"):
        marked(stage, np.zeros((100_000, 2), np.float32), 4096)


def test_a_moment_cannot_carry() -> None:
    stage = MarkingStage(sound_of(48000, 2), source, name="film", graded=False)
    with pytest.raises(CueError, match=r"sound of 0\.21 s is too short"):
        marked(stage, noise(48000, 2)[:10_000], 4096)
