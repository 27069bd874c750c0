"""How many keys of a moving cuer the project's reader sees in small rendered pictures, by pace.

In: a folder of real cuers (``--clips``) and the interpreter of an image tracker. The reader of
`cuecast evaluate reader` is taught on these real cuers alone and gets used to each film without a
transcript; the sentences are held out. Each pace is read from the film and, as a bound, from the
joints of the same performance with a tracker's usual noise. Out: one line each.
``CUECAST_TRACKER=PYTHON python -m tests.bench.moving_film --clips FOLDER [--paces 4,3,2]``
"""

import argparse
import tempfile
from pathlib import Path

from codec.cuer.voice import load_voice
from cuecast.evaluate.reader import Count, compared
from cuecast.evaluate.reading.lips import teach_lips
from cuecast.evaluate.reading.performed import filmed_takes, simulated_takes
from cuecast.evaluate.reading.reader import teach
from cuecast.evaluate.reading.takes import real_takes
from receiver.drawing.camera import ASPECT
from synth.capture.tracker.video import find_tracker
from synth.planning.prosody.pacing import Pace
from synth.planning.scoring.text_score import Reading, score_of_text
from synth.studio.recital import sentences


def line(name: str, pace: float, seconds: float, count: Count) -> str:
    """Return the shares of a test set in one line."""
    places, shapes = (int(table[1:, 1:].trace()) for table in (count.places, count.shapes))
    return (
        f"{name} at {pace:g} keys/s: {count.asked} keys in {seconds:.0f} s, recall"
        f" {count.keys / count.asked:.3f}, precision {count.keys / count.read:.3f},"
        f" shapes {shapes / count.asked:.3f}, placements {places / count.asked:.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clips", type=Path, required=True)
    parser.add_argument("--paces", default="4,3,2", help="keys per second")
    parser.add_argument("--width", type=int, default=300, help="of the pictures, pixels")
    parser.add_argument("--sentences", type=int, default=8)
    chosen = parser.parse_args()
    voice, tracker = load_voice(), find_tracker(None)
    if tracker is None:
        parser.error("no image tracker: set CUECAST_TRACKER")
    real = real_takes(chosen.clips, voice)
    reader = teach(real)
    lips = teach_lips(real, reader)
    size = chosen.width, 2 * round(chosen.width / ASPECT / 2)
    texts = sentences(held_out=True)[: chosen.sentences]
    for pace in map(float, chosen.paces.split(",")):
        slow = Reading(pace=Pace(keys_per_s=pace))
        scores = [score_of_text(text, start_s=1.0, reading=slow) for text in texts]
        seconds = sum(score.phones[-1].end - 1 for score in scores)
        with tempfile.TemporaryDirectory() as folder:
            films = filmed_takes(voice, scores, tracker=tracker, folder=Path(folder), size=size)
        for name, takes in (
            (f"film, {chosen.width} pixels", films),
            ("joints", simulated_takes(f"{voice.name}/minimum-jerk", scores)),
        ):
            print(line(name, pace, seconds, compared(takes, real, reader, lips)), flush=True)


if __name__ == "__main__":
    main()
