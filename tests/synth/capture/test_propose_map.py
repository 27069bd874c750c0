"""A map of labels by geometry: right where it is sure, or refused."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.layout import MARKERS, N_FACE, marker_indices
from codec.cuer.models import rigid
from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.command.cli import main
from synth.capture.points.framing import mirrored
from synth.capture.points.labels import read_map, write_map
from synth.capture.points.match import lay, spread_turns
from synth.capture.points.propose import SURE, Proposal, propose_map
from synth.capture.sources.recording import PointRecording
from synth.motion.measured.cuer import performer
from synth.studio.take import record
from tests.synth import studio_files as files

VOICE = load_voice()


@cache
def seen(identity: str) -> np.ndarray:
    """Return what a studio saw of a cuer, (T, 113, 3)."""
    law = "measured" if identity == "solange" else "lognormal"
    cuer = performer(identity, law, rate_hz=files.RATE_HZ, seed=5)
    return record(cuer, files.score(), seed=5).observed.astype(np.float64)


def recording(points: np.ndarray, labels: tuple[str, ...] | None = None) -> PointRecording:
    x = points.astype(np.float32)
    labels = labels or tuple(f"point {n}" for n in range(x.shape[1]))
    return PointRecording("take", "TRC", labels, "", 60.0, 0.0, len(x), (), lambda a, b: x[a:b])


def shuffled(x: np.ndarray, seed: int, *, unit_mm: float, missing: int = 6, strangers: int = 3,
             noise_mm: float = 1.0) -> tuple[np.ndarray, list[str]]:  # fmt: skip
    """Return points in unknown order, axes and unit, and what each is."""
    rng = np.random.default_rng(seed)
    noisy = x + rng.normal(scale=noise_mm, size=x.shape)
    noisy[rng.random(x.shape[:2]) < 0.05] = np.nan
    kept = rng.permutation(len(MARKERS))[missing:]
    box = np.nanmin(x, axis=(0, 1)), np.nanmax(x, axis=(0, 1))
    others = rng.uniform(*box, size=(strangers, 3)) + rng.normal(size=(len(x), strangers, 3))
    points = np.concatenate([noisy[:, kept], others], axis=1)
    names = [*(MARKERS[k] for k in kept), *["stranger"] * strangers]
    order = rng.permutation(len(names))
    motion = np.concatenate([2 * rng.normal(size=3), 1000 * rng.normal(size=3)])
    turned = rigid.rigid_motion(points[:, order], motion)
    return turned * rng.uniform(0.85, 1.15) / unit_mm, [names[k] for k in order]


def judged(proposal: Proposal, names: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return which pairs are right, and how sure each is."""
    right = [names[int(label.split()[1])] == marker for label, marker, _ in proposal.pairs]
    return np.array(right), np.array([confidence for _, _, confidence in proposal.pairs])


@pytest.mark.parametrize(
    ("identity", "unit_mm", "left"),
    [
        pytest.param("agathe", 1000.0, False, marks=pytest.mark.slow),
        pytest.param("solange", 1.0, False, marks=pytest.mark.slow),
        ("agathe", 10.0, True),
    ],
)
def test_unnamed_points_of_other_bodies(identity: str, unit_mm: float, left: bool) -> None:
    """Neither body is the voice's; the left-handed one is the mirror image, names and all.

    It is tried each day, the others at night.
    """
    x = mirrored(seen(identity)) if left else seen(identity)
    points, names = shuffled(x, 1 + left, unit_mm=unit_mm)
    proposal = propose_map(recording(points), VOICE)
    right, confidence = judged(proposal, names)
    sure = confidence >= SURE
    assert right[sure].mean() >= 0.95  # measured 1.0
    assert sure.sum() >= 85  # of 107; measured 97 and more
    assert len(proposal.sure) == sure.sum()


@pytest.mark.slow  # each day: what is called sure is right, in the test above
def test_how_sure_is_told() -> None:
    """Markers glued far from their places: fewer are sure, and those hold what was promised."""
    rng = np.random.default_rng(8)
    glued = seen("agathe") + rng.normal(scale=3.0, size=(1, len(MARKERS), 3))
    points, names = shuffled(glued, 8, unit_mm=1.0)
    right, confidence = judged(propose_map(recording(points), VOICE), names)
    assert right[confidence >= SURE].mean() >= 0.95  # measured 1.0, of 81
    assert abs(right.mean() - confidence.mean()) < 0.1  # measured 0.02
    assert confidence[~right].max() < SURE < confidence[right].mean()


