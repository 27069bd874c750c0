"""A day of mixed sound to one receiver: what does it spend in a second, and in its dearest one?

In: sound files, a folder for marked ones; out: a line of figures as the hours pass. Passages that
are not marked, altered anew each time (`tests.bench.false_locks`), and marked ones behind channels
of ``cuecast evaluate audio`` (`tests.bench.hunt`) follow one another, drawn at random; a set hears
them all and is never switched off. Run: ``python -m tests.bench.day_of_sound --hours 24 --channels
night_mode speed_25_24 --store FOLDER CLIP ...``; ``--record FILE`` for the pages.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from cuecast.evaluate.records import make_record
from cuecast.evaluate.sound_channels import encode
from tests.bench.false_locks import SIDE, passages
from tests.bench.hunt import heard_of, payload_of
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import FS, SUPERFRAME

MARKED_S = 24.0
"""Marked sound of a passage, seconds."""

MARKED_PART = 0.3
"""Probability that the next passage is a marked one."""

WARM_UP_S = 60
"""Sound that compiles what others run, and is not counted."""

ENCODES = 20
"""Passages that are also encoded, for the unit of cost."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="clip")
    parser.add_argument("--channels", nargs="+", required=True, metavar="NAME")
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--store", type=Path, required=True, help="folder of marked clips")
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    mids, sides = (
        passages(options.clips, np.random.default_rng([options.seed, n])) for n in (0, 1)
    )
    costs: list[float] = []
    encodes: list[float] = []
    receiver, count = AudioReceiver(FS, 2), round(MARKED_S * FS) // SUPERFRAME
    # A slower passage has more; the last may be read though its end is missing.
    payloads = [payload_of(k, options.seed)[0] for k in range(count + 2)]
    due = read = wrong = 0
    while len(costs) < 3600 * options.hours + WARM_UP_S:
        if rng.random() < MARKED_PART:
            path, channel = (
                options.clips[rng.integers(len(options.clips))],
                rng.choice(options.channels),
            )
            sound = heard_of(path, str(channel), MARKED_S, options.store, options.seed)
            sound = np.repeat(sound, 2, axis=1) if sound.shape[1] == 1 else sound
            due += count
        else:
            mid = next(mids)
            side = SIDE * np.resize(next(sides), mid.size)
            sound = np.stack([mid + side, mid - side], axis=1).astype(np.float32)
        for i in range(0, len(sound) - FS + 1, FS):
            began = time.process_time()
            found = receiver.process(sound[i : i + FS])
            costs.append(time.process_time() - began)
            accepted = [superframe.l0 for superframe in found if superframe.l0 is not None]
            read += sum(l0 in payloads for l0 in accepted)
            wrong += sum(l0 not in payloads for l0 in accepted)
        if len(encodes) < ENCODES:
            began = time.process_time()
            encode(sound, FS, codec="aac", bit_rate=128_000)
            encodes.append((time.process_time() - began) * FS / len(sound))
        if len(costs) % 3600 < len(sound) / FS:
            print(figures_of(costs, encodes), f"{read} of {due} read, {wrong} wrong", flush=True)
    row = {**figures_of(costs, encodes), "due": due, "read": read, "wrong": wrong}
    print(row)
    if options.record:
        folders = [each.parent for each in options.clips]
        document = make_record("day_of_sound", (), [row], seed=options.seed, clips=folders)
        document["command"] = (
            f"python -m tests.bench.day_of_sound CLIPS --channels {' '.join(options.channels)} "
            f"--hours {options.hours:g} --seed {options.seed} --store FOLDER --record FILE"
        )
        options.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def figures_of(costs: list[float], encodes: list[float]) -> dict[str, float]:
    """Return hours, and the cost of a second in encodes: mean, by parts of all, at most."""
    counted = np.array(costs[WARM_UP_S:] or [0.0]) / float(np.median(encodes))
    return {
        "hours": round(len(counted) / 3600, 2),
        "mean": round(float(counted.mean()), 2),
        "of_1000": round(float(np.quantile(counted, 0.999)), 1),
        "most": round(float(counted.max()), 1),
        "encode_ms": round(1e3 * float(np.median(encodes)), 1),
    }


if __name__ == "__main__":
    main()
