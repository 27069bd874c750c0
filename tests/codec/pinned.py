"""What the codec makes of some motions today: its bits, and what is read back from them.

``python -m tests.codec.pinned`` writes ``tests/data/pinned.json`` again, after a change that is
meant. The codec computes in whole numbers and in float64, far from what rounding moves: the figures
are the same on every machine.
"""

import json
import zlib
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from codec.bitstream.bits import HEADER_BYTES
from codec.bitstream.compact_encoder import CompactEncoder
from codec.bitstream.decoder import SuperframeDecoder
from codec.bitstream.encoder import SuperframeEncoder
from codec.bitstream.inspect import inspect_stream
from codec.bitstream.slow import SlowSender
from codec.bitstream.stream import decode_stream, encode_stream
from codec.bitstream.superframe import ScoreMerger, Superframe, merge_scores
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import CueingOptions, cue
from codec.cues.phonology import CONSONANTS, VOWELS
from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S
from tests.codec.speech import SENTENCE, spoken

PINNED = Path(__file__).parents[1] / "data" / "pinned.json"
SUPERFRAMES = 10
OPTIONS = CueingOptions(un="cheek", schwa="cheek", oe="cheek")
Case = Callable[[], dict[str, Any]]


@cache
def voice() -> Voice:
    return load_voice()


def babble(seed: int, ticks: tuple[int, int], *, length_s: float = 6.0) -> Score:
    """Sounds in any order, each of so many ticks at least and at most; some pauses."""
    rng = np.random.default_rng(seed)
    phones, tick = list[Phone](), int(rng.integers(3, 40))
    while tick * TICK_S < length_s - 0.5:
        kinds = [(CONSONANTS, VOWELS), (VOWELS,), (CONSONANTS,), (CONSONANTS, CONSONANTS, VOWELS)]
        for kind in kinds[int(rng.choice(4, p=[0.6, 0.15, 0.1, 0.15]))]:
            end = tick + int(rng.integers(ticks[0], ticks[1] + 1))
            phones.append(Phone(str(rng.choice(list(kind))), tick * TICK_S, end * TICK_S))
            tick = end
        tick += int(rng.choice([0, 0, 0, 0, 0, 1, 2, 9, 33, 70]))
    return Score(tuple(phones), tuple(cue(phones)))


def read_off(seed: int) -> Score:
    """Keys that follow no language, as they are read off a hand."""
    rng = np.random.default_rng(seed)
    keys, start = list[Key](), 0.3
    while start < SUPERFRAMES * SUPERFRAME_S - 0.6:
        end = start + TICK_S * int(rng.integers(5, 25))
        place = str(rng.choice(["side", "mouth", "chin", "cheek", "throat"]))
        keys.append(Key(round(start, 2), round(end, 2), (), int(rng.integers(1, 9)), place))
        start = end + TICK_S * int(rng.choice([0, 0, 0, 12]))
    return Score((), tuple(keys))


def overridden(seed: int) -> Score:
    """A sentence of whose keys some are shown as no rule gives them."""
    rng, score = np.random.default_rng(seed), spoken(SENTENCE)
    keys = [
        Key(k.start, k.end, k.phones, int(rng.integers(1, 9)), "chin") if rng.random() < 0.2 else k
        for k in score.keys
    ]
    return Score(score.phones, tuple(keys))


def moved(score: Score | None, seed: int) -> Motion:
    """A motion that wanders, with a score."""
    rng = np.random.default_rng(seed)
    times = np.arange(SUPERFRAMES * 32) * TICK_S
    channels = len(voice().layout)
    speed, phase = rng.uniform(0.3, 7, (3, channels)), rng.uniform(0, 6.28, (3, channels))
    size = rng.uniform(0, 0.8, (3, channels)) * rng.random(channels)
    waves = (size[:, None] * np.sin(times[:, None] * speed[:, None] + phase[:, None])).sum(axis=0)
    waves += np.cumsum(rng.normal(0, 0.05, waves.shape), axis=0) * 0.9
    return Motion(waves.astype(np.float32), 50, 0.0, voice().layout, voice().identity, score)


def crc(data: Iterable[bytes]) -> int:
    return zlib.crc32(b"".join(len(part).to_bytes(4, "big") + part for part in data))


def told(score: Score) -> int:
    """A check of all phones and keys, to a millisecond."""
    rows = [(p.symbol, round(p.start, 3), round(p.end, 3)) for p in score.phones]
    keys = [(k.phones, round(k.start, 3), round(k.end, 3), str(k)) for k in score.keys]
    return crc([repr((rows, keys)).encode()])


def course(params: Iterable[Any]) -> list[float]:
    """Each superframe's parameters in one number, of which a change of any is seen."""
    sums = []
    for block in params:
        x = np.asarray(block, np.float64)
        weights = np.cos(np.arange(1, x.size + 1) ** 1.5).reshape(x.shape)
        sums.append(round(float((weights * x).sum()), 4))
    return sums


