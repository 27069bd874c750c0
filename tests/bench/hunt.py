"""After how long is a mark found that was altered, and that begins after other sound?

In: sound files and names of channels of `cuecast evaluate audio`; out: a line for each clip,
channel and length of unmarked sound before: when the first superframe was handed out, how many
came, and the processor time of hunting, of marked sound and of the dearest second, in FFmpeg's AAC
encodes of the same sound in the same run; at last a line for each channel and length. Run:
``python -m tests.bench.hunt --channels speed_25_24 --after 0 12 --store FOLDER CLIP ...``.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.sound_channels import encode, find_channel
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import FS, SUPERFRAME, find_profile

SOON_S = 15.0
"""Sound within which a mark is to be found, seconds."""

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


def payload_of(number: int) -> tuple[bytes, bytes]:
    """Return the superframe of a number: pseudorandom, so that a wrong one is noticed."""
    rng, chosen = np.random.default_rng([7, number]), find_profile("standard")
    return rng.bytes(chosen.l0_bytes), rng.bytes(chosen.l1_bytes)


def marked_of(path: Path, seconds: float, store: Path) -> Sound:
    """Return a marked clip, made once."""
    kept = store / f"{path.stem}-{seconds:g}.npy"
    if not kept.exists():
        x = sound_of(path, seconds)
        embedder = AudioEmbedder(
            FS,
            2,
            payload_of,
            profile="standard",
            rehearsal=make_rehearsal(find_profile("standard"), 0, None),
        )
        parts = [embedder.process(x[i : i + BLOCK]) for i in range(0, len(x), BLOCK)]
        store.mkdir(parents=True, exist_ok=True)
        np.save(kept, np.concatenate([*parts, embedder.flush()]))
    return np.asarray(np.load(kept))


def heard_of(path: Path, channel: str, seconds: float, store: Path) -> Sound:
    """Return a marked clip behind a channel, made once."""
    kept = store / f"{path.stem}-{seconds:g}-{channel}.npy"
    if not kept.exists():
        np.save(kept, find_channel(channel)(marked_of(path, seconds, store), FS))
    return np.asarray(np.load(kept), dtype=np.float32)


def hunt(clip: str, channel: str, before: Sound, heard: Sound, due: int) -> HuntRow:
    """Let a receiver hear unmarked sound, then a mark."""
    if heard.shape[1] == 1:
        before = before.mean(axis=1, keepdims=True)
    receiver = AudioReceiver(FS, heard.shape[1])
    numbers = {payload_of(k)[0]: k for k in range(due + 2)}
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


def summary(rows: list[HuntRow]) -> str:
    """Return what all rows together say, a line for each channel and length of sound before."""
    lines = []
    for channel in dict.fromkeys(row.channel for row in rows):
        for after_s in sorted({row.after_s for row in rows}):
            own = [row for row in rows if (row.channel, row.after_s) == (channel, after_s)]
            if not own:
                continue
            soon = sum(row.found_s is not None and row.found_s <= SOON_S for row in own)
            read = sorted(row.read for row in own)
            costs = [[getattr(row, name) for row in own] for name in ("hunting", "marked", "most")]
            hunting, marked, most = (f"{np.median(x):.2f} (at most {max(x):.2f})" for x in costs)
            lines.append(
                f"{channel:22} after {after_s:4.0f} s: {soon} of {len(own)} in {SOON_S:.0f} s, "
                f"read {read[0]} to {read[-1]}, median {np.median(read):g}; encodes: hunting "
                f"{hunting}, marked {marked}, dearest second {most}"
            )
    lines.append(
        f"{len(rows)} rows, {sum(row.wrong for row in rows)} wrong superframes, dearest second "
        f"{max(row.most for row in rows):.1f} encodes"
    )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="+", metavar="clip")
    parser.add_argument("--channels", nargs="+", default=["aac_128"], metavar="NAME")
    parser.add_argument("--after", type=float, nargs="+", default=[0.0], metavar="SECONDS")
    parser.add_argument("--seconds", type=float, default=24.0, help="marked sound")
    parser.add_argument("--other", type=Path, help="unmarked sound; otherwise the next clip")
    parser.add_argument("--store", type=Path, required=True, help="folder of marked clips")
    options = parser.parse_args()
    hunt("", "", sound_of(options.clips[0], 3.0), sound_of(options.clips[0], 1.0), 0)  # compiles
    due = round(options.seconds * FS) // SUPERFRAME
    rows = []
    for n, path in enumerate(options.clips):
        other = options.other or options.clips[(n + 1) % len(options.clips)]
        for channel in options.channels:
            heard = heard_of(path, channel, options.seconds, options.store)
            for after in options.after:
                before = sound_of(other, after)
                rows.append(hunt(path.stem, channel, before, heard, due))
                print(rows[-1], flush=True)
    print(summary(rows))


if __name__ == "__main__":
    main()
