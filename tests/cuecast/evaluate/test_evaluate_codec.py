"""The measures of `cuecast evaluate codec`, on small inputs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.layout import MARKERS
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from cuecast.evaluate import codec as evaluation
from cuecast.evaluate.baselines import BASELINES, Material, code_length
from cuecast.evaluate.bound import Bound, bound_of
from cuecast.evaluate.coded import CodedMotion, coded, lacking, row_of
from cuecast.evaluate.options import EvaluateOptions
from synth.studio.recital import perform, recital, sentences


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice("claire")


def smooth(voice: Voice, frames: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(frames + 40, len(voice.layout)))
    kernel = np.hanning(21) / np.sqrt(np.square(np.hanning(21)).sum())
    columns = [np.convolve(c, kernel, mode="same")[20:-20] for c in noise.T]
    return 0.5 * np.stack(columns, axis=1)


def test_bound_of_white_channels_is_the_textbook_s() -> None:
    """Ten white channels of variance 9 mm**2: half a bit per halving of the error."""
    bound = Bound(np.full((64, 10), 9.0), 50.0)
    error = float(np.sqrt(10 * 9.0 / len(MARKERS)))
    assert bound.rate_bps(1.01 * error) == 0
    assert bound.rate_bps(error / 2) == pytest.approx(10 * 50.0, rel=1e-3)
    assert bound.rate_bps(error / 4) == pytest.approx(2 * 10 * 50.0, rel=1e-3)


def test_bound_falls_with_the_error(voice: Voice) -> None:
    bound = bound_of(smooth(voice, 1500, 0), voice)
    rates = [bound.rate_bps(error) for error in (0.5, 1.0, 2.0, 4.0)]
    assert rates == sorted(rates, reverse=True)
    assert rates[-1] > 0


@pytest.mark.parametrize("name", BASELINES)
def test_baselines_trade_rate_for_error_and_stay_above_the_bound(voice: Voice, name: str) -> None:
    train, test = smooth(voice, 1600, 1), smooth(voice, 1600, 2)
    material = Material.of(train, test, voice)
    bound = bound_of(test, voice)
    results = []
    for step in (3.0, 12.0):
        bps, decoded = BASELINES[name](material, step)
        gap = voice.reconstruct(test[: len(decoded)]).astype(float) - voice.reconstruct(decoded)
        error = float(np.sqrt(np.square(gap).sum(axis=-1).mean()))
        # Measured 1.2 and more; the bound's spectra are estimates.
        assert bps > 0.9 * bound.rate_bps(error)
        results.append((bps, error))
    if name != "raw-8bit":
        assert results[0][0] > results[1][0]
        assert results[0][1] < results[1][1]


def test_code_length_counts_escapes() -> None:
    train = [np.zeros(1000)]
    assert code_length(train, [np.zeros(10)]) < 1
    assert code_length(train, [np.array([100.0])]) > 10


def test_losses_have_their_share_and_length() -> None:
    lost = evaluation.losses(20000, 0.1, burst=2, seed=[1])
    assert len({k for k in lost if k < 20000}) / 20000 == pytest.approx(0.1, abs=0.01)
    assert min(min(evaluation.losses(99, 0.5, burst=1, seed=[k])) for k in range(9)) == 6
    assert not evaluation.losses(1000, 0.0, burst=1, seed=[1])


def test_a_superframe_stream_is_measured(voice: Voice) -> None:
    motion = Motion(smooth(voice, 320, 3).astype(np.float32), 50, 0.0, voice.layout, voice.identity)
    rows = [row_of("x", coded(voice, motion, 10, size)) for size in (40, 200)]
    assert [row["bps"] for row in rows] == [500.0, 2500.0]
    assert rows[0]["marker_rms_mm"] > rows[1]["marker_rms_mm"]


def test_a_score_s_share_of_the_rate_is_told(voice: Voice) -> None:
    motion = perform(voice, recital(sentences(held_out=True)[:3]), seed=1)
    count = len(motion.params) // 32
    short, long = (coded(voice, motion, count, size) for size in (30, 60))
    assert short.residual_bps is not None
    assert long.residual_bps is not None
    # The same headers and scores; the rest is residual, but for what the setting takes.
    assert long.residual_bps - short.residual_bps == pytest.approx(8 * 30 / 0.64, abs=2)
    assert 100 < short.bps - short.residual_bps < 200
    plain = replace(motion, score=None)
    assert coded(voice, plain, count, 30).residual_bps is None


def test_what_resynthesis_lacks_is_less_than_the_motion(voice: Voice) -> None:
    motion = perform(voice, recital(sentences(held_out=True)[:3]), seed=1)
    left = lacking(voice, motion)
    moving = motion.params[: len(left)] - motion.params.mean(axis=0)
    assert left.shape == moving.shape
    # Measured: 0.29.
    assert np.square(left[:, 7:19]).sum() < 0.4 * np.square(moving[:, 7:19]).sum()


def test_outcomes_of_one_motion_count_together() -> None:
    one, other = (CodedMotion(100.0, np.full(113, s), 10, 9, w) for s, w in ((4.0, 0), (12.0, 1)))
    row = row_of("x", one, other)
    assert row["marker_rms_mm"] == pytest.approx(8**0.5, abs=1e-3)
    assert (row["keys_total"], row["keys_correct"], row["keys_wrong"]) == (20, 18, 1)


def test_keys_of_uneven_speech_are_counted(tmp_path: Path) -> None:
    options = EvaluateOptions(None, None, 0, tmp_path, lambda text: None)
    score = recital(sentences(held_out=True)[:4])
    rows = list(evaluation._hurried_rows(score, options))
    assert [row["bps"] for row in rows[:2]] == [75.0, 87.5]
    for row in rows:
        assert row["keys_total"] == len(score.keys)
        assert row["keys_correct"] + row["keys_wrong"] <= row["keys_total"]
    assert all(row["keys_correct"] == row["keys_total"] for row in rows[1::2])
