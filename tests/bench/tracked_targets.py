"""Whether an image tracker reads all 40 targets in small rendered pictures.

In: the interpreter of the tracker that ``cuecast capture`` uses. The avatar stands still at each
target, in films of several widths; parameters vary by ``--spread`` (standard deviation). Out: the
share of pictures with a hand, and of those whose landmarks are nearest to the same target's in the
widest film without variation. The tracker is the yardstick, not the renderer's own markers.
``--avatar`` takes an avatar of others.
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
FRAMES = 5
"""Pictures of each target; the tracker follows a hand, so the last one counts."""


def tracked(
    width: int, spread: float, tracker: str, folder: Path, own: bytes | None
) -> NDArray[np.float64]:
    """Return the landmarks of the hand (40, 21, 2), NaN where none was found."""
    voice = load_voice()
    avatar = load_avatar(voice) if own is None else read_avatar(own, voice)
    table = voice.gestures
    portrait, rng = Portrait(avatar, neutral_camera(voice)), np.random.default_rng(0)
    height = 2 * round(width / ASPECT / 2)
    pictures = []
    places = [i for i, name in enumerate(PLACEMENTS) if name != "rest"]
    for place, shape in product(places, range(1, 9)):
        params = np.concatenate([
            np.zeros(7), table.shape_targets[shape], table.neutral_head,
            table.placement_targets[shape, place],
        ])  # fmt: skip
        picture = np.full((height, width, 3), (90, 96, 110), np.uint8)
        portrait.draw(picture, avatar.place((params + rng.normal(0, spread, 31))[None])[0])
        pictures += [picture] * FRAMES
    film = folder / f"targets-{width}.mkv"
    write_film(film, None, pictures=pictures, crf=10)
    aspect = track(film, tracker, film.with_suffix(".csv"))
    hand = np.full((len(pictures), 21, 3), np.nan)
    seen = read_landmarks(film.with_suffix(".csv"))
    frames = np.rint(seen.times * 25).astype(int)
    for points in seen.hands.values():  # the tracker may take her right hand for a left one
        hand[frames] = np.where(np.isnan(points), hand[frames], points)
    return np.asarray(hand[FRAMES - 1 :: FRAMES, :, :2] * [aspect, 1.0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracker", required=True)
    parser.add_argument("--widths", default="300,160")
    parser.add_argument("--avatar", help=".avatar, .vrm or .glb")
    parser.add_argument("--spread", type=float, default=0.2)
    chosen = parser.parse_args()
    own = avatar_file(chosen.avatar, load_voice())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        models = tracked(WIDEST, 0.0, chosen.tracker, folder, own)
        for width in map(int, chosen.widths.split(",")):
            found = tracked(width, chosen.spread, chosen.tracker, folder, own)
            distance = np.linalg.norm(found[:, None] - models[None], axis=-1).mean(axis=-1)
            nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=1)
            seen = np.asarray(~np.isnan(found).any(axis=(1, 2)))
            right = seen & (nearest == np.arange(len(nearest)))
            print(f"{width} pixels: hand in {seen.sum()} of {seen.size}, key in {right.sum()}")


if __name__ == "__main__":
    main()
