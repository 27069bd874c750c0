"""What the codec makes of some motions today: its bits, and what is read back from them.

``python -m tests.codec.pinned`` writes ``tests/data/pinned.json`` again, after a change that is
meant. The codec computes in whole numbers and in float64, far from what rounding moves: the figures
are the same on every machine.
"""

import json
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import CueingOptions, cue
from codec.cues.phonology import CONSONANTS, VOWELS
from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S
from codec.errors import BitstreamError, CueError
from codec.streamfile.content import read_head, read_superframes
from codec.streamfile.inspect import describe, describe_bits, inspect_stream
from codec.streamfile.stream import decode_stream, encode_stream
from codec.superframe.bitmap import map_record, map_superframe
from codec.superframe.bits import (
    COMPACT,
    COMPACT_SEQUENCES,
    HEADER_BYTES,
    PLAIN,
    SCORE,
    SEQUENCES,
    Header,
    crc8,
    identity_bits,
)
from codec.superframe.checks import check_of, with_check
from codec.superframe.coding import coding_for, derive_coding
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.slow_channel import SlowSender
from codec.superframe.superframe import ScoreMerger, Superframe, merge_scores, resynthesis_of
from codec.training.coding_tables import near, parts_of
from tests.codec.speech import SENTENCE, spoken
from tests.receiver.standin import make_voice

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
    """Sounds as they are made of keys read off a hand: of each shape and placement the first."""
    rng, phones, start = np.random.default_rng(seed), list[Phone](), 0.3
    while start < SUPERFRAMES * SUPERFRAME_S - 0.8:
        end = start + TICK_S * int(rng.integers(5, 25))
        middle = start + TICK_S * int(rng.integers(1, 5))
        phones.append(Phone(str(rng.choice(list("dkʁntlgj"))), start, middle))
        phones.append(Phone(str(rng.choice(list("aɛiou"))), middle, end))
        start = end + TICK_S * int(rng.choice([0, 0, 0, 12]))
    return Score(tuple(phones), tuple(cue(phones)))


def overridden(seed: int) -> Score:
    """A sentence of whose keys some are shown as no rule gives them."""
    rng, score = np.random.default_rng(seed), spoken(SENTENCE)
    keys = [
        Key(k.start, k.end, k.phones, int(rng.integers(1, 9)), "chin") if rng.random() < 0.2 else k
        for k in score.keys
    ]
    return Score(score.phones, tuple(keys))


def at_length(score: Score, times: float) -> Score:
    """A score as many times as slow."""
    phones = [replace(p, start=p.start * times, end=p.end * times) for p in score.phones]
    keys = [replace(k, start=k.start * times, end=k.end * times) for k in score.keys]
    return Score(tuple(phones), tuple(keys))


def moved(score: Score | None, seed: int) -> Motion:
    """A motion that wanders, with a score; of an even number it is near what the score says."""
    rng = np.random.default_rng(seed)
    times = np.arange(SUPERFRAMES * 32) * TICK_S
    channels = len(voice().layout)
    speed, phase = rng.uniform(0.3, 7, (3, channels)), rng.uniform(0, 6.28, (3, channels))
    size = rng.uniform(0, 0.8, (3, channels)) * rng.random(channels)
    waves = (size[:, None] * np.sin(times[:, None] * speed[:, None] + phase[:, None])).sum(axis=0)
    waves += np.cumsum(rng.normal(0, 0.05, waves.shape), axis=0) * 0.9
    motion = Motion(waves.astype(np.float32), 50, 0.0, voice().layout, voice().identity, score)
    if score is None or seed % 2:
        return motion
    coding, parts = coding_for(voice()), parts_of(motion, SUPERFRAMES)
    blocks = [resynthesis_of(coding, near(parts, k), k).params() for k in range(SUPERFRAMES)]
    offset = 0.4 * rng.normal(size=channels)  # another cuer's hand: what is learnt
    cued = np.concatenate(blocks) * rng.uniform(0.8, 1.2, channels) + offset + 0.1 * waves
    return replace(motion, params=cued.astype(np.float32))


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
        encoder = SuperframeEncoder(voice(), l0_bytes=l0, l1_bytes=l1, filmed=False, **given)
    sent = [encoder.encode(motion, k) for k in range(SUPERFRAMES)]
    lines = {
        "whole": lambda k: "",
        "single": lambda k: "L0" if k % 3 == 1 else "L1" if k % 3 == 2 else "",
        "lasting": lambda k: "L0" if 3 <= k <= 6 else "",
    }
    found: dict[str, Any] = {
        "l0": [crc([s.l0[HEADER_BYTES:]]) for s in sent],
        "l1": [crc([s.l1]) for s in sent],
        "fields": [crc([repr(map_superframe(s)).encode()]) for s in sent],
        "bits": crc([describe_bits(s, colour=bool(s.index % 2)).encode() for s in sent]),
    }
    for name, lost in lines.items():
        found[name] = read_back(sent, lost, lips=name == "single")
    return found


def filed(cues: Score | None, seed: int = 0, **given: Any) -> dict[str, Any]:
    """A stream file, read back and described; the score is kept unless something else is asked."""
    data = encode_stream(moved(cues, seed), voice(), **{"score": "keep"} | given)
    motion = decode_stream(data, voice())
    head, document = read_head(data), inspect_stream(data)
    return {
        "data": crc([data]),
        "bytes": len(data),
        "head": repr(head),
        "score": told(motion.score or Score((), ())),
        "params": course(np.array_split(motion.params, SUPERFRAMES)),
        "described": crc([repr(document).encode(), describe(document).encode()]),
        "bits": crc(bits_of(data)),
        "broken": crc([refused(decode_stream, broken, voice()) for broken in wounds(data)]),
    }


