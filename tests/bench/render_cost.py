"""What drawing a film of the avatar costs, as a multiple of real time on one core.

In: a motion that moves everything at once, or a file. Out: processor time of drawing and of the
whole film (620x720, 25 pictures a second, H.264) over the film's length, the least of several
rounds; a first picture is drawn before, which loads the compiled code.
``python -m tests.bench.render_cost [--motion M.npz] [--seconds 4] [--size 620x720]``
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from codec.cuer.motion import load_motion
from codec.cuer.voice import load_voice
from cuecast.command.arguments import size
from cuecast.media.cuer_film import render_motion
from receiver.drawing.render import DEFAULT_SIZE, draw
from tests.receiver.standin import make_motion

FPS = 25


def least_s(work: Callable[[], None], rounds: int) -> float:
    """Return the least processor time of some rounds, seconds."""
    found = []
    for _ in range(rounds):
        begun = time.process_time()
        work()
        found.append(time.process_time() - begun)
    return min(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motion", type=Path)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--size", type=size, default=DEFAULT_SIZE)
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    voice = load_voice()
    motion = load_motion(chosen.motion) if chosen.motion else make_motion(voice, chosen.seconds)
    frames = round(chosen.seconds * motion.rate_hz)
    motion = replace(motion, params=motion.params[:frames])
    times = motion.start_s + np.arange(round(chosen.seconds * FPS)) / FPS

    def pictures() -> None:
        for _ in draw(motion, voice, times, style="avatar", size=chosen.size):
            pass

    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film.mp4"

        def whole() -> None:
            render_motion(motion, voice, film, style="avatar", size=chosen.size, fps=FPS)

        next(iter(draw(motion, voice, times[:1], style="avatar", size=chosen.size)))
        for name, work in (("drawing", pictures), ("film", whole)):
            share = least_s(work, chosen.rounds) / chosen.seconds
            print(f"{name}: {share:.2f} s of processor a second, {1 / share:.2f} times real time")
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
