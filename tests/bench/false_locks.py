"""Hours of unmarked sound to the receiver: how often does it believe to hear a superframe?

In: sound files, each played again and again at other speeds and paces, so that no passage comes
twice alike; out: a line of figures as the hours pass and one at the end. A new receiver takes over
from time to time. Run: ``python -m tests.bench.false_locks --minutes 40 --random 1000000``: ends
by itself after so much time, or after `--hours` of sound; ``--record FILE`` for the pages.
"""

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from cuecast.evaluate.records import make_record
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import FS, PROFILES, STANDARD
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.link import Link

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "audio"

SPEEDS, PACES = (0.7, 1.4), (0.8, 1.25)
"""Factors of pitch and pace together, and of pace alone."""

PIECE, OVERLAP, SLACK = 2400, 480, 480
"""Samples of a piece whose pace is kept, of its fade, and by which its start is adapted."""

TUNING_S = 300.0
"""Sound after which a new receiver takes over."""

SIDE = 0.5
"""Half the difference of both channels, another passage, beside their mean."""

SHORT_LIST, LONG_LIST = 8, 512
"""Paths of the decoder for random superframes."""

Sound = NDArray[np.float64]


@dataclass(slots=True)
class Heard:
    """What a receiver made of unmarked sound; superframes are those with a class accepted."""

    hours: float = 0.0
    locks: int = 0
    superframes: int = 0
    receivers: int = 0
    used_s: float = 0.0

    def __str__(self) -> str:
        return (
            f"{self.hours:.2f} h, {self.receivers} receivers, {self.locks} locks, "
            f"{self.superframes} superframes"
        )


def at_pace(x: Sound, pace: float) -> Sound:
    """Sound in another time at its old pitch, by overlapping pieces where they fit best.

    Source: synchronised overlap-add, Roucos and Wilgus, ICASSP 1985.
    """
    fade = np.linspace(0.0, 1.0, OVERLAP)
    out, at = [x[:PIECE]], 0.0
    end = PIECE
    while True:
        at += PIECE * pace
        start = int(at)
        if start + SLACK + PIECE + OVERLAP > x.size or end + OVERLAP > x.size:
            return np.concatenate(out)
        tail = x[end : end + OVERLAP]
        fit = np.correlate(x[start : start + SLACK + OVERLAP], tail, "valid")
        start += int(np.argmax(fit))
        piece = x[start : start + PIECE].copy()
        piece[:OVERLAP] = fade * piece[:OVERLAP] + (1 - fade) * tail
        out.append(piece)
        end = start + PIECE


def passages(paths: list[Path], rng: np.random.Generator) -> Iterator[Sound]:
    """Yield the mids of sounds, one after another without end, each time altered anew."""
    sounds = []
    for path in paths:
        sound, fs = soundfile.read(path, always_2d=True)
        sounds.append((sound.mean(axis=1), fs / FS))
    while True:
        for mid, ratio in sounds:
            paced, tape = at_pace(mid, rng.uniform(*PACES)), SampleBuffer()
            tape.append(paced)
            speed = ratio * rng.uniform(*SPEEDS)
            yield rng.uniform(0.3, 1.0) * tape.read(0.0, speed, int(paced.size / speed))


def listen(paths: list[Path], seed: int) -> Iterator[Heard]:
    """Let receivers hear it all as stereo; yield the figures so far after each passage."""
    heard, left = Heard(), 0
    sides = passages(paths, np.random.default_rng([seed, 1]))
    for mid in passages(paths, np.random.default_rng(seed)):
        side = SIDE * np.resize(next(sides), mid.size)
        sound = np.stack([mid + side, mid - side], axis=1).astype(np.float32)
        for i in range(0, len(sound), FS):
            if left <= 0:
                receiver, left = AudioReceiver(FS, 2), round(TUNING_S * FS)
                heard.receivers += 1
            left -= FS
            before, began = receiver.locked, time.process_time()
            found = receiver.process(sound[i : i + FS])
            heard.used_s += time.process_time() - began
            heard.superframes += sum(s.l0 is not None for s in found)
            heard.locks += bool(found) and not before
        heard.hours += len(sound) / FS / 3600
        yield heard


def decode_noise(count: int, seed: int) -> int:
    """Superframes of random ratios that the link accepts, one in a hundred with a long list."""
    link, rng = Link(STANDARD), np.random.default_rng(seed)
    noise = (rng.standard_normal(STANDARD.data_cells) for _ in range(count))
    lists = (LONG_LIST if n % 100 == 0 else SHORT_LIST for n in range(count))
    return sum(
        link.decode(one, list_size=paths).l0 is not None
        for one, paths in zip(noise, lists, strict=True)
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clips", type=Path, default=FOLDER, help="folder of FLAC files")
    parser.add_argument("--hours", type=float, default=10.0, help="of sound")
    parser.add_argument("--minutes", type=float, default=math.inf, help="of running")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--random", type=int, default=0, help="random superframes to decode first")
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    end, heard = time.monotonic() + 60 * options.minutes, Heard()
    paths = sorted(options.clips.glob("*.flac"))
    if not paths:
        parser.error(f"{options.clips}: no FLAC files in it")
    accepted = decode_noise(options.random, options.seed)
    print(f"profiles searched: {', '.join(PROFILES)}", flush=True)
    for heard in listen(paths, options.seed):
        print(heard, flush=True)
        if heard.hours >= options.hours or time.monotonic() >= end:
            break
    print(f"END: {options.random} random superframes, {accepted} accepted; unmarked sound: {heard}")
    if options.record:
        row = {
            "carrier": "sound", "hours": round(heard.hours, 2), "accepted": heard.superframes,
            "times_real_time": round(3600 * heard.hours / heard.used_s, 1),
            "random": options.random, "random_accepted": accepted,
        }  # fmt: skip
        document = make_record("false_locks", (), [row], seed=options.seed, clips=options.clips)
        document["command"] = (
            f"python -m tests.bench.false_locks --clips CLIPS --hours {options.hours:g} "
            f"--random {options.random} --seed {options.seed} --record FILE"
        )
        options.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
