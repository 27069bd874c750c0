"""Pitch, marks, TD-PSOLA and line spectrum pairs, on made voices and on the real one at hand."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.errors import CueError
from synth.units.speech import _kernels
from synth.units.speech.lsp import line_spectrum_pairs, linear_prediction
from synth.units.speech.marks import place_marks
from synth.units.speech.pitch import PitchTrack, track_pitch
from synth.units.speech.psola import SpeechPiece, modify_prosody

FS = 16000
CLIPS = Path(__file__).resolve().parents[4] / "shared" / "data" / "audio"


def voice(
    f0_start: float = 110.0, f0_end: float = 180.0, seconds: float = 1.5
) -> NDArray[np.float64]:
    """Glottal pulses through two resonances, between two stretches of noise."""
    from scipy.signal import lfilter

    n = round(seconds * FS)
    phase = np.cumsum(np.linspace(f0_start, f0_end, n) / FS)
    pulses = np.diff(np.floor(phase), prepend=0.0)
    for resonance, width in ((600.0, 90.0), (1700.0, 140.0)):
        r = np.exp(-np.pi * width / FS)
        pulses = lfilter([1.0], [1, -2 * r * np.cos(2 * np.pi * resonance / FS), r * r], pulses)
    noise = 0.01 * np.random.default_rng(1).standard_normal((2, FS // 4))
    return np.concatenate([noise[0], pulses / np.abs(pulses).max() * 0.5, noise[1]])


def real_speech(name: str) -> NDArray[np.float64]:
    path = CLIPS / f"{name}.flac"
    if not path.exists():
        pytest.skip(f"needs the recording {path.name} of ../shared/data")
    import soundfile
    from scipy.signal import resample_poly

    x, fs = soundfile.read(path, frames=10 * 48000)
    mono = x if x.ndim == 1 else x.mean(axis=1)
    return np.asarray(resample_poly(mono, FS, fs), dtype=np.float64)


def test_pitch_of_a_gliding_voice() -> None:
    x = voice()
    track = track_pitch(x, FS)
    times = np.arange(len(track.f0)) * track.hop_s
    truth = np.interp(times, [0.25, 1.75], [110, 180])
    inside = (times > 0.3) & (times < 1.7)
    outside = (times < 0.2) | (times > 1.8)
    assert (track.f0[inside] > 0).mean() > 0.97
    assert np.abs(track.f0[inside] / truth[inside] - 1).max() < 0.03
    assert (track.f0[outside] > 0).mean() < 0.1


@pytest.mark.parametrize("x", [np.zeros(0), np.zeros(FS), np.ones(10)])
def test_nothing_to_find(x: NDArray[np.float64]) -> None:
    track = track_pitch(x, FS)
    assert not track.f0.any()
    marks = place_marks(x, FS, track)
    assert not marks.voiced.any()
    assert len(modify_prosody(x, marks, [SpeechPiece.of([0, 1], [0, 2])])) == 2 * FS


def test_pitch_range_must_fit_the_rate() -> None:
    with pytest.raises(CueError, match="pitch range 70"):
        track_pitch(np.zeros(100), 1000)


def test_marks_are_one_per_period() -> None:
    x = voice(120, 120)
    marks = place_marks(x, FS, track_pitch(x, FS))
    assert (np.diff(marks.sample) > 0).all()
    both = marks.voiced[1:] & marks.voiced[:-1]
    gaps = np.diff(marks.sample)[both]
    assert np.abs(gaps / (FS / 120) - 1).max() < 0.05
    assert abs(both.sum() - 1.5 * 120) <= 6


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_vowels_are_marked_at_the_same_phase(sign: float) -> None:
    """A vowel's waveform may be skewed either way: recordings of a voice must still join."""
    from scipy.signal import lfilter
    from scipy.stats import skew

    seen = set()
    for formants in ((300.0, 800.0), (700.0, 1200.0), (300.0, 2300.0), (500.0, 1500.0)):
        period = FS // 125
        x = np.zeros(FS)
        x[::period] = sign
        for frequency, width in ((0.0, 100.0), *((f, 80.0) for f in formants)):
            r = np.exp(-np.pi * width / FS)
            poles = (
                [1.0, -r]
                if not frequency
                else [1.0, -2 * r * np.cos(2 * np.pi * frequency / FS), r * r]
            )
            x = lfilter([1.0, -1.0] if not frequency else [1.0], poles, x)
        seen.add(bool(sign * skew(x) > 0))
        x += 0.001 * x.std() * np.random.default_rng(3).standard_normal(FS)
        marks = place_marks(x, FS, track_pitch(x, FS))
        inside = marks.sample[marks.voiced][10:-10]
        # The first peak after a pulse: of the pulse's sign, within a quarter of a period.
        assert (sign * x[inside] > 0).all()
        assert (inside % period < period / 4).all()
    assert seen == {True, False}


