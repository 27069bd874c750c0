"""A hostile hour for sound: an adversary plays marks of his own between a true mark's stretches.

In: a sound file; out: a line for each attack and for the true mark between them: whole superframes
read and sent of the broadcaster and of the adversary, those accepted that nobody sent there, and
the receiver's processor time in FFmpeg's AAC encodes of the same sound. Run:
``python -m tests.bench.hostile_sound CLIP --minutes 20 --seed 1``.
"""

import argparse
import time
from collections import Counter, defaultdict
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.evaluate.sound_channels import encode, find_channel
from tests.bench.hunt import BLOCK, Sound, sound_of
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.embed.stereo_design import StereoDesigner
from watermark.audio.receiver import AudioReceiver
from watermark.audio.search.pilot_scan import SEARCH_HOP, slot_frequencies
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.mix import front_of, mid_of, side_of
from watermark.audio.signal.profile import FS, HOP, STANDARD, SUPERFRAME

LENGTH, STRETCH_S, NEAR_S = 150, (4.0, 20.0), 0.1
"""Superframes of the programme, played again and again; least and greatest length of stretches that
follow each other; how far from its place a superframe may be reported."""

LEVEL, LOUDER, TRUE, ALIEN, LATER = 6, 4, 7, 8, 9
"""Level of a mark upon the true one, and by how much one that drowns it has more: 6 dB. Seeds of
payloads: the broadcaster's, the adversary's in the same grid, and beside it."""

Tape = tuple[Sound, tuple[tuple[int, int], ...]]
"""Sound, and of each mark in it the seed of its payloads and its first sample."""


def payload_of(seed: int, number: int) -> tuple[bytes, bytes]:
    """Return a superframe of a sender."""
    rng = np.random.default_rng([seed, number])
    return rng.bytes(STANDARD.l0_bytes), rng.bytes(STANDARD.l1_bytes)


def marked(x: Sound, seed: int, level: int | None = None) -> Sound:
    """Mark a sound, as `dub` does or at a fixed level."""
    tried = make_rehearsal(STANDARD, 0, None)
    embedder = AudioEmbedder(FS, 2, lambda k: payload_of(seed, k), level=level, rehearsal=tried)
    return np.concatenate([embedder.process(x), embedder.flush()])


