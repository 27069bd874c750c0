from types import ModuleType

import numpy as np
import pytest

from codec.analysis.recognise import (
    Gaussians,
    characteristic_distances,
    fit_gaussians,
    fit_recogniser,
    pointing_tip,
)
from codec.cuer import layout
from codec.cuer.models import rigid
from codec.errors import CueError


def test_seven_distances_of_known_points() -> None:
    markers = np.zeros((1, 113, 3))
    index = layout.MARKER_NUMBER
    for digit in range(1, 6):
        markers[0, index[f"F{digit}T"]] = [20.0 * digit, 0.0, 0.0]
    markers[0, [index[f"P{d}"] for d in range(2, 6)]] = [0.0, 15.0, 0.0]
    expected = [[20, 40, 60, 80, 100, 20, 25]]
    np.testing.assert_allclose(characteristic_distances(markers), expected)


def test_pointing_tip_moves_with_the_head_and_follows_the_shape(toy: ModuleType) -> None:
    markers = np.repeat(toy.cuer_markers(1, 40)[:1], 2, axis=0)
    motion = np.array([[0.0] * 6, [0.2, -0.1, 0.3, 10, 20, 30]])
    moved = rigid.rigid_motion(markers, motion)
    head = markers[0, layout.marker_indices(layout.RIGID_FACE)].astype(float)
    tips = pointing_tip(moved, np.array([4, 4]), head)
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-4)
    np.testing.assert_allclose(tips[0], markers[0, layout.MARKER_NUMBER["F3T"]], atol=1e-4)
    index = pointing_tip(moved, np.array([1, 6]), head)
    np.testing.assert_allclose(index[0], markers[0, layout.MARKER_NUMBER["F2T"]], atol=1e-4)


def test_hidden_head_gives_equal_probabilities(toy: ModuleType) -> None:
    markers = toy.cuer_markers(1, 600)
    label = np.arange(600) % 9
    recogniser = fit_recogniser(markers, label, np.arange(600) % 6)
    unknown = markers[:2].copy()
    unknown[:, layout.marker_indices(layout.RIGID_FACE)] = np.nan
    np.testing.assert_allclose(recogniser.placement_posteriors(unknown), 1 / 6)
    np.testing.assert_allclose(recogniser.shape_posteriors(unknown).sum(1), 1)


def test_posteriors_are_bayes_rule() -> None:
    classes = Gaussians(np.array([[0.0], [4.0]]), np.array([[[1.0]], [[4.0]]]))
    x = np.array([[1.0]])
    density = [np.exp(-0.5), np.exp(-9 / 8) / 2]
    expected = density[0] / sum(density)
    np.testing.assert_allclose(classes.posteriors(x)[0, 0], expected)


def test_separate_classes_are_told_apart() -> None:
    rng = np.random.default_rng(0)
    label = np.arange(400) % 4
    x = rng.normal(size=(400, 3)) + 8 * label[:, None]
    learnt = fit_gaussians(x[:200], label[:200], 4, what="class")
    assert (learnt.posteriors(x[200:]).argmax(1) == label[200:]).mean() > 0.99


def test_a_class_of_one_example_borrows_the_spread_of_the_others() -> None:
    rng = np.random.default_rng(0)
    label = np.concatenate([np.arange(200) % 3, [3]])
    x = rng.normal(size=(201, 3)) + 8 * label[:, None]
    learnt = fit_gaussians(x, label, 4, what="class")
    assert learnt.missing == ()
    again = rng.normal(size=(50, 3)) + 24
    assert (learnt.posteriors(again).argmax(1) == 3).mean() > 0.95


def test_a_class_without_examples_is_told_and_never_recognised() -> None:
    rng = np.random.default_rng(0)
    label = np.array([0, 2, 3] * 60)
    x = rng.normal(size=(180, 3)) + 8 * label[:, None]
    learnt = fit_gaussians(x, label, 4, what="class")
    assert learnt.missing == (1,)
    found = learnt.posteriors(x)
    assert (found[:, 1] == 0).all()
    assert (found.argmax(1) == label).mean() > 0.99


@pytest.mark.parametrize("label", [[0, 0, 0, 0], [0, 1, 2], []])
def test_too_few_examples_to_tell_classes_apart_are_refused(label: list[int]) -> None:
    labels = np.array(label, dtype=int)
    with pytest.raises(CueError, match=r"too few targets to tell one placement .*0: \d"):
        fit_gaussians(np.zeros((len(label), 3)), labels, 3, what="placement")


def test_training_without_a_head_is_refused() -> None:
    with pytest.raises(CueError, match="no training frame shows all rigid markers"):
        fit_recogniser(np.full((4, 113, 3), np.nan), np.zeros(4, int), np.zeros(4, int))
