import numpy as np
import pytest

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.errors import CueError
from synth.capture.points.framing import find_framing, mirrored, shows_left_hand
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.drills import drill

Z_UP = np.array([np.pi / 2, 0.0, 0.0, 500.0, -200.0, 1200.0])


@pytest.fixture(scope="module", params=["claire", "agathe"])
def markers(request: pytest.FixtureRequest) -> np.ndarray:
    cuer = GestureSynthesiser(request.param, rate_hz=30.0)
    return cuer.markers(drill(2), 0.0, 200)


def test_our_own_axes_are_left_alone(markers: np.ndarray) -> None:
    framing = find_framing(markers)
    assert not framing.left_handed
    assert framing.apply(markers) is markers


def test_other_axes_are_turned(markers: np.ndarray) -> None:
    seen = markers.copy()
    seen[3:50, 5] = np.nan
    recorded = rigid.rigid_motion(seen, Z_UP).astype(np.float32)
    framed = find_framing(recorded).apply(recorded)
    assert np.isnan(framed[3:50, 5]).all()
    # The mean head stands where the reference head does: the same up to its size and pose.
    moved = np.linalg.norm(framed - seen, axis=-1)
    assert np.nanmax(moved) < 60.0
    shape = np.linalg.norm(framed[:, 0] - framed[:, 90], axis=-1)
    np.testing.assert_allclose(shape, np.linalg.norm(seen[:, 0] - seen[:, 90], axis=-1), rtol=1e-3)


def test_a_left_handed_cuer_is_mirrored(markers: np.ndarray) -> None:
    left = mirrored(markers)
    assert shows_left_hand(left)
    assert not shows_left_hand(markers)
    np.testing.assert_array_equal(find_framing(left).apply(left), markers)


def test_left_handed_with_other_axes(markers: np.ndarray) -> None:
    recorded = rigid.rigid_motion(mirrored(markers), Z_UP).astype(np.float32)
    framing = find_framing(recorded)
    assert framing.left_handed
    assert np.linalg.norm(framing.apply(recorded) - markers, axis=-1).max() < 60.0


def test_wrong_units_are_told(markers: np.ndarray) -> None:
    with pytest.raises(CueError, match=r"the ears are 0\.1\d+ mm apart, not 80\.\.250: wrong unit"):
        find_framing((markers / 1000.0).astype(np.float32))


def test_without_a_head_nothing_is_known(markers: np.ndarray) -> None:
    hidden = markers.copy()
    hidden[:, layout.marker_indices(layout.EARS)] = np.nan
    with pytest.raises(CueError, match="no frame shows all markers of ears"):
        find_framing(hidden)
