"""Whether an image tracker reads all 40 targets in small rendered pictures.

In: the interpreter of the tracker that ``cuecast capture`` uses. The avatar stands still at each
target, in films of several widths; parameters vary by ``--spread`` (standard deviation). Out: the
share of pictures with a hand, and of those whose landmarks are nearest to the same target's in the
widest film without variation. The tracker is the yardstick, not the renderer's own markers.
``--avatar`` takes an avatar of others. With ``--clips``, a folder of real cuers, the reader of
`cuecast evaluate reader` reads the targets too: taught on these cuers alone, and used to the film.
``python -m tests.bench.tracked_targets --tracker PYTHON [--widths 300,160] [--spread 0.2]``
"""

import argparse
import tempfile
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENTS
from cuecast.evaluate.reading.reader import CueReader, teach
from cuecast.evaluate.reading.takes import real_takes, seen_in
from cuecast.evaluate.reading.view import RATE_HZ, TakeView
from cuecast.media.avatars import avatar_file
from cuecast.media.film import write_film
from receiver.drawing.avatar import load_avatar
from receiver.drawing.avatar_document import read_avatar
from receiver.drawing.camera import ASPECT
from receiver.drawing.portrait import Portrait
from receiver.drawing.voice_document import neutral_camera
from synth.capture.sources.landmark_table import read_landmarks
from synth.capture.tracker.video import track

WIDEST = 620
FRAMES = 12
"""Pictures of each target; the tracker follows a hand, so the last one counts."""

FILM_HZ = 25
"""Pictures per second."""

TARGETS = tuple(product((i for i, name in enumerate(PLACEMENTS) if name != "rest"), range(1, 9)))
"""Placement and shape of each target."""


def tracked(
    width: int, spread: float, tracker: str, folder: Path, own: bytes | None
) -> tuple[NDArray[np.float64], TakeView]:
    """Return the landmarks of the hand (40, 21, 2), NaN where none was found, and the view."""
    voice = load_voice()
    avatar = load_avatar(voice) if own is None else read_avatar(own, voice)
    table = voice.gestures
    portrait, rng = Portrait(avatar, neutral_camera(voice)), np.random.default_rng(0)
    height = 2 * round(width / ASPECT / 2)
    pictures = []
    for place, shape in TARGETS:
        params = np.concatenate(
            [
                np.zeros(7),
                table.shape_targets[shape],
                table.neutral_head,
                table.placement_targets[shape, place],
            ]
        )
        picture = np.full((height, width, 3), (90, 96, 110), np.uint8)
        portrait.draw(picture, avatar.place((params + rng.normal(0, spread, 31))[None])[0])
        pictures += [picture] * FRAMES
    film = folder / f"targets-{width}.mkv"
    write_film(film, None, pictures=pictures, crf=10)
    aspect = track(film, tracker, film.with_suffix(".csv"))
    hand = np.full((len(pictures), 21, 3), np.nan)
    seen = read_landmarks(film.with_suffix(".csv"))
    frames = np.rint(seen.times * FILM_HZ).astype(int)
    for points in seen.hands.values():  # the tracker may take her right hand for a left one
        hand[frames] = np.where(np.isnan(points), hand[frames], points)
    return hand[FRAMES - 1 :: FRAMES, :, :2] * [aspect, 1.0], seen_in(seen, aspect)


def read(reader: CueReader, seen: TakeView) -> str:
    """Return how many targets a reader takes for what they are, and the others."""
    density, _, _ = reader.densities(seen)
    wrong = []
    for number, (place, shape) in enumerate(TARGETS):
        begin, end = (int((number + part) * FRAMES / FILM_HZ * RATE_HZ) for part in (0.45, 0.85))
        mean = density[begin : end + 1].mean(axis=0)
        found = np.unravel_index(mean.argmax(), mean.shape)
        if not seen.shown[begin : end + 1].any() or found != (shape - 1, place - 1):
            wrong.append(f"{PLACEMENTS[place]} {shape}")
    return f"{len(TARGETS) - len(wrong)} of {len(TARGETS)} (wrong: {', '.join(wrong) or 'none'})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", required=True)
    parser.add_argument("--widths", default="300,160")
    parser.add_argument("--avatar", help=".avatar, .vrm or .glb")
    parser.add_argument("--spread", type=float, default=0.2)
    parser.add_argument("--clips", type=Path)
    chosen = parser.parse_args()
    own = avatar_file(chosen.avatar, load_voice())
    reader = teach(real_takes(chosen.clips, load_voice())) if chosen.clips else None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        models, _ = tracked(WIDEST, 0.0, chosen.tracker, folder, own)
        for width in map(int, chosen.widths.split(",")):
            found, view = tracked(width, chosen.spread, chosen.tracker, folder, own)
            distance = np.linalg.norm(found[:, None] - models[None], axis=-1).mean(axis=-1)
            nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=1)
            seen = np.asarray(~np.isnan(found).any(axis=(1, 2)))
            right = seen & (nearest == np.arange(len(nearest)))
            print(f"{width} pixels: hand in {seen.sum()} of {seen.size}, key in {right.sum()}")
            if reader is not None:
                print(f"  reader: {read(reader, view)}, used: {read(reader.used_to([view]), view)}")


if __name__ == "__main__":
    main()
