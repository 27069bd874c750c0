import dataclasses
import re
import zipfile
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from codec.cuer.voice import Voice, load_voice, save_voice
from codec.errors import CueError, VoiceError
from codec.files.npz import read_arrays, write_arrays
from codec.training.fit import TrainingSet, fit_voice


def test_layout_names_the_parameters(toy_voice: Voice) -> None:
    names = toy_voice.layout
    assert names[:7] == tuple(f"face.{k}" for k in range(1, 8))
    assert names[7:19] == tuple(f"hand.{k}" for k in range(1, 13))
    assert len(names) == 19 + toy_voice.face.n_motion + toy_voice.hand.n_motion
    columns = np.concatenate([toy_voice.face_columns, toy_voice.hand_columns])
    assert sorted(columns) == list(range(len(names)))


def test_invert_then_reconstruct(toy: ModuleType, toy_voice: Voice) -> None:
    truth = toy.cuer_markers(7, 200)
    motion = toy_voice.invert(truth, rate_hz=50.0, start_s=1.5)
    assert (motion.rate_hz, motion.start_s, motion.voice) == (50.0, 1.5, toy_voice.identity)
    error = np.linalg.norm(toy_voice.reconstruct(motion.params) - truth, axis=-1)
    assert error[:, :63].mean() < 0.6  # measured 0.4
    assert error[:, 63:].mean() < 1.5  # measured 1.0


def test_nan_means_hidden(toy: ModuleType, toy_voice: Voice) -> None:
    truth = toy.cuer_markers(7, 40)
    hidden = np.random.default_rng(0).random(truth.shape[:2]) < 0.1
    by_mask = toy_voice.invert(truth, ~hidden, rate_hz=50.0)
    by_nan = toy_voice.invert(np.where(hidden[..., None], np.nan, truth), rate_hz=50.0)
    np.testing.assert_array_equal(by_mask.params, by_nan.params)


def test_nothing_visible_gives_the_mean(toy_voice: Voice) -> None:
    motion = toy_voice.invert(np.full((3, 113, 3), np.nan), rate_hz=50.0)
    np.testing.assert_allclose(motion.params, 0, atol=1e-5)


def test_wrong_shapes_are_named(toy_voice: Voice) -> None:
    with pytest.raises(CueError, match=r"markers have shape \(2, 50, 3\), expected \(T, 113, 3\)"):
        toy_voice.invert(np.zeros((2, 50, 3)), rate_hz=50.0)
    with pytest.raises(CueError, match=r"parameters have shape \(2, 3\)"):
        toy_voice.reconstruct(np.zeros((2, 3)))


def test_file_round_trip(toy_voice: Voice, tmp_path: Path) -> None:
    path = tmp_path / "toy.npz"
    save_voice(toy_voice, path)
    assert path.stat().st_size < 1_000_000
    loaded = load_voice(path)
    assert (loaded.name, loaded.identity) == (toy_voice.name, toy_voice.identity)
    params = np.random.default_rng(0).normal(size=(5, len(toy_voice.layout)))
    np.testing.assert_array_equal(loaded.reconstruct(params), toy_voice.reconstruct(params))


def test_identity_follows_the_content(toy_voice: Voice) -> None:
    other = dataclasses.replace(toy_voice, name="another name")
    assert other.identity == toy_voice.identity
    mean = toy_voice.face.mean + np.float32(1e-3)
    moved = dataclasses.replace(toy_voice, face=dataclasses.replace(toy_voice.face, mean=mean))
    assert moved.identity != toy_voice.identity


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": np.array("other")}, "format is other, expected cuecast-voice-1"),
        ({"identity": np.array("0" * 16)}, "the file says 0000000000000000"),
        ({"face.mean": np.zeros((62, 3))}, r"mean has shape \(62, 3\)"),
        ({"hand.motion_mean": np.full(6, np.nan)}, "hand model: motion_mean"),
        ({"gestures.neutral_head": np.zeros(9)}, "differ in the head"),
        ({"hand.angle_mean": np.array(["a", "b"])}, "malformed voice"),
    ],
)
def test_foreign_files_are_refused(
    toy_voice: Voice, tmp_path: Path, change: dict[str, np.ndarray], message: str
) -> None:
    path = tmp_path / "voice.npz"
    save_voice(toy_voice, path)
    write_arrays(path, read_arrays(path, max_bytes=1 << 22) | change)
    with pytest.raises(VoiceError, match=message):
        load_voice(path)


def test_missing_array_is_named(toy_voice: Voice, tmp_path: Path) -> None:
    path = tmp_path / "voice.npz"
    save_voice(toy_voice, path)
    arrays = read_arrays(path, max_bytes=1 << 22)
    del arrays["hand.regression"]
    write_arrays(path, arrays)
    with pytest.raises(VoiceError, match=r"voice without its array hand\.regression"):
        load_voice(path)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(VoiceError, match="No such file"):
        load_voice(tmp_path / "none.npz")


@pytest.fixture
def saved(toy_voice: Voice, tmp_path: Path) -> bytes:
    """The file of the toy voice."""
    path = tmp_path / "whole.npz"
    save_voice(toy_voice, path)
    return path.read_bytes()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.floats(0, 1, exclude_max=True), flip=st.integers(1, 255))
def test_damaged_files_are_refused(saved: bytes, tmp_path: Path, at: float, flip: int) -> None:
    path = tmp_path / "voice.npz"
    content = bytearray(saved)
    content[int(at * len(content))] ^= flip
    path.write_bytes(content)
    try:
        voice = load_voice(path)
    except VoiceError:
        return
    # The flip hit a time stamp or the name.
    path.write_bytes(saved)
    assert voice.identity == load_voice(path).identity


def test_training_needs_complete_frames_and_labels(toy: ModuleType) -> None:
    good = toy.training_set(1, 300)
    empty = TrainingSet(np.full((10, 113, 3), np.nan))
    with pytest.raises(CueError, match="0 complete frames of the face, 200 needed"):
        fit_voice("x", hand=empty, face=empty, joint=empty)
    with pytest.raises(CueError, match=r"training labels shape do not fit 300 frames"):
        TrainingSet(good.markers, np.full(300, 9))


def test_a_header_of_an_array_that_never_ends_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "voice.npz"
    text = b"{'descr': '<f4', 'fortran_order': False, 'shape': (157, 50 (), }"
    header = b"\x93NUMPY\x01\x00" + (len(text) + 1).to_bytes(2, "little") + text + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("format.npy", header)
    with pytest.raises(VoiceError, match=re.escape(str(path))):
        load_voice(path)
