"""The second virtual cuer: any window alone, her own equations, the movement of real cuers."""

import ast
import importlib.util
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.cues.score import Score
from codec.errors import CueError
from cuecast.evaluate.films import ASPECT, WIDTH_MM, film
from synth.capture.sources.landmark_maps import FACE_LANDMARKS
from synth.motion.measured.cuer import MeasuredCuer, performer
from synth.motion.measured.drift_noise import DriftNoise
from synth.motion.measured.plan import paced
from synth.motion.measured.strokes import travelled
from synth.studio.recital import recital

ROOT = Path(__file__).resolve().parents[3]
TOOL = ROOT.parent / "shared" / "tools" / "real_cuers.py"
TEXTS = ("Bonjour, comment allez-vous ce matin ?", "Il pleut sur la ville depuis hier soir.")


@pytest.fixture(scope="module")
def score() -> Score:
    return paced(recital(TEXTS))


def test_any_window_of_time_is_the_same_made_alone(score: Score) -> None:
    cuer = MeasuredCuer(rate_hz=30.0, seed=3)
    whole = cuer.markers(score, 0.0, 120)
    alone = MeasuredCuer(rate_hz=30.0, seed=3).markers(score, 70 / 30.0, 20)
    np.testing.assert_allclose(alone, whole[70:90], atol=1e-3)


def test_the_hand_arrives_at_its_targets(score: Score) -> None:
    cuer = MeasuredCuer(rate_hz=50.0, seed=1)
    times = cuer.target_times(score)
    assert [key for key, _ in times if key is not None] == list(score.keys)
    assert all(b > a for (_, a), (_, b) in itertools.pairwise(times))
    last = cuer.pose(score, times[-1][1] + 2.0, 2)
    first = cuer.pose(score, -50.0, 2)
    assert np.abs(last.forearm - first.forearm).max() < 120.0


def test_her_pace_is_that_of_real_cuers(score: Score) -> None:
    lengths = [key.end - key.start for key in score.keys]
    assert 3.0 < 1.0 / float(np.mean(lengths)) < 3.9
    assert len(paced(Score((), ())).keys) == 0


def test_she_shares_no_equations_with_the_predictor() -> None:
    forbidden = (
        "synth.motion.rules.movement",
        "synth.motion.rules.coarticulation",
        "synth.motion.rules.drift",
        "codec.superframe",
        "codec.streamfile",
    )
    paths = list((ROOT / "synth" / "motion" / "measured").glob("*.py"))
    assert paths
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert not node.module.startswith(forbidden), f"{path} imports {node.module}"


def test_strokes_are_no_minimum_jerk() -> None:
    u = np.linspace(0, 1, 101)
    polynomial = u**3 * (10 - 15 * u + 6 * u**2)
    assert np.abs(travelled(u, 0.5) - polynomial).max() > 0.01
    assert np.all(np.diff(travelled(u, 0.35)) >= 0)


def test_wandering_has_the_spread_that_is_asked_for() -> None:
    values = DriftNoise(np.array([1.0, 3.0]), 0.1, 5).at(np.linspace(0.0, 1000.0, 20001))
    np.testing.assert_allclose(values.std(0), [1.0, 3.0], rtol=0.05)


def test_unknown_cuers_are_refused() -> None:
    with pytest.raises(CueError, match="unknown cuer"):
        performer("nobody", "measured")
    with pytest.raises(CueError, match=r"1\.\.1000"):
        MeasuredCuer(rate_hz=0.0)


def test_movement_is_that_of_real_cuers() -> None:
    """Nine of the ten rows of the table of real cuers, within a tenth, by the same analysis.

    Amplitude and duration go together too little (.09; real .22 to .38): time is what limits her.
    """
    if not TOOL.exists():
        pytest.skip("needs the analysis ../shared/tools/real_cuers.py")
    rows = movement_rows(_movement())
    within = {name: low * 0.9 <= value <= high * 1.1 for name, (value, low, high) in rows.items()}
    assert sum(within.values()) >= 9, rows


def _movement() -> dict[str, Any]:
    spec = importlib.util.spec_from_file_location("real_cuers", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    from synth.language.text.sentences import read_sentences

    found, keys, lips, seconds = [], 0, [], 0.0
    for seed, text in enumerate(read_sentences()[190:214]):
        score = paced(recital([text], seed=seed))
        cuer = performer("solange", "measured", rate_hz=30.0, seed=seed)
        length = score.phones[-1].end + 1.0
        face, hand, _ = film(cuer, score, seconds=length, noise_mm=3.0, seed=seed)
        seen = _in_head(face, hand)
        found.append(tool.analyse(seen, 30.0))
        keys += len(score.keys)
        seconds += float(np.isfinite(seen[:, 0, 0]).sum()) / 30.0
        for key, at in cuer.target_times(score):
            vowels = (
                []
                if key is None
                else [p for p in score.phones if key.start <= p.start + 1e-6 < key.end]
            )
            if len(vowels) == 2:
                lips.append(0.5 * (vowels[1].start + vowels[1].end) - at)
    merged: dict[str, Any] = tool.merge(found)
    return merged | {"keys_per_s": keys / seconds, "lips": lips}


def _in_head(face: np.ndarray, hand: np.ndarray) -> np.ndarray:
    """Return the hand in mm about the middle of the ears; NaN where it has left the picture."""
    size = np.array([WIDTH_MM, WIDTH_MM / ASPECT])
    ears = face[:, [FACE_LANDMARKS.index(454), FACE_LANDMARKS.index(234)], :2] * size
    scale = 153.0 / np.median(np.linalg.norm(ears[:, 0] - ears[:, 1], axis=1))
    seen = (hand[..., :2] * size - ears.mean(1)[:, None]) * scale
    seen[seen[:, 0, 1] > 305.0] = np.nan
    return np.asarray(seen)


def movement_rows(found: dict[str, Any]) -> dict[str, tuple[float, float, float]]:
    """Return each row's figure and the range over the three groups of real utterances."""
    amplitude, duration = np.array(found["amp"]), np.array(found["dur"])
    big = amplitude > 25
    together = float(np.corrcoef(amplitude[big], duration[big])[0, 1])
    return {
        "keys per second": (found["keys_per_s"], 3.0, 3.9),
        "stroke": (float(np.median(found["dur"])), 0.300, 0.333),
        "holds shorter than 40 ms": (float(np.mean(np.array(found["hold"]) < 0.04)), 0.69, 0.73),
        "peak speed": (float(np.median(found["peak"])), 283.0, 320.0),
        "amplitude": (float(np.median(amplitude)), 56.0, 56.0),
        "path over chord": (float(np.median(found["straight"])), 1.17, 1.20),
        "amplitude and duration": (together, 0.22, 0.38),
        "speed in holds": (float(np.median(found["drift"])), 30.0, 47.0),
        "fingers before the hand": (-float(np.median(found["soff"])), 0.033, 0.058),
        "hand before the lips": (float(np.median(found["lips"])), 0.167, 0.167),
    }
