"""The quality meter: agreement with given grades, streaming, kernels, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.errors import CueError
from watermark.quality import PeaqMeter, _kernels, grade, pesq_wb, segmental_snr_db, snr_db
from watermark.quality.ear import BANDS, FRAME_RATE, band_edges, ear_tables
from watermark.quality.loudness import loudness_lufs
from watermark.quality.movs import harmonic_structure
from watermark.quality.resample import Resampler

GIVEN = Path(__file__).parents[4] / "shared" / "data" / "quality"
FS = 48_000


def programme(seconds: float, channels: int = 1) -> np.ndarray:
    """Noise whose envelope moves, at -20 dB."""
    rng = np.random.default_rng(5)
    n = round(seconds * FS)
    swell = 0.1 * (1.2 + np.sin(np.arange(n) / 9000))[:, None]
    return swell * rng.standard_normal((n, channels))


def worse(x: np.ndarray) -> np.ndarray:
    return x + 0.01 * np.random.default_rng(6).standard_normal(x.shape)


@pytest.mark.skipif(not GIVEN.exists(), reason="needs the graded pairs of ../shared/data/quality")
def test_agrees_with_given_grades() -> None:
    # Required: 0.25 on average, 0.5 at most. Measured over all 20 pairs: 0.0005 at most, which is
    # how the given grades are rounded.
    rows = json.loads((GIVEN / "odg.json").read_text())
    for row in rows[::3]:
        reference, fs = soundfile.read(GIVEN / f"{row['clip']}.ref.flac")
        test, _ = soundfile.read(GIVEN / f"{row['clip']}.{row['degradation']}.flac")
        assert grade(reference, test, fs).odg == pytest.approx(row["odg_basic"], abs=0.002)


def test_identical_signals_are_transparent() -> None:
    x = programme(2.0, 2)
    result = grade(x, x, FS)
    assert result.odg > 0.15
    assert result.movs.rms_noise_loud == 0
    assert result.movs.rel_dist_frames == 0


def test_more_noise_is_worse() -> None:
    x = programme(2.0)
    noise = np.random.default_rng(6).standard_normal(x.shape)
    grades = [grade(x, x + gain * noise, FS).odg for gain in (0.001, 0.01, 0.03, 0.1)]
    assert grades == sorted(grades, reverse=True)


def test_level_of_a_full_scale_sine_is_92_db() -> None:
    sine = np.sin(2 * np.pi * 1019.5 / FS * np.arange(2048))
    power = np.abs(np.fft.rfft(sine * ear_tables().window)) ** 2
    assert 10 * np.log10(power.max()) == pytest.approx(92, abs=0.02)


def test_bands_tile_the_spectrum() -> None:
    low, centre, high = band_edges()
    assert low.size == BANDS
    np.testing.assert_allclose(low[1:], high[:-1])
    assert high[-1] == pytest.approx(18_000)
    assert bool(np.all((low < centre) & (centre < high)))
    ear = ear_tables()
    flat = np.empty(BANDS)
    _kernels.group_into(np.ones(1025), ear.first, ear.last, ear.first_share, ear.last_share, flat)
    np.testing.assert_allclose(flat, (high - low) / (FS / 2048), atol=1e-9)


@settings(max_examples=10)
@given(st.lists(st.integers(1, 40_000), max_size=5))
def test_split_into_blocks_does_not_matter(cuts: list[int]) -> None:
    x = programme(1.3)
    y = worse(x)
    meter = PeaqMeter(FS, 1)
    for ref, test in zip(np.split(x, np.sort(cuts)), np.split(y, np.sort(cuts)), strict=True):
        meter.process(ref, test)
    assert meter.result().odg == pytest.approx(grade(x, y, FS).odg, abs=1e-9)


def test_result_leaves_the_meter_as_it_was() -> None:
    x = programme(2.0)
    y = worse(x)
    meter = PeaqMeter(FS, 1)
    meter.process(x[:50_000], y[:50_000])
    assert meter.result() == grade(x[:50_000], y[:50_000], FS)
    meter.process(x[50_000:], y[50_000:])
    assert meter.result() == grade(x, y, FS)


def test_silence_around_the_programme_does_not_count() -> None:
    x = programme(2.0)
    silence = np.zeros((FS, 1))
    around = [np.concatenate([silence, s, silence]) for s in (x, worse(x))]
    whole = grade(around[0], around[1], FS)
    assert whole.start_s == pytest.approx(1.0, abs=2 / FRAME_RATE)
    assert whole.end_s == pytest.approx(3.0, abs=2 / FRAME_RATE)
    assert whole.movs.total_nmr == pytest.approx(grade(x, worse(x), FS).movs.total_nmr, abs=0.3)


def test_segments() -> None:
    x = programme(4.0)
    y = x.copy()
    y[2 * FS :] = worse(x)[2 * FS :]
    grades = PeaqMeter(FS, 1, segment_s=1.0).process(x, y)
    assert len(grades) == 3
    assert [round(g.start_s) for g in grades] == [0, 1, 2]
    assert grades[0].odg > 0.15
    assert grades[0].odg > grades[1].odg > grades[2].odg + 0.3  # one frame reaches over 2 s


def test_other_rates_give_like_results() -> None:
    x = programme(2.0)
    y = worse(x)
    low = [np.concatenate([(r := Resampler(FS, 44_100, 1)).process(s), r.flush()]) for s in (x, y)]
    found, expected = grade(low[0], low[1], 44_100).movs, grade(x, y, FS).movs
    assert found.total_nmr == pytest.approx(expected.total_nmr, abs=0.2)
    assert found.avg_mod_diff_1 == pytest.approx(expected.avg_mod_diff_1, rel=0.1)


def test_stereo_of_one_channel_is_like_mono() -> None:
    x = programme(2.0)
    y = worse(x)
    both = [np.repeat(s, 2, axis=1) for s in (x, y)]
    assert grade(both[0], both[1], FS).odg == pytest.approx(grade(x, y, FS).odg, abs=1e-9)


def test_harmonic_error_is_found() -> None:
    rng = np.random.default_rng(3)
    power = np.exp(0.2 * rng.standard_normal((2, 2, 1025)))
    power[1, 1] *= np.exp(2 * np.cos(2 * np.pi * np.arange(1025) / 16))
    noise_like, comb_like = harmonic_structure(power, np.ones((2, 2)))
    assert comb_like > 5 * noise_like
    assert harmonic_structure(power, np.zeros((2, 2))).tolist() == [-1, -1]


def test_what_happens_at_0_hz_is_no_harmonic_error() -> None:
    power = np.exp(0.2 * np.random.default_rng(3).standard_normal((2, 1, 1025)))
    shifted = power.copy()
    shifted[1, :, 0] *= 1e6
    same = harmonic_structure(power, np.ones((2, 1)))
    np.testing.assert_allclose(harmonic_structure(shifted, np.ones((2, 1))), same)


def test_resampler_keeps_a_tone_and_its_phase() -> None:
    t = np.arange(44_100)[:, None] / 44_100
    resampler = Resampler(44_100, FS, 1)
    y = np.concatenate([resampler.process(b) for b in np.split(np.sin(5000 * t), 9)])
    y = np.concatenate([y, resampler.flush()])
    assert y.shape == (FS, 1)
    expected = np.sin(5000 * np.arange(FS)[:, None] / FS)
    np.testing.assert_allclose(y[500:-500], expected[500:-500], atol=1e-4)


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(2)
    ear = ear_tables()
    power = rng.exponential(size=(2, 3, 1025)) * 1e5
    results = []
    for kernel in (_kernels.frames_into, _kernels.frames_into.py_func):
        state, out = np.zeros((14, BANDS)), np.empty((3, 10))
        probability, steps = np.zeros((3, BANDS)), np.zeros((3, BANDS))
        kernel(
            power, ear.outer_ear, ear.first, ear.last, ear.first_share, ear.last_share, ear.bands,
            FRAME_RATE, state, out, probability, steps,
        )  # fmt: skip
        results.append((state, out, probability, steps))
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "name", ["spread_into", "adapt_into", "modulation_into", "detection_into", "group_into"]
)
def test_inner_kernels_agree_with_their_python(name: str) -> None:
    rng = np.random.default_rng(4)
    ear = ear_tables()
    pair = rng.exponential(size=(2, BANDS)) * 1e4 + 1
    bands = ear.bands
    arguments = {
        "spread_into": (pair[0], bands[1], bands[2], bands[3], np.empty(BANDS)),
        "adapt_into": (pair, bands[5], 3, 4, np.ones((14, BANDS)), np.empty((2, BANDS))),
        "modulation_into": (pair, bands[5], FRAME_RATE, np.ones((14, BANDS)), np.empty((2, BANDS))),
        "detection_into": (pair, np.zeros(BANDS), np.zeros(BANDS)),
        "group_into": (
            rng.exponential(size=1025),
            ear.first,
            ear.last,
            ear.first_share,
            ear.last_share,
            np.empty(BANDS),
        ),
    }[name]
    kernel = getattr(_kernels, name)
    copies = [[np.array(a) if isinstance(a, np.ndarray) else a for a in arguments] for _ in "ab"]
    kernel(*copies[0])
    kernel.py_func(*copies[1])
    for compiled, plain in zip(*copies, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-9)


def test_scalar_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(4)
    bands = ear_tables().bands
    pair, modulation = rng.exponential(size=(2, 2, BANDS)) * 100
    power = rng.exponential(size=(2, 1025))
    power[:, 600:] *= 1e-4
    for name, arguments in {
        "loudness": (pair[0], bands[6], bands[7], pair[1]),
        "noise_loudness": (*pair, *modulation, bands[0], 1.5, 0.15, 0.5),
        "modulation_difference": (modulation, pair[0], bands[0]),
        "bandwidths": (power[0], power[1]),
    }.items():
        kernel = getattr(_kernels, name)
        np.testing.assert_allclose(kernel(*arguments), kernel.py_func(*arguments), rtol=1e-9)
    assert _kernels.bandwidths(power[0], power[1]) == (600, 600)


def test_polyphase_agrees_with_its_python() -> None:
    rng = np.random.default_rng(4)
    history, taps = rng.standard_normal((40, 2)), rng.standard_normal((3, 8))
    compiled, plain = np.empty((6, 2)), np.empty((6, 2))
    _kernels.polyphase_into(history, taps, 2, 0, 0, compiled)
    _kernels.polyphase_into.py_func(history, taps, 2, 0, 0, plain)
    np.testing.assert_allclose(compiled, plain)


def test_refusals() -> None:
    with pytest.raises(CueError, match="nothing to grade: the reference is silent"):
        grade(np.zeros(FS), np.zeros(FS), FS)
    with pytest.raises(CueError, match="nothing to grade"):
        PeaqMeter(FS, 2).result()
    with pytest.raises(CueError, match="1 or 2 channels, not 6"):
        PeaqMeter(FS, 6)
    with pytest.raises(CueError, match="must be 8000 to 384000 Hz"):
        PeaqMeter(1, 2)
    with pytest.raises(CueError, match=r"test has shape \(3, 1\), reference \(4, 1\)"):
        PeaqMeter(FS, 1).process(np.zeros(4), np.zeros(3))
    with pytest.raises(CueError, match=r"expected \(n, 2\)"):
        PeaqMeter(FS, 2).process(np.zeros(4), np.zeros(4))
    with pytest.raises(CueError, match="longer than 0 s"):
        PeaqMeter(FS, 2, segment_s=0)


def test_signal_to_noise_ratios() -> None:
    x = programme(1.0)
    assert snr_db(x, x) == float("inf")
    assert snr_db(x, 0.9 * x) == pytest.approx(20)
    assert segmental_snr_db(x, 0.9 * x, FS) == pytest.approx(20)
    assert segmental_snr_db(x, x, FS) == pytest.approx(35)
    with pytest.raises(CueError, match="silent"):
        snr_db(np.zeros(4), np.ones(4))
    with pytest.raises(CueError, match="silent or too short"):
        segmental_snr_db(np.zeros(4), np.ones(4), FS)
    with pytest.raises(CueError, match="test has shape"):
        snr_db(np.zeros(4), np.ones(3))


@pytest.mark.skipif(not GIVEN.exists(), reason="needs the speech of ../shared/data/quality")
def test_pesq_of_speech() -> None:
    pytest.importorskip("pesq", reason="the package pesq is optional")
    speech, fs = soundfile.read(GIVEN / "speech_fr_f_lv.ref.flac")
    assert pesq_wb(speech, speech, fs) == pytest.approx(4.64, abs=0.01)
    assert pesq_wb(speech, worse(speech[:, None])[:, 0], fs) < 3


def test_pesq_is_optional(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pesq", None)
    with pytest.raises(CueError, match="pip install pesq"):
        pesq_wb(np.ones(FS), np.ones(FS), FS)


def test_loudness_of_the_standard_s_tone_and_of_its_gates() -> None:
    t = np.arange(4 * 48000) / 48000
    tone = np.sin(2 * np.pi * 997 * t)
    assert loudness_lufs(np.stack([tone, tone], axis=1) * 0.1, 48000) == pytest.approx(
        -20, abs=0.05
    )
    for fs in (32000, 44100):
        at_rate = np.sin(2 * np.pi * 997 * np.arange(4 * fs) / fs)[:, np.newaxis]
        assert loudness_lufs(at_rate, fs) == pytest.approx(-3.01, abs=0.03)
    paused = np.concatenate([tone, 0.001 * tone])[:, np.newaxis]
    # Three blocks reach across the edge and are partly loud: 0.2 LU.
    assert loudness_lufs(paused, 48000) == pytest.approx(-3.01, abs=0.3)
    with pytest.raises(CueError, match=r"^loudness: nothing"):
        loudness_lufs(np.zeros((48000, 1)), 48000)
    with pytest.raises(CueError, match=r"^loudness of shape"):
        loudness_lufs(np.zeros(48000), 48000)


def test_frames_are_counted_as_in_python() -> None:
    states = []
    for count in (_kernels.count_frames, getattr(_kernels.count_frames, "py_func", None)):
        assert count is not None
        rng = np.random.default_rng(3)
        sums, whole = np.zeros((_kernels.SUMS, 2)), np.zeros(_kernels.WHOLE_SUMS)
        sums[_kernels.WINDOW : _kernels.WINDOWED] = np.nan
        features = rng.uniform(0, 3, (12, 2, 10))
        features[..., _kernels.BANDWIDTH_REF] -= 1.0
        ehs, (detection, steps) = rng.uniform(-1, 1, (12, 2)), rng.uniform(0, 1, (2, 12))
        for part in (slice(0, 5), slice(5, 12)):
            n = np.arange(12)[part]
            frames = features[part], ehs[part], detection[part], steps[part]
            count(*frames, n > 2, n > 4, 1.4, sums, whole)
        states.append((sums, whole))
    np.testing.assert_allclose(states[0][0], states[1][0], rtol=1e-12)
    np.testing.assert_allclose(states[0][1], states[1][1], rtol=1e-12)
    sums, whole = states[0]
    assert whole[_kernels.FRAMES] == 12
    # Windows of four frames from the third on: six are whole.
    assert (sums[_kernels.WINDOWED + 1] == 6).all()
    assert (sums[_kernels.NOISE + 1] == 7).all()