def bits_of(data: bytes) -> Iterator[bytes]:
    """The bit maps of a file's superframes."""
    for frame in read_superframes(data):
        try:
            fields = None if read_head(data).l0 else map_record(frame, scored=True)
            yield describe_bits(frame, fields=fields).encode()
        except BitstreamError as error:
            yield str(error).encode()


def wounds(data: bytes) -> Iterator[bytes]:
    """A file cut off, made longer, and with changed bytes."""
    rng = np.random.default_rng(len(data))
    for size in (0, 1, 5, 20, len(data) // 2, len(data) - 1):
        yield data[:size]
    yield data + b"\0"
    yield data + data
    for place in rng.integers(0, min(len(data), 40), 30):
        yield data[:place] + bytes([data[place] ^ int(rng.integers(1, 256))]) + data[place + 1 :]


def refused(read: Callable[..., Any], *given: Any) -> bytes:
    """The rule that damage breaks, with its place; the words may change."""
    try:
        read(*given)
    except BitstreamError as error:
        return f"{error.section} {error.bit}".encode()
    except CueError as error:
        return str(error).encode()
    return b"read"


def noise(mode: int, size: int, more: int) -> dict[str, Any]:
    """Superframes of random bytes under valid checks, that follow one another."""
    rng, identity = np.random.default_rng([mode, size]), coding_for(voice()).identity
    decoder, said, sums = SuperframeDecoder(voice()), [], []
    for k in range(12):
        signed = bool(k % 4 == 3) and mode != COMPACT
        head = Header(mode, k % (COMPACT_SEQUENCES if mode == COMPACT else SEQUENCES), 1, signed)
        body = bytearray(rng.bytes(size))
        if mode == COMPACT:
            body[-1] = body[-1] & 0xFC | identity_bits(identity, k)
            l0, l1 = head.to_bytes() + bytes(body), b""
        else:
            l0 = with_check(head.to_bytes() + bytes(body), identity)
            l1 = rng.bytes(more)
            l1 += bytes([crc8(check_of(l0) + l1)])
        said.append(refused(decoder.push, l0, l1, k))
        if k > 2:
            frame = decoder.render(k - 1)
            sums += course([frame.params])
            said.append(f"{told(merge_scores([frame]))} {frame.layers} {frame.lead}".encode())
    return {"said": crc(said), "params": sums}


def in_any_order(score: Score, seed: int) -> dict[str, Any]:
    """Parts that come late, twice and in another order, by a decoder that remembers little."""
    encoder = SuperframeEncoder(voice(), l0_bytes=20, l1_bytes=12, protected=True, filmed=False)
    motion = moved(score, seed)
    sent = [encoder.encode(motion, k) for k in range(SUPERFRAMES)]
    decoder, done = SuperframeDecoder(voice()), []
    for k in (3, 1, 1, 8, 2, 6, 9, 0, 4, 4):
        decoder.take(sent[k].l0, None, k)
        done += [decoder.render(near) for near in (k - 2, k, k + 1)]
        decoder.take(sent[k].l0, sent[k].l1, k)
        done.append(decoder.render(k))
    return {
        "params": course(frame.params for frame in done),
        "said": [f"{told(merge_scores([f]))} {f.layers} {f.lead} {f.sequence}" for f in done],
    }


def derived() -> dict[str, Any]:
    """The coding of a voice without trained tables."""
    coding = derive_coding(make_voice())
    bases = (coding.residual, coding.loose, coding.plain, coding.filmed)
    return {
        "scales": [base.scales.sum(axis=1).tolist() for base in bases],
        "mean": course([coding.mean]),
    }


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
    file("file-auto", babble(39, (3, 20)), 5, rate_bps=900, score="auto")
    file("file-dropped", babble(39, (3, 20)), 5, rate_bps=900, score="drop")
    file("file-keys", read_off(6), 6, rate_bps=800)
    file("file-overrides", overridden(7), 7, error_mm=1.0)
    file("file-no-score", None, 8, error_mm=4.0)
    file("file-options", babble(40, (4, 12)), 9, rate_bps=500, options=OPTIONS)
    file("file-slow", spoken(SENTENCE[:12], 0.8), 10, rate_bps=700)
    file("file-slow-keys", at_length(overridden(11), 7.0), 11, rate_bps=700)
    for number, rate in enumerate((250, 400, 900, 2500)):
        score = babble(50 + number, (3, 8 + number))
        file(f"file-cued-{rate}", score, 20 + 2 * number, rate_bps=rate)
        file(f"file-steady-{rate}", score, 30 + 2 * number, rate_bps=rate, constant=True)
        file(f"file-auto-{rate}", score, 40 + number, rate_bps=rate, score="auto")
    for error_mm in (0.5, 1.5, 3.0, 9.0):
        file(f"file-{error_mm}-mm", babble(60, (3, 9)), 50, error_mm=error_mm)
    air("cued", babble(61, (3, 9)), 20, 7, 60, protected=True)
    air("cued-large", babble(62, (3, 9)), 60, 90, 62)
    air("cued-small", babble(63, (5, 12)), 15, 4, 64)
    for mode in (SCORE, PLAIN, COMPACT):
        for size in (6, 9, 11) if mode == COMPACT else (12, 24, 70):
            made[f"noise-{mode}-{size}"] = partial(noise, mode, size, 2 * size)
    made["derived"] = derived
    made["any-order"] = lambda: in_any_order(babble(41, (4, 9)), 12)
    made["any-order-keys"] = lambda: in_any_order(overridden(13), 13)
    return made


def main() -> None:
    """Write all cases."""
    rows = [f"{json.dumps(name)}: {json.dumps(case())}" for name, case in cases().items()]
    PINNED.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