def read_back(sent: list[Superframe], lost: Callable[[int], str], *, lips: bool) -> dict[str, Any]:
    """What a receiver makes of superframes of which some lose a part."""
    decoder, merger = SuperframeDecoder(voice(), lips=lips), ScoreMerger()
    keys, last = list[Key](), len(sent) - 1
    done = []
    for k in range(len(sent) + 1):
        if k <= last:
            part = lost(k)
            l0 = None if part == "L0" else sent[k].l0
            decoder.take(l0, None if part else sent[k].l1, k)
        if k:
            done.append(decoder.render(k - 1))
            keys += merger.add(done[-1])
    keys += merger.flush()
    return {
        "score": told(merge_scores(done)),
        "keys": told(Score((), tuple(keys))),
        "params": course(frame.params for frame in done),
        "concealed": [frame.concealed for frame in done].count(True),
    }


def on_air(score: Score | None, l0: int, l1: int, seed: int = 0, **given: Any) -> dict[str, Any]:
    """Superframes of one size, received whole, without L1s, and with single and lasting losses."""
    motion = moved(score, seed)
    encoder: SuperframeEncoder | CompactEncoder
    if l1 < 0:
        encoder = CompactEncoder(voice(), l0_bytes=l0, **given)
    else:
        encoder = SuperframeEncoder(voice(), l0_bytes=l0, l1_bytes=l1, **given)
    sent = [encoder.encode(motion, k) for k in range(SUPERFRAMES)]
    lines = {
        "whole": lambda k: "",
        "single": lambda k: "L0" if k % 3 == 1 else "L1" if k % 3 == 2 else "",
        "lasting": lambda k: "L0" if 3 <= k <= 6 else "",
    }
    found: dict[str, Any] = {
        "l0": [crc([s.l0[HEADER_BYTES:]]) for s in sent], "l1": [crc([s.l1]) for s in sent]
    }  # fmt: skip
    for name, lost in lines.items():
        found[name] = read_back(sent, lost, lips=name == "single")
    return found


def filed(score: Score | None, seed: int = 0, **given: Any) -> dict[str, Any]:
    """A stream file, read back and described."""
    data = encode_stream(moved(score, seed), voice(), **given)
    motion = decode_stream(data, voice())
    return {
        "data": crc([data]), "bytes": len(data),
        "score": told(motion.score or Score((), ())),
        "params": course(np.array_split(motion.params, SUPERFRAMES)),
        "described": crc([json.dumps(inspect_stream(data), default=str).encode()]),
    }  # fmt: skip


def cases() -> dict[str, Case]:
    """All cases by name."""
    usual, slow = spoken(SENTENCE), SlowSender({0: 7, 3: 9})
    made: dict[str, Case] = {}

    def air(name: str, *args: Any, **given: Any) -> None:
        made[name] = lambda: on_air(*args, **given)

    def file(name: str, *args: Any, **given: Any) -> None:
        made[name] = lambda: filed(*args, **given)

    for size in (4, 5, 6, 7, 8, 10, 12):
        air(f"compact-{size}-babble", babble(size, (3, 9)), size, -1)
        air(f"compact-{size}-slow", babble(size + 20, (6, 30)), size, -1)
    air("compact-7-fast", babble(5, (2, 4)), 7, -1)
    air("compact-9-signed", usual, 9, -1, signed=True, slow=slow)
    air("compact-9-options", babble(8, (4, 10)), 9, -1, options=OPTIONS)
    air("compact-7-late", usual, 7, -1, first=4)
    air("standard", usual, 20, 7, 1)
    air("standard-protected", babble(31, (4, 9)), 20, 7, 2, protected=True)
    air("standard-signed", babble(32, (4, 9)), 20, 9, 3, signed=True, slow=slow, lead=3)
    air("standard-keys", read_off(4), 20, 7, 4)
    air("standard-overrides", overridden(5), 20, 7, 5, protected=True)
    air("standard-options", babble(33, (4, 12)), 20, 7, 6, options=OPTIONS)
    air("standard-fast", babble(34, (2, 3)), 17, 10, 7, protected=True)
    air("small", babble(35, (5, 12)), 13, 0, 8)
    air("no-score", None, 27, 20, 9)
    air("large", usual, 60, 100, 10)
    air("vast", babble(36, (4, 20)), 200, 300, 11, protected=True)
    file("file-2mm", usual, 1)
    file("file-rate", babble(37, (4, 9)), 2, rate_bps=600)
    file("file-low", babble(38, (4, 9)), 3, rate_bps=140)
    file("file-constant", usual, 4, rate_bps=337.5, constant=True)
    file("file-dropped", babble(39, (3, 20)), 5, rate_bps=900, drop_score=True)
    file("file-keys", read_off(6), 6, rate_bps=800)
    file("file-overrides", overridden(7), 7, error_mm=1.0)
    file("file-no-score", None, 8, error_mm=4.0)
    file("file-options", babble(40, (4, 12)), 9, rate_bps=500, options=OPTIONS)
    return made


def main() -> None:
    """Write all cases."""
    found = {name: case() for name, case in cases().items()}
    PINNED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
