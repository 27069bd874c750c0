from pathlib import Path

import av
import numpy as np
import pytest

from codec.cuer.motion import sample_params
from codec.cuer.voice import load_voice
from codec.errors import CueError, VoiceError
from receiver.drawing.camera import Camera, frame_cuer
from receiver.drawing.points import draw_points
from receiver.drawing.render import read_picture, render_motion
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


def test_film_has_every_frame(tmp_path: Path) -> None:
    path = tmp_path / "cuer.mp4"
    seen: list[tuple[int, int]] = []
    render_motion(MOTION, VOICE, path, size=(160, 192), fps=25, progress=lambda *p: seen.append(p))
    with av.open(str(path)) as container:
        frames = [f.to_ndarray(format="gray") for f in container.decode(video=0)]
    assert [f.shape for f in frames] == [(192, 160)] * 25
    assert seen[-1] == (25, 25)
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 100


def test_picture_over_a_background(tmp_path: Path) -> None:
    ground = np.full((120, 200, 3), (10, 90, 20), np.uint8)
    render_motion(MOTION, VOICE, tmp_path / "a.png", background=ground, at_s=0.5)
    picture = read_picture(tmp_path / "a.png")
    assert picture.shape == ground.shape
    changed = (picture != ground).any(axis=2)
    assert 0 < changed.mean() < 0.2
    render_motion(MOTION, VOICE, tmp_path / "b.png", background=tmp_path / "a.png", at_s=0.5)
    assert np.array_equal(read_picture(tmp_path / "b.png")[~changed], picture[~changed])


def test_avatar_is_drawn_where_there_is_one(tmp_path: Path) -> None:
    claire = load_voice()
    motion = make_motion(claire, duration_s=1.0)
    render_motion(motion, claire, tmp_path / "a.png", style="avatar", size=(124, 144))
    picture = read_picture(tmp_path / "a.png")
    assert 0.2 < (picture.max(axis=2) > 20).mean() < 0.9
    with pytest.raises(CueError, match="voice stand-in has no avatar"):
        render_motion(MOTION, VOICE, tmp_path / "b.png", style="avatar")


def test_parameters_between_frames_are_interpolated() -> None:
    params = sample_params(MOTION, np.array([-1.0, 0.01, 99.0]))
    middle = (MOTION.params[0] + MOTION.params[1]) / 2
    assert np.allclose(params, [MOTION.params[0], middle, MOTION.params[-1]], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("x.avi", {}, "x.avi: a film ends in .mp4, a picture in .png"),
        ("x.png", {"style": "oil"}, "unknown style 'oil'"),
        ("x.png", {"size": (8, 8)}, "picture of 8x8 is not within 16..4096 a side"),
        ("x.mp4", {"size": (101, 100)}, "film of 101x100: both sides have to be even"),
        ("x.png", {"background": __file__}, "cannot be read as a picture"),
    ],
)
def test_unusable_requests(
    tmp_path: Path, name: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(CueError, match=message):
        render_motion(MOTION, VOICE, tmp_path / name, **options)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_foreign_voice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(VoiceError, match="motion was made with voice"):
        render_motion(MOTION, make_voice(1), tmp_path / "x.png")
