"""Hours of marked sound without a break: memory, losses, clocks that are not the studio's.

In: a sound file, played again and again; out: lines of figures as the hours pass, for the receiver
or, with ``--embed``, for the embedder. Linux only. Run:
``python tests/bench/long_sound.py --ppm 100``.
"""

import argparse
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.sound_channels import find_channel
from tests.bench.false_locks import FOLDER
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import FS, SUPERFRAME, find_profile
from watermark.audio.signal.sample_buffer import SampleBuffer

Sound = NDArray[np.float32]

TOLD_S = 600
"""Seconds of sound between two lines."""


def resident_mb() -> float:
    """Return the memory that this process has now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


def rounds(x: Sound) -> Iterator[Sound]:
    """Yield a sound without end, in blocks of a second, on one clock."""
    while True:
        for i in range(0, len(x), FS):
            yield x[i : i + FS]


def at_clock(blocks: Iterator[Sound], ppm: float) -> Iterator[Sound]:
    """Play blocks on a clock that runs `ppm` fast."""
    ratio, tapes, position = 1 + ppm * 1e-6, [SampleBuffer(), SampleBuffer()], 0.0
    for block in blocks:
        for tape, channel in zip(tapes, block.T, strict=True):
            tape.append(channel.astype(np.float64))
        count = int((tapes[0].end - tapes[0].reach(ratio) - position) / ratio)
        if count > 0:
            parts = [tape.read(position, ratio, count) for tape in tapes]
            position += count * ratio
            for tape in tapes:
                tape.forget(int(position) - 2 * tape.reach(ratio))
            yield np.stack(parts, axis=1).astype(np.float32)


def loop_of(path: Path, profile: str, channel: str) -> Sound:
    """Mark a sound that fits to itself: a whole number of superframes, its second round."""
    x, fs = soundfile.read(path, dtype="float32", always_2d=True)
    if fs != FS:
        raise SystemExit(f"{path}: must be at {FS} Hz")
    x = np.repeat(x, 2, axis=1) if x.shape[1] == 1 else x
    count = len(x) // SUPERFRAME
    chosen = find_profile(profile)

    def payload(k: int) -> tuple[bytes, bytes]:
        number = (k % count).to_bytes(2, "big")
        return number.ljust(chosen.l0_bytes, b"\0"), bytes(chosen.l1_bytes)

    embedder = AudioEmbedder(FS, 2, payload, profile=profile)
    twice = np.tile(x[: count * SUPERFRAME], (2, 1))
    marked = np.concatenate([embedder.process(twice), embedder.flush()])
    heard = find_channel(channel)(marked, FS)
    return heard[len(marked) // 2 :][: count * SUPERFRAME]


def receive(marked: Sound, ppm: float, hours: float) -> None:
    """Tell, as the hours pass, which superframes arrived and in what order."""
    count = len(marked) // SUPERFRAME
    receiver, heard, told = AudioReceiver(FS, 2), 0, 0
    arrived = lost = relocked = wrong = 0
    last: int | None = None
    for block in at_clock(rounds(marked), ppm):
        locked = receiver.locked
        for superframe in receiver.process(block):
            if superframe.l0 is None:
                lost += 1
                last = None if last is None else (last + 1) % count
                continue
            number = int.from_bytes(superframe.l0[:2], "big")
            wrong += last is not None and number != (last + 1) % count
            arrived, last = arrived + 1, number
        relocked += receiver.locked and not locked
        heard += len(block)
        if heard // (TOLD_S * FS) > told or heard >= hours * 3600 * FS:
            told = heard // (TOLD_S * FS)
            print(
                f"{heard / FS / 3600:.2f} h at {ppm:+g} ppm: {arrived} superframes, {lost} lost, "
                f"{wrong} out of order, {relocked} locks, {resident_mb():.0f} MB",
                flush=True,
            )
        if heard >= hours * 3600 * FS:
            return


def embed(path: Path, profile: str, hours: float) -> None:
    """Mark a sound as long as wanted, and tell the memory taken."""
    x, _ = soundfile.read(path, dtype="float32", always_2d=True)
    chosen = find_profile(profile)
    payload = bytes(chosen.l0_bytes), bytes(chosen.l1_bytes)
    embedder = AudioEmbedder(
        FS,
        x.shape[1],
        lambda k: payload,
        profile=profile,
        rehearsal=make_rehearsal(chosen, 0, None),
    )
    for number, block in enumerate(rounds(x)):
        embedder.process(block)
        if number % TOLD_S == TOLD_S - 1:
            report = embedder.report()
            print(f"{report.duration_s / 3600:.2f} h embedded, {resident_mb():.0f} MB", flush=True)
            if report.duration_s >= hours * 3600 - 10:
                return


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clip", type=Path, default=FOLDER / "film_mix.flac")
    parser.add_argument("--profile", default="standard")
    parser.add_argument("--channel", default="aac_128", help="as in `cuecast evaluate audio`")
    parser.add_argument("--ppm", type=float, default=0.0)
    parser.add_argument("--hours", type=float, default=0.2)
    parser.add_argument("--embed", action="store_true", help="measure the embedder")
    options = parser.parse_args()
    if options.embed:
        embed(options.clip, options.profile, options.hours)
    else:
        marked = loop_of(options.clip, options.profile, options.channel)
        receive(marked, options.ppm, options.hours)


if __name__ == "__main__":
    main()