def test_a_hole_costs_only_its_own_marks() -> None:
    x = voice(120, 120)
    track = PitchTrack(np.where(track_pitch(voice(120, 120), FS).f0 > 0, 120.0, 0.0), 0.005)
    x[FS : FS + 3 * FS // 120] = 0.0
    marks = place_marks(x, FS, track)
    at_s = marks.sample[marks.voiced] / FS
    around = (np.abs(at_s - 0.6) < 0.3) | (np.abs(at_s - 1.4) < 0.3)
    assert abs(around.sum() - 2 * 0.6 * 120) <= 4


def test_identity_is_exact() -> None:
    x = voice()
    marks = place_marks(x, FS, track_pitch(x, FS))
    d = len(x) / FS
    y = modify_prosody(x, marks, [SpeechPiece.of([0, d], [0, d])])
    np.testing.assert_allclose(y, x, atol=1e-12)


@settings(max_examples=12)
@given(st.floats(0.7, 1.5), st.floats(0.6, 1.8))
def test_new_pitch_and_duration_are_what_was_asked_for(ratio: float, stretch: float) -> None:
    x = voice(120, 150)
    marks = place_marks(x, FS, track_pitch(x, FS))
    d = len(x) / FS
    y = modify_prosody(x, marks, [SpeechPiece.of([0, d], [0, d * stretch], ratio)])
    assert len(y) == round(d * stretch * FS)
    track = track_pitch(y, FS)
    times = np.arange(len(track.f0)) * track.hop_s / stretch
    truth = ratio * np.interp(times, [0.25, 1.75], [120, 150])
    voiced = (track.f0 > 0) & (times > 0.35) & (times < 1.65)
    assert voiced.sum() > 0.6 * ((times > 0.35) & (times < 1.65)).sum()
    assert abs(float(np.median(track.f0[voiced] / truth[voiced])) - 1) < 0.02
    assert np.abs(np.diff(y)).max() <= 1.02 * np.abs(np.diff(x)).max()


@pytest.mark.parametrize("name", ["speech_fr_f_lv", "speech_fr_m_lv"])
@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.5])
@pytest.mark.parametrize("stretch", [0.6, 1.0, 1.8])
def test_real_speech_without_clicks(name: str, ratio: float, stretch: float) -> None:
    x = real_speech(name)
    marks = place_marks(x, FS, track_pitch(x, FS))
    d = len(x) / FS
    y = modify_prosody(x, marks, [SpeechPiece.of([0, d], [0, d * stretch], ratio)])
    # Measured: at most 1.0004 times the recording's own largest step.
    assert np.abs(np.diff(y)).max() <= 1.005 * np.abs(np.diff(x)).max()
    if ratio == stretch == 1.0:
        np.testing.assert_allclose(y, x, atol=1e-12)


@pytest.mark.parametrize(
    ("source", "target", "ratio", "message"),
    [
        ([0], [0], 1.0, "1 source"),
        ([0, 1], [0, 1, 2], 1.0, "2 source and 3 target"),
        ([0, 0], [0, 1], 1.0, "does not ascend"),
        ([0, 1], [1, 0], 1.0, "does not ascend"),
        ([0, float("nan")], [0, 1], 1.0, "does not ascend"),
        ([0, 1], [0, 1], 9.0, "not within 1/4..4"),
    ],
)
def test_bad_maps(source: list[float], target: list[float], ratio: float, message: str) -> None:
    with pytest.raises(CueError, match=message):
        SpeechPiece.of(source, target, ratio)