def test_what_is_known_stays() -> None:
    """Even if it is wrong: two labels that stand for each other are nobody else's affair."""
    labels = [f"point {n}" for n in range(len(MARKERS))]
    known = [*marker_indices(["FH0", "FH1_R", "FH1_L", "EAR_R", "EAR_L", "NB", "A00", "K3"])]
    for number in known:
        labels[number] = MARKERS[number]
    labels[known[-1]], labels[known[-2]] = labels[known[-2]], labels[known[-1]]
    mapping = {"point 70": MARKERS[71]}
    points = seen("claire")
    proposal = propose_map(recording(points, tuple(labels)), VOICE, mapping=mapping)
    assert proposal.known == len(known) + 1
    given = {*(MARKERS[k] for k in known), MARKERS[71]}
    assert not given & {marker for _, marker, _ in proposal.pairs}
    assert "point 70" not in {label for label, _, _ in proposal.pairs}
    wrong = [pair for pair in proposal.sure.items() if MARKERS[int(pair[0].split()[1])] != pair[1]]
    assert not wrong
    with pytest.raises(CueError, match="every label that is seen for long enough names a marker"):
        propose_map(recording(points, MARKERS), VOICE)


def a_cloud() -> np.ndarray:
    rng = np.random.default_rng(0)
    still = rng.normal(scale=120.0, size=(1, 113, 3))
    return np.asarray(still + rng.normal(size=(40, 113, 3)))


def another_hand() -> np.ndarray:
    """Return a cuer's face, and a random body in the hand's place."""
    rng = np.random.default_rng(1)
    x = seen("agathe").copy()
    centre = np.nanmean(x[:, N_FACE:], axis=1, keepdims=True)
    x[:, N_FACE:] = centre + rng.uniform(-100, 100, size=(len(MARKERS) - N_FACE, 3))
    return x


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (a_cloud, "no face is found among the points"),
        pytest.param(another_hand, "the points fit no hand of a cuer", marks=pytest.mark.slow),
        (lambda: seen("agathe")[:, :N_FACE], "the points fit no hand of a cuer"),
        (lambda: seen("agathe")[:, :30], "30 points are seen for long enough, 40 needed"),
    ],
)
def test_what_is_no_cuer_is_refused(points: object, message: str) -> None:
    assert callable(points)
    with pytest.raises(CueError, match=message):
        propose_map(recording(points()), VOICE)


def test_a_scaled_body_is_laid_on_itself() -> None:
    rng = np.random.default_rng(2)
    body = rng.normal(scale=60.0, size=(30, 3))
    away = rigid.rigid_motion(body, [1.0, -2.0, 0.5, 300.0, 0.0, -50.0])[::-1] * 0.001
    fit = lay(away, [body + 500.0, body], spread_turns(60), free_scale=True)[0]
    assert fit.scale == pytest.approx(1000.0)
    np.testing.assert_allclose(
        np.sort(fit.apply(away)),
        np.sort((body + (500.0 if fit.template == 0 else 0.0))[::-1]),
        atol=1e-6,
    )


def test_a_proposed_map_serves_a_capture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    x = seen("agathe")
    labels = tuple(f"U{n}x" for n in range(len(MARKERS)))
    take, table, out = (str(tmp_path / name) for name in ("t.trc", "m.csv", "m.npz"))
    Path(take).write_text(files.trc(x, labels), encoding="utf-8")
    assert main(["capture", take, "--no-keys", "-o", out]) == 3
    assert "give --map or --propose-map" in capsys.readouterr().err
    assert main(["capture", take, "--no-keys", "-o", out, "--propose-map", table]) == 0
    said = capsys.readouterr().err
    found = read_map(table)
    assert f"{len(found)} of 113 labels are sure, {113 - len(found)} left out, 0 were known" in said
    assert len(found) > 95
    assert all(marker == MARKERS[int(label[1:-1])] for label, marker in found.items())
    assert f"{len(found)} of 113 markers" in said


def test_a_map_is_proposed_for_markers_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film = tmp_path / "film.mp4"
    film.write_bytes(b"\0\0\0\x18ftypmp42" + bytes(100))
    argv = ["capture", str(film), "--propose-map", str(tmp_path / "m.csv")]
    assert main(argv) == 3
    assert "a map is proposed for markers, this is video" in capsys.readouterr().err
    assert not (tmp_path / "m.csv").exists()
    assert main(["capture", "--propose-map", str(tmp_path / "m.csv")]) == 2


@pytest.mark.parametrize("name", ["m.csv", "m.json"])
def test_a_map_is_read_as_it_was_written(tmp_path: Path, name: str) -> None:
    pairs = {"left, ear": "EAR_L", 'a "b"': "FH0"}
    write_map(tmp_path / name, pairs, unsure=[("c", "NB", 0.5)])
    assert read_map(tmp_path / name) == pairs


def test_a_label_that_would_be_a_comment(tmp_path: Path) -> None:
    with pytest.raises(CueError, match=r"'#1' would be a comment in CSV: name it \.json"):
        write_map(tmp_path / "m.csv", {"#1": "FH0"})
    write_map(tmp_path / "m.json", {"#1": "FH0"})
    assert read_map(tmp_path / "m.json") == {"#1": "FH0"}
