"""Corpora of a second virtual cuer as files: hand alone, face alone, both."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS, N_FACE
from codec.cues.score import Score
from synth.motion.measured.cuer import MeasuredCuer
from synth.motion.measured.plan import paced
from synth.planning.scoring.drills import isolated_sounds, shape_transitions
from synth.planning.scoring.textgrid import write_textgrid
from synth.studio.recital import recital, sentences

HAND = range(N_FACE, len(MARKERS))
FACE = range(N_FACE)
BOTH = range(len(MARKERS))


def write_points(
    path: Path, markers: NDArray[np.float64], rate_hz: float, keep: Iterable[int], unit: str = "mm"
) -> None:
    """Write some of the markers (T, 113, 3) as a C3D file."""
    import ezc3d

    kept = list(keep)
    points = np.ones((4, len(kept), len(markers)))
    points[:3] = np.nan_to_num(markers[:, kept]).transpose(2, 1, 0)
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    file["parameters"]["POINT"]["LABELS"]["value"] = [MARKERS[number] for number in kept]
    file["data"]["points"] = points
    file.write(str(path))


def write_take(
    stem: Path, cuer: MeasuredCuer, score: Score, keep: Iterable[int], *, seed: int = 0
) -> None:
    """Write the C3D and the TextGrid of a performance, with noise and hidden markers."""
    rng = np.random.default_rng(seed)
    last = max([0.0, *(p.end for p in score.phones), *(k.end for k in score.keys)])
    markers = cuer.markers(score, 0.0, int((last + 1.5) * cuer.rate_hz)).astype(np.float64)
    markers += 0.2 * rng.normal(size=markers.shape)
    markers[rng.random(markers.shape[:2]) < 0.002] = np.nan
    stem.parent.mkdir(parents=True, exist_ok=True)
    write_points(stem.with_suffix(".c3d"), markers, cuer.rate_hz, keep)
    write_textgrid(stem.with_suffix(".TextGrid"), score, len(markers) / cuer.rate_hz)


def write_corpora(folder: Path, *, count: int, rate_hz: float = 60.0) -> None:
    """Write the paper's three corpora as solange performs them, `count` sentences of them."""
    free = MeasuredCuer("solange", rate_hz=rate_hz, seed=1, free_space=True)
    write_take(folder / "hand" / "shapes", free, shape_transitions(rounds=2), HAND)
    still = MeasuredCuer("solange", rate_hz=rate_hz, seed=2)
    write_take(folder / "face" / "sounds", still, isolated_sounds(), FACE)
    for number in range(0, count, 6):
        said = paced(recital(sentences()[number : number + 6], seed=number))
        cuer = MeasuredCuer("solange", rate_hz=rate_hz, seed=3 + number)
        write_take(folder / "both" / f"s{number:03d}", cuer, said, BOTH, seed=number)