def test_pieces_follow_each_other() -> None:
    x = voice(120, 150)
    marks = place_marks(x, FS, track_pitch(x, FS))
    d = len(x) / FS
    parts = [SpeechPiece.of([0, 0.8], [0, 0.8]), SpeechPiece.of([0.8, d], [0.8, d])]
    np.testing.assert_allclose(modify_prosody(x, marks, parts), x, atol=1e-12)
    with pytest.raises(CueError, match=r"starts at 0\.8 s, not 0\.7 s"):
        modify_prosody(x, marks, [SpeechPiece.of([0, 0.8], [0, 0.7]), parts[1]])
    with pytest.raises(CueError, match="no piece"):
        modify_prosody(x, marks, [])


def test_line_spectrum_pairs_are_the_roots() -> None:
    frames = np.random.default_rng(0).standard_normal((20, 400)) * np.hanning(400)
    a = linear_prediction(frames, 18)
    lsp = line_spectrum_pairs(a)
    assert (np.diff(lsp, axis=1) > 0).all()
    for polynomial, angles in zip(a, lsp, strict=True):
        padded = np.append(polynomial, 0.0)
        roots = np.concatenate([np.roots(padded + s * padded[::-1]) for s in (1, -1)])
        expected = np.sort(np.angle(roots))
        expected = expected[(expected > 1e-6) & (expected < np.pi - 1e-6)]
        np.testing.assert_allclose(angles, expected, atol=1e-9)


def test_prediction_of_a_known_resonance() -> None:
    x = np.zeros((1, 4000))
    x[0, :2] = 1.0, 1.6
    for n in range(2, 4000):
        x[0, n] = 1.6 * x[0, n - 1] - 0.9 * x[0, n - 2]
    np.testing.assert_allclose(linear_prediction(x, 2), [[1.0, -1.6, 0.9]], atol=1e-2)
    np.testing.assert_array_equal(linear_prediction(np.zeros((1, 50)), 4), [[1, 0, 0, 0, 0]])


def test_refusals_of_prediction() -> None:
    with pytest.raises(CueError, match="order 50"):
        linear_prediction(np.zeros((1, 50)), 50)
    with pytest.raises(CueError, match="even order, not 3"):
        line_spectrum_pairs(np.ones((1, 4)))


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(2)
    lag = rng.uniform(40, 200, (30, 3)) * (rng.random((30, 3)) > 0.2)
    strength, unvoiced = rng.random((30, 3)), rng.random(30)
    paths = np.zeros((2, 30), dtype=np.int64)
    _kernels.voicing_path(lag, strength, unvoiced, 0.3, 0.1, paths[0])
    _kernels.voicing_path.py_func(lag, strength, unvoiced, 0.3, 0.1, paths[1])
    np.testing.assert_array_equal(paths[0], paths[1])

    position = np.cumsum(rng.integers(5, 60, 40))
    chosen = np.zeros((2, 40), dtype=np.bool_)
    height, period = rng.random(40), np.full(40, 80.0)
    _kernels.epoch_path(position, height, period, 12.0, 3.0, chosen[0])
    _kernels.epoch_path.py_func(position, height, period, 12.0, 3.0, chosen[1])
    np.testing.assert_array_equal(chosen[0], chosen[1])

    x = rng.standard_normal(300)
    mark, target = np.arange(20, 280, 20), np.arange(10, 380, 25)
    source = rng.integers(0, len(mark), len(target))
    mirrored = rng.random(len(target)) > 0.5
    shift, gain = rng.integers(-9, 9, len(target)), rng.random(len(target)).round(1)
    y = np.zeros((2, 400))
    _kernels.overlap_add(x, mark, target, source, mirrored, shift, gain, y[0])
    _kernels.overlap_add.py_func(x, mark, target, source, mirrored, shift, gain, y[1])
    np.testing.assert_allclose(y[0], y[1], atol=1e-12)


def test_track_needs_no_particular_length() -> None:
    for n in (1, 2, 79, 80, 81):
        assert isinstance(track_pitch(np.ones(n), FS), PitchTrack)
