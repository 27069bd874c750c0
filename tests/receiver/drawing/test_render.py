import numpy as np
import pytest

from codec.cuer.motion import sample_params
from receiver.drawing.camera import Camera, frame_cuer
from receiver.drawing.points import draw_points
from tests.receiver.standin import make_motion, make_voice

VOICE = make_voice()
MOTION = make_motion(VOICE, duration_s=1.0)


def test_a_disc_stands_where_the_camera_says() -> None:
    camera = Camera((0, 0, 0), 500, 1500)
    markers = np.full((113, 3), 9e3)
    markers[:, 2] = 0
    markers[5] = (100, 50, 0)
    picture = np.zeros((300, 400, 3), np.uint8)
    draw_points(picture, markers, camera, dot=2)
    rows, columns = np.nonzero(picture.max(axis=2))
    assert rows.mean() + 0.5 == pytest.approx(150 - 50 / 500 * 300, abs=0.1)
    assert columns.mean() + 0.5 == pytest.approx(200 + 100 / 500 * 300, abs=0.1)


def test_mirror_swaps_the_sides() -> None:
    camera = frame_cuer(VOICE.reconstruct(MOTION.params[:1])[0])
    markers = VOICE.reconstruct(MOTION.params[:1])[0]
    plain, mirrored = np.zeros((2, 360, 310, 3), np.uint8)
    draw_points(plain, markers, camera)
    draw_points(mirrored, markers, camera, mirror=True)
    assert np.abs(plain.astype(int) - mirrored[:, ::-1]).max() <= 1
    assert plain.any()


def test_nearer_discs_are_larger() -> None:
    camera = Camera((0, 0, 0), 500, 1500)
    view = camera.project(np.array([[0, 0, -100.0], [0, 0, 100.0]]))
    assert view[0, 2] < 1 < view[1, 2]


def test_parameters_between_frames_are_interpolated() -> None:
    params = sample_params(MOTION, np.array([-1.0, 0.01, 99.0]))
    middle = (MOTION.params[0] + MOTION.params[1]) / 2
    assert np.allclose(params, [MOTION.params[0], middle, MOTION.params[-1]], atol=1e-6)
