"""After how long is a mark found that was altered, and that begins after other sound?

In: sound files and names of channels of `cuecast evaluate audio`; out: a line for each clip,
channel and length of unmarked sound before: when the first superframe was handed out, how many
came, and the processor time of hunting, of marked sound and of the dearest second, in FFmpeg's AAC
encodes of the same sound in the same run; at last a line for each channel and length. Run:
``python -m tests.bench.hunt --channels speed_25_24 --after 0 12 --store FOLDER CLIP ...``;
with ``--rows N --seed S`` for N cells of that table drawn at random, ``--record FILE`` for pages.
"""

import argparse
import json
import time
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.records import make_record
from cuecast.evaluate.sound_channels import encode, find_channel
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import FS, SUPERFRAME, find_profile

SOON_S = 15.0
"""Sound within which a mark is to be found, seconds."""

WARM_UP_S = 12.0
"""Unmarked sound of the row before all others, which compiles what they run and is not counted."""

BLOCK = 4800
"""Samples handed over at once."""

Sound = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class HuntRow:
    """What a receiver made of a mark after other sound.

    Attributes
    ----------
    clip, channel : str
        What was heard.
    after_s : float
        Unmarked sound before it.
    found_s : float or None
        Sound from the mark's first sample to the first superframe handed out.
    read, due, wrong : int
        Superframes with their first class, those that were sent, and others that were accepted.
    hunting, marked, most : float
        Processor time of a second of unmarked sound, of marked sound, and of the dearest second, in
        encodes of a second of all this sound.
    encode_ms : float
        Processor time of such an encode.
    untried : int
        Attempts that the receiver left out for their cost.
    """

    clip: str
    channel: str
    after_s: float
    found_s: float | None
    read: int
    due: int
    wrong: int
    hunting: float
    marked: float
    most: float
    encode_ms: float
    untried: int

    def __str__(self) -> str:
        found = "  never" if self.found_s is None else f"{self.found_s:5.1f} s"
        return (
            f"{self.clip:20.20} {self.channel:22} after {self.after_s:4.0f} s: {found}, "
            f"{self.read:2} of {self.due}, {self.wrong} wrong, "
            f"{self.hunting:5.2f} {self.marked:5.2f} {self.most:5.1f} encodes "
            f"of {self.encode_ms:.1f} ms/s, {self.untried} untried"
        )


