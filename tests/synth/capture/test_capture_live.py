"""A capture that streams: in time, without growing, the same however frames arrive."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.layout import N_FACE, RIGID_FACE, marker_indices
from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.evaluate.films import as_rows, film
from synth.capture.sources.landmark_maps import FACE_LANDMARKS
from synth.capture.sources.landmark_table import landmark_frames, read_landmarks
from synth.capture.tracker.live import LATE_S, LiveFrame, LiveLandmarks
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text

VOICE = load_voice()
RATE_HZ = 30.0
_SKULL = marker_indices(RIGID_FACE)


@pytest.fixture(scope="module")
def shots() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    score = score_of_text("Il pleut sur la ville depuis hier.", start_s=0.5)
    cuer = GestureSynthesiser("claire", rate_hz=RATE_HZ)
    return film(cuer, score, seconds=4.0, noise_mm=2.0)


def streamed(
    face: np.ndarray, hand: np.ndarray, live: LiveLandmarks | None = None
) -> list[tuple[float, LiveFrame]]:
    """Return each frame with the time at which it came out."""
    live = live or LiveLandmarks(VOICE, rate_hz=RATE_HZ)
    out = []
    for number, (of_face, of_hand) in enumerate(zip(face, hand, strict=True)):
        now = number / RATE_HZ
        out += [(now, one) for one in live.process(now, of_face, {"hand": of_hand})]
    return out + [(now, one) for one in live.flush()]


def test_parameters_come_in_time_and_in_order(
    shots: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    face, hand, markers = shots
    out = streamed(face, hand)
    late = [now - one.time_s for now, one in out]
    assert max(late) <= LATE_S + 1e-9
    times = [one.time_s for _, one in out]
    np.testing.assert_allclose(np.diff(times), 1 / RATE_HZ, atol=1e-6)
    late_enough = [(round(t * RATE_HZ), one.params) for t, (_, one) in zip(times, out, strict=True)]
    at = np.array([n for n, _ in late_enough if n > 60])
    params = np.stack([p for n, p in late_enough if n > 60])
    ours, true = VOICE.reconstruct(params), markers[at]
    ours, true = (x - x[:, _SKULL].mean(1, keepdims=True) for x in (ours, true))
    gap = np.linalg.norm((ours - true)[..., :2], axis=-1)
    assert gap[:, :N_FACE].mean() < 2.5  # measured 1.1
    assert gap[:, N_FACE:].mean() < 10.0  # measured 5.4


def test_the_same_frames_give_the_same_parameters(
    shots: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    face, hand, _ = (part[:40] for part in shots)
    first, second = (np.stack([one.params for _, one in streamed(face, hand)]) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_hand_that_leaves_goes_to_rest(shots: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    face, hand, _ = (part[:90].copy() for part in shots)
    hand[45:] = np.nan
    out = streamed(face, hand)
    columns = VOICE.hand_columns
    last = [one.params[columns] for _, one in out]
    assert np.linalg.norm(last[-1] - last[-2]) < 0.2 * np.linalg.norm(last[-30] - last[-1]) + 1e-9


def test_no_face_gives_nothing() -> None:
    nothing = np.full((20, len(FACE_LANDMARKS), 3), np.nan)
    assert not streamed(nothing, np.full((20, 21, 3), np.nan))
    with pytest.raises(CueError, match="not within 5"):
        LiveLandmarks(VOICE, rate_hz=1.0)


@pytest.mark.parametrize("long", [False, True])
def test_a_table_is_read_as_it_comes(
    tmp_path: Path, shots: tuple[np.ndarray, np.ndarray, np.ndarray], *, long: bool
) -> None:
    face, hand, _ = (part[:30] for part in shots)
    text = as_rows(face, hand, RATE_HZ)
    if not long:
        titles = "frame," + ",".join(f"hand_{a}{n}" for n in range(21) for a in "xyz")
        rows = (
            ",".join([str(k), *(f"{v:.6f}" for v in row.ravel())]) for k, row in enumerate(hand)
        )
        text = "\n".join([titles, *rows]) + "\n"
    (tmp_path / "table.csv").write_text(text, encoding="utf-8")
    whole = read_landmarks(tmp_path / "table.csv", rate_hz=RATE_HZ)
    frames = list(landmark_frames(iter(text.splitlines(True)), name="pipe", rate_hz=RATE_HZ))
    np.testing.assert_allclose([f.times[0] for f in frames], whole.times, atol=1e-6)
    for name, expected in whole.hands.items():
        np.testing.assert_array_equal(np.concatenate([f.hands[name] for f in frames]), expected)
    assert next(landmark_frames(endless(text), name="pipe", rate_hz=RATE_HZ)).face.shape[0] == 1
    with pytest.raises(CueError, match="pipe"):
        list(landmark_frames(iter(["what\n", "ever\n"]), name="pipe"))


def endless(text: str) -> Iterator[str]:
    """Yield the first lines of a table, and fail if it is read to its end before it is used."""
    lines = text.splitlines(True)
    yield from lines[: len(lines) // 2]
    raise AssertionError("read further than it had to be")
