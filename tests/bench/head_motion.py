"""How far the head of the avatar moves while she cues, beside real cuers.

In: a folder of real cuers (``--clips``). Out: spans from 5 to 95 % within a take (median of takes)
of the head's roll (degrees) and of its shift sideways and upwards (widths of the head).
``python -m tests.bench.head_motion --clips FOLDER [--sentences 6]``
"""

import argparse
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS
from codec.cuer.models.rigid import rigid_motion
from codec.cuer.motion import sample_params
from codec.cuer.voice import Voice, load_voice
from cuecast.evaluate.reading.takes import ARCHIVE
from receiver.drawing.avatar import load_avatar
from receiver.drawing.movement import express, lean
from receiver.drawing.skeleton import solve
from synth.motion.measured.cuer import performer
from synth.planning.prosody.pacing import READABLE
from synth.planning.scoring.text_score import Reading, score_of_text
from synth.studio.recital import sentences

FILM_HZ = 25.0
"""Pictures per second at which the avatar is looked at."""

ASPECT = 16 / 9
"""Width over height of the real films."""


def spans(ears: NDArray[np.float64]) -> list[float]:
    """Return the spans of one take: right and left ear (T, 2, 2), x right and y up."""
    across, middle = ears[:, 1] - ears[:, 0], ears.mean(axis=1)
    width = np.median(np.linalg.norm(across, axis=1))
    roll = np.degrees(np.arctan2(across[:, 1], across[:, 0]))
    of = np.column_stack([roll, middle / width])
    most, least = np.quantile(of, [0.95, 0.05], axis=0)
    found: list[float] = (most - least).tolist()
    return found


def real(folder: Path) -> Iterable[list[float]]:
    """Yield the spans of real cuers."""
    with np.load(folder / ARCHIVE) as archive:
        titles = [str(title).split("_") for title in archive["columns"]]
        columns = [
            next(i for i, (part, at) in enumerate(titles) if part == "face" and at == f"{axis}{n}")
            for n in (234, 454)
            for axis in "xy"
        ]
        for name in archive.files:
            if f"{name}.frames" in archive.files:
                points = archive[name][:, columns].astype(float)
                seen = points[(points > -32768).all(axis=1)] / 20000
                yield spans(seen.reshape(-1, 2, 2) * [ASPECT, -1.0])


def drawn(voice: Voice, count: int) -> Iterable[list[float]]:
    """Yield the spans of the avatar in held-out sentences."""
    avatar, pivot = load_avatar(voice), voice.face.pivot
    ears = voice.face.mean[[MARKERS.index(name) for name in ("EAR_R", "EAR_L")]] - pivot
    for seed, text in enumerate(sentences(held_out=True)[:count]):
        score = score_of_text(text, start_s=1.0, reading=Reading(pace=READABLE))
        seconds = score.phones[-1].end + 1
        actor = performer(voice.name, "minimum-jerk", rate_hz=50.0, seed=seed)
        sample = partial(sample_params, actor.motion(score, 0.0, round(50 * seconds), voice))
        times = np.arange(0, seconds, 1 / FILM_HZ)
        added = express(voice, sample, times)
        head = solve(avatar.skeleton, voice, sample(times).astype(float), added).head
        places = rigid_motion(np.repeat(ears[None], len(times), axis=0), head) + pivot
        lean(places, added.trunk, pivot)
        yield spans(places[..., :2])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", type=Path, required=True)
    parser.add_argument("--sentences", type=int, default=6)
    chosen = parser.parse_args()
    for name, takes in (
        ("real", list(real(chosen.clips))),
        ("avatar", list(drawn(load_voice(), chosen.sentences))),
    ):
        quarter, middle, most = np.quantile(takes, [0.25, 0.5, 0.75], axis=0).round(3)
        print(f"{name}: {len(takes)} takes, roll {middle[0]} degrees, sideways {middle[1]}, up")
        print(f"  {middle[2]}; quartiles {quarter.tolist()}, {most.tolist()}")


if __name__ == "__main__":
    main()
