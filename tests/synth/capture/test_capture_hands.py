"""Real hands: landmarks that a tracker found in photographs of six people's hand shapes."""

import json
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.models.inversion import invert
from codec.cuer.voice import load_voice
from synth.capture.points.solve import likely_postures
from synth.capture.sources.landmark_maps import hand_map
from synth.capture.tracker.closure import closures, rescaled
from synth.capture.tracker.landmark_model import HAND_TRUST, LandmarkModel
from synth.capture.tracker.landmarks import started
from synth.capture.tracker.own_map import HAND_RIDGE_MM2, near_hand, own_map

SHARED = Path(__file__).parents[4] / "shared" / "data" / "hand" / "handshapes_mediapipe_angles.json"
VOICE = load_voice()
SLOPE = np.radians(75.0)


def photographs() -> dict[str, dict[int, np.ndarray]]:
    """Return landmarks (21, 3) by person and shape, the hand turned as in cueing, mm."""
    found: dict[str, dict[int, np.ndarray]] = defaultdict(dict)
    for name, entry in json.loads(SHARED.read_text(encoding="utf-8")).items():
        person, _, shape = name.removesuffix(".png").rpartition("_")
        if entry and entry.get("world") and shape.isdigit():
            x = np.array(entry["world"]) * [1.0, -1.0, -1.0]
            along = x[9] - x[0]
            turn = SLOPE - np.arctan2(along[1], along[0])
            c, s = np.cos(turn), np.sin(turn)
            x = x @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            found[person][int(shape)] = x + np.array([-60.0, -150.0, 120.0])
    return found


@pytest.mark.skipif(not SHARED.is_file(), reason="no ../shared/data beside the project")
def test_shapes_of_six_people() -> None:
    model = LandmarkModel(VOICE.hand, hand_map(), np.zeros((21, 3)), HAND_TRUST)
    targets = closures(VOICE, VOICE.gestures.shape_targets)
    plain = scaled = total = 0
    for shapes in photographs().values():
        x = np.array(list(shapes.values()))
        begun = started(model, x, likely_postures(VOICE))
        x[..., 2] += (model.landmarks(begun)[:, :1] - x[:, :1])[..., 2]
        found = invert(model, x, np.ones(x.shape[:2], dtype=bool), begun)[:, : model.n_shape]
        # Each photograph stands for some frames of a take.
        often = np.tile(found, (10, 1))
        better = rescaled(VOICE, often, np.ones(len(often), dtype=bool))[: len(found)]
        for name, hands in (("plain", found), ("scaled", better)):
            gap = closures(VOICE, hands)[:, None] - targets
            right = int(((gap**2).sum(-1).argmin(1) == list(shapes)).sum())
            plain, scaled = (plain + right, scaled) if name == "plain" else (plain, scaled + right)
        total += len(x)
    assert total >= 50
    assert plain >= 0.75 * total
    assert scaled >= 0.9 * total


def test_a_hand_of_other_proportions_gets_weights_of_its_own() -> None:
    rng = np.random.default_rng(3)
    model = LandmarkModel(VOICE.hand, hand_map(), np.zeros((21, 3)), HAND_TRUST)
    table = VOICE.gestures
    found = np.concatenate(
        [np.repeat(table.shape_targets, 6, axis=0), table.placement_targets.reshape(54, -1)], axis=1
    ).astype(float)
    theirs = model.landmarks(found)
    for root, *others in ((5, 6, 7, 8), (9, 10, 11, 12)):
        theirs[:, others] += 0.2 * (theirs[:, others] - theirs[:, [root]])
    theirs += rng.normal(scale=0.5, size=theirs.shape)
    own = own_map(model, theirs, found, near_hand, HAND_RIDGE_MM2)
    before = np.linalg.norm((model.landmarks(found) - theirs)[..., :2], axis=-1).mean()
    after = np.linalg.norm((own.landmarks(found) - theirs)[..., :2], axis=-1).mean()
    assert after < 0.7 * before
    few = own_map(model, theirs[:5], found[:5], near_hand, HAND_RIDGE_MM2)
    np.testing.assert_array_equal(few.map.weights, model.map.weights)