class _PilotsAlone(StereoDesigner):
    """Writes no data."""

    def _wanted(
        self, sound: NDArray[np.float64], payload: tuple[bytes, bytes]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        data, announced = super()._wanted(sound, payload)
        return np.zeros_like(data), announced


def pilots_on(x: Sound) -> Sound:
    """Write pilots that announce data which is not there."""
    designer, host = (
        _PilotsAlone(STANDARD, 0),
        np.stack([of(x.astype(float)) for of in (mid_of, side_of)]),
    )
    for start in range(HOP, host.shape[1] - SUPERFRAME - HOP, SUPERFRAME):
        before, span = host[:, start - HOP : start], host[:, start : start + SUPERFRAME + HOP]
        span += designer.design(before, span, payload_of(ALIEN, 0), LEVEL).mark
    return front_of(host[0], host[1], 2).astype(np.float32)


def tones_on(x: Sound) -> Sound:
    """Add tones on the pilots' places, keyed as pilots are, 20 dB below the sound."""
    rows = np.repeat(make_pilots(0).expected(STANDARD.number), HOP, axis=0)
    phases = np.outer(np.arange(len(x)), slot_frequencies() * SEARCH_HOP / HOP)
    tones = (np.resize(rows, phases.shape) * np.sin(phases)).sum(axis=1)
    return np.asarray(x + 0.1 * x.std() / tones.std() * tones[:, np.newaxis], dtype=np.float32)


def make_tapes(x: Sound, shift: int) -> dict[str, Tape]:
    """Return the true programme, first, and the adversary's alterations of it."""
    true, alien = marked(x, TRUE), marked(x, ALIEN)
    half, turn = (np.arange(len(x))[:, np.newaxis] // n % 2 for n in (SUPERFRAME // 2, FS // 2))
    two, louder = (marked(true[shift:], LATER, LEVEL + more) for more in (0, LOUDER))
    both = (mine := (TRUE, 0)), (LATER, shift)
    return {
        "true": (true, (mine,)),
        "replayed": (true, (mine,)),
        "spliced in order": (alien, ((ALIEN, 0),)),
        "spliced in halves": (np.where(half, true, alien), (mine, (ALIEN, 0))),
        "two marks": (np.concatenate([true[:shift], two]), both),
        "a louder mark": (np.concatenate([true[:shift], louder]), both),
        "pilots alone": (pilots_on(x), ()),
        "tones": (tones_on(x), ()),
        "clipped, silent": (np.where(turn, np.clip(8 * true, -1, 1), 0), (mine,)),
    }


def endure(tapes: dict[str, Tape], seconds: float, seed: int) -> list[str]:
    """Let a receiver hear the true mark and attacks in turn; return lines of figures."""
    rng, counts, parts = np.random.default_rng(seed), Counter[tuple[str, str]](), list[Sound]()
    places = defaultdict[bytes, list[tuple[float, bytes, str, str]]](list)
    kinds, at, whole = list[str](), 0, len(tapes["true"][0])  # kinds of each block
    while (out := len(kinds) * BLOCK) < seconds * FS:
        attacked = bool(kinds) and kinds[-1] == "true"
        kind = list(tapes)[int(rng.integers(1, len(tapes)))] if attacked else "true"
        length = round(rng.uniform(*STRETCH_S) * FS / BLOCK) * BLOCK
        if kind == "replayed" or at + length > whole:  # all else is in step
            at = int(rng.integers(whole - length))
        sound, marks = tapes[kind]
        for (sender, first), number in product(marks, range(LENGTH)):
            place = first + number * SUPERFRAME - at
            if -SUPERFRAME < place < length:
                inside = 0 <= place <= length - SUPERFRAME
                whose = ("his", "true")[sender == TRUE] if inside else "cut"
                counts[kind, whose] += 1
                l0, l1 = payload_of(sender, number)
                places[l0].append(((out + place) / FS, l1, kind, f"{whose} read"))
        parts.append(sound[at : at + length])
        kinds += [kind] * (length // BLOCK)
        at += length
    heard = np.asarray(find_channel("aac_128")(np.concatenate(parts), FS), dtype=np.float32)
    began = time.process_time()
    encode(heard, FS, codec="aac", bit_rate=128_000)
    encoding, receiver, costs = (time.process_time() - began) / len(kinds), AudioReceiver(FS, 2), []
    for n, kind in enumerate(kinds):
        began = time.process_time()
        found = receiver.process(heard[n * BLOCK : (n + 1) * BLOCK])
        costs.append((time.process_time() - began) / encoding)
        for s in (s for s in found if s.l0 is not None):
            near = (p for p in places[s.l0 or b""] if abs(s.position_s - p[0]) < NEAR_S)
            due = next((p for p in near if s.l1 in (None, p[1])), None)
            if due:  # another one like it would be one too many
                places[s.l0 or b""].remove(due)
            counts[due[2:] if due else (kind, "nobody")] += 1
    each = np.array(costs)[: len(costs) // 10 * 10].reshape(-1, 10).mean(axis=1)  # of each second
    kind_of = np.array(kinds[9::10])
    return [
        f"{kind:18}{own.sum():5} s, true {counts[kind, 'true read']} of {counts[kind, 'true']}, "
        f"his {counts[kind, 'his read']} of {counts[kind, 'his']}, nobody's "
        f"{counts[kind, 'nobody']}, {each[own].mean():.2f} encodes, at most {each[own].max():.1f}"
        for kind in tapes
        if (own := kind_of == kind).any()
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clip", type=Path)
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    tapes = make_tapes(sound_of(options.clip, LENGTH * SUPERFRAME / FS), SUPERFRAME * 3 // 8)
    endure(tapes, 30.0, 0)  # compiles
    print("\n".join(endure(tapes, 60 * options.minutes, options.seed)))


if __name__ == "__main__":
    main()