def sound_of(path: Path, seconds: float) -> Sound:
    """Return the first seconds of a file as two channels, repeated if it is shorter."""
    x, fs = soundfile.read(path, dtype="float32", always_2d=True)
    if fs != FS:
        raise SystemExit(f"{path}: {fs} Hz, must be {FS}")
    count = round(seconds * FS)
    x = np.tile(x, (-(-count // len(x)), 1))[:count]
    return np.repeat(x, 2, axis=1) if x.shape[1] == 1 else x[:, :2]


def payload_of(number: int, seed: int = 0) -> tuple[bytes, bytes]:
    """Return the superframe of a number: pseudorandom, so that a wrong one is noticed."""
    rng, chosen = np.random.default_rng([7 + seed, number]), find_profile("standard")
    return rng.bytes(chosen.l0_bytes), rng.bytes(chosen.l1_bytes)


def marked_of(path: Path, seconds: float, store: Path, seed: int = 0) -> Sound:
    """Return a marked clip, made once for each seed of its payload."""
    kept = store / f"{path.stem}-{seconds:g}-{seed}.npy"
    if not kept.exists():
        x = sound_of(path, seconds)
        embedder = AudioEmbedder(
            FS,
            2,
            partial(payload_of, seed=seed),
            profile="standard",
            rehearsal=make_rehearsal(find_profile("standard"), 0, None),
        )
        parts = [embedder.process(x[i : i + BLOCK]) for i in range(0, len(x), BLOCK)]
        store.mkdir(parents=True, exist_ok=True)
        np.save(kept, np.concatenate([*parts, embedder.flush()]))
    return np.asarray(np.load(kept))


def heard_of(path: Path, channel: str, seconds: float, store: Path, seed: int = 0) -> Sound:
    """Return a marked clip behind a channel, made once."""
    kept = store / f"{path.stem}-{seconds:g}-{seed}-{channel}.npy"
    if not kept.exists():
        np.save(kept, find_channel(channel)(marked_of(path, seconds, store, seed), FS))
    return np.asarray(np.load(kept), dtype=np.float32)


def hunt(clip: str, channel: str, before: Sound, heard: Sound, due: int, seed: int = 0) -> HuntRow:
    """Let a receiver hear unmarked sound, then a mark."""
    if heard.shape[1] == 1:
        before = before.mean(axis=1, keepdims=True)
    receiver = AudioReceiver(FS, heard.shape[1])
    numbers = {payload_of(k, seed)[0]: k for k in range(due + 2)}
    sound, found_s = np.concatenate([before, heard]), None
    got: set[int] = set()
    wrong, costs = 0, []
    for i in range(0, len(sound), BLOCK):
        begin = time.process_time()
        found = receiver.process(sound[i : i + BLOCK])
        costs.append(time.process_time() - begin)
        for superframe in found:
            if superframe.l0 in numbers:
                got.add(numbers[superframe.l0])
            wrong += superframe.l0 is not None and superframe.l0 not in numbers
        if got and found_s is None:
            found_s = (i + BLOCK - len(before)) / FS
    got |= {numbers[s.l0] for s in receiver.flush() if s.l0 in numbers}
    cut, second = len(before) // BLOCK, FS // BLOCK
    seconds = np.array(costs[: len(costs) // second * second]).reshape(-1, second).sum(axis=1)
    begin = time.process_time()
    encode(sound, FS, codec="aac", bit_rate=128_000)
    one = (time.process_time() - begin) * FS / len(sound)
    return HuntRow(
        clip, channel, len(before) / FS, found_s, len(got), due, wrong,
        second * float(np.mean(costs[:cut])) / one if cut else 0.0,
        second * float(np.mean(costs[cut:])) / one, float(seconds.max()) / one, 1e3 * one,
        receiver.untried,
    )  # fmt: skip


def cells_of(rows: list[HuntRow]) -> list[dict[str, Any]]:
    """Return figures for each channel and length of sound before, and for all rows together."""
    names = dict.fromkeys(row.channel for row in rows)
    kinds: list[tuple[str, float | None]] = [
        *product(names, sorted({row.after_s for row in rows})),
        *((name, None) for name in names),
        ("all", None),
    ]
    cells = []
    for channel, after_s in kinds:
        own = [
            row for row in rows
            if channel in (row.channel, "all") and after_s in (row.after_s, None)
        ]  # fmt: skip
        if not own:
            continue
        times = sorted(SOON_S * 9 if row.found_s is None else row.found_s for row in own)
        cell: dict[str, Any] = {
            "of": "channel" if after_s is None else "cell",
            "channel": channel,
            "after_s": after_s,
            "rows": len(own),
            "soon_s": SOON_S,
            "soon": sum(time <= SOON_S for time in times),
            "found_median_s": round(times[len(times) // 2], 1),
            "read_least": min(row.read for row in own),
            "read_median": float(np.median([row.read for row in own])),
            "read": sum(row.read for row in own),
            "due": sum(row.due for row in own),
            "wrong": sum(row.wrong for row in own),
        }
        for name in ("hunting", "marked", "most"):
            spent = [getattr(row, name) for row in own if name != "hunting" or row.after_s]
            if spent:
                cell[f"{name}_median"] = round(float(np.median(spent)), 2)
                cell[f"{name}_most"] = round(max(spent), 2)
        cells.append(cell)
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="clip")
    parser.add_argument("--channels", nargs="+", default=["aac_128"], metavar="NAME")
    parser.add_argument("--after", type=float, nargs="+", default=[0.0], metavar="SECONDS")
    parser.add_argument("--seconds", type=float, default=24.0, help="marked sound")
    parser.add_argument("--other", type=Path, help="unmarked sound; otherwise the next clip")
    parser.add_argument("--rows", type=int, help="draw so many cells of clip, channel and length")
    parser.add_argument("--seed", type=int, default=0, help="of the payload and of what is drawn")
    parser.add_argument("--store", type=Path, required=True, help="folder of marked clips")
    parser.add_argument("--record", type=Path)
    options = parser.parse_args()
    due = round(options.seconds * FS) // SUPERFRAME
    cells = list(product(range(len(options.clips)), options.channels, options.after))
    if options.rows is not None:
        rng = np.random.default_rng(options.seed)
        drawn = rng.choice(len(cells), min(options.rows, len(cells)), replace=False)
        cells = [cells[i] for i in sorted(drawn)]
    rows = []
    for n, channel, after in [(*cells[0][:2], WARM_UP_S), *cells]:
        path, clips = options.clips[n], options.clips
        other = options.other or clips[(n + 1) % len(clips)]
        heard = heard_of(path, channel, options.seconds, options.store, options.seed)
        before = sound_of(other, after)
        rows.append(hunt(path.stem, channel, before, heard, due, options.seed))
        if len(rows) > 1:
            print(rows[-1], flush=True)
    rows = rows[1:]
    figures = cells_of(rows)
    for cell in figures:
        print(", ".join(f"{name} {value}" for name, value in cell.items() if value is not None))
    if options.record:
        listed = [{"of": "row", **asdict(row)} for row in rows]
        document = make_record(
            "hunt", (), [*figures, *listed], seed=options.seed, clips=options.clips[0].parent
        )
        drawn_words = f" --rows {options.rows}" if options.rows is not None else ""
        document["command"] = (
            f"python -m tests.bench.hunt CLIPS --channels {' '.join(options.channels)} --after "
            f"{' '.join(f'{s:g}' for s in options.after)}{drawn_words} --seed {options.seed} "
            "--store FOLDER --record FILE"
        )
        options.record.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
