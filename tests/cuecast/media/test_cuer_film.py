"""Films of the cuer: every frame, the programme's sound, captions."""

from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import load_voice
from codec.errors import CueError, VoiceError
from cuecast.media.cuer_film import render_motion
from cuecast.media.film import write_film
from cuecast.media.subtitles import read_track, text_tracks
from receiver.drawing.render import read_picture
from receiver.media.sound import read_sound
from synth.language.subtitles.model import Subtitle
from tests.receiver.standin import make_motion, make_voice

VOICE = make_voice()
MOTION = make_motion(VOICE, duration_s=1.0)
FS = 48_000
TEXTS = [(0.2, 0.7, "[Musique]"), (0.7, 1.4, "Bonjour !\nÇa va ?"), (1.3, 2.0, "Oui.")]


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


@pytest.fixture(scope="module")
def programme(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds: a tone that starts at one second, and three captions."""
    path = tmp_path_factory.mktemp("programme") / "p.mp4"
    time = np.arange(2 * FS) / FS
    tone = (0.5 * np.sin(2 * np.pi * 440 * time) * (time >= 1)).astype(np.float32)
    pictures = [np.zeros((32, 32, 3), np.uint8)] * 50
    captions = [Subtitle(*values) for values in TEXTS]
    write_film(
        path,
        tone[:, None],
        FS,
        encoder="aac",
        bit_rate=96_000,
        pictures=pictures,
        captions=captions,
    )
    return path


def captions_in(path: Path) -> list[tuple[float, float, str]]:
    track = text_tracks(path)[0]
    return [(s.start_s, s.end_s, s.text) for s in read_track(path, track)]


def late(start_s: float) -> Motion:
    return replace(MOTION, start_s=start_s)


def loud(sound: NDArray[np.float32]) -> float:
    return float(np.sqrt((sound**2).mean()))


def test_film_has_the_programme_s_sound_and_captions(tmp_path: Path, programme: Path) -> None:
    path = tmp_path / "cuer.mp4"
    render_motion(late(0.6), VOICE, path, size=(64, 72), programme=programme)
    sound, fs = read_sound(path)
    assert (fs, sound.shape[1]) == (FS, 1)
    assert len(sound) == pytest.approx(FS, abs=2048)
    assert loud(sound[: int(0.35 * fs)]) < 0.01
    assert loud(sound[int(0.45 * fs) : int(0.95 * fs)]) == pytest.approx(0.354, abs=0.02)
    found = captions_in(path)
    assert [text for _, _, text in found] == ["Bonjour !\nÇa va ?", "Oui."]
    assert np.allclose([f[:2] for f in found], [(0.1, 0.7), (0.7, 1.0)], atol=0.011)
    with av.open(str(path)) as container:
        assert sum(1 for _ in container.decode(video=0)) == 25


def test_captions_of_a_file_and_silence_beyond_the_programme(
    tmp_path: Path, programme: Path
) -> None:
    subtitles = tmp_path / "a.srt"
    subtitles.write_text("1\n00:00:01,500 --> 00:00:02,200\nVoilà.\n", encoding="utf-8")
    path = tmp_path / "cuer.mp4"
    options = {"size": (64, 72), "programme": programme, "subtitles": subtitles}
    render_motion(late(1.4), VOICE, path, **options)  # type: ignore[arg-type]
    sound, fs = read_sound(path)
    assert len(sound) == pytest.approx(FS, abs=2048)
    assert loud(sound[: int(0.5 * fs)]) > 0.3
    assert loud(sound[int(0.7 * fs) :]) < 0.01
    assert [text for _, _, text in captions_in(path)] == ["Voilà."]


def test_a_track_that_is_not_there_leaves_no_file(tmp_path: Path, programme: Path) -> None:
    with pytest.raises(CueError, match="no subtitle track '7'"):
        render_motion(MOTION, VOICE, tmp_path / "a.mp4", programme=programme, track="7")
    with pytest.raises(CueError, match="a picture has neither sound nor captions"):
        render_motion(MOTION, VOICE, tmp_path / "a.png", programme=programme)
    assert list(tmp_path.iterdir()) == []
