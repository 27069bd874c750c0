"""A transport stream on a bad line for any number of hours, and the truth about it.

A marked programme is coded once; its transport packets are then sent over and over with losses,
garbage, splices, jumps of the clock and wraps, while the time stamps are rewritten. What is read
is a stream for `receiver.live.broadcast.Broadcast`; what was sent is known by time stamp.
"""

from collections import deque
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from io import BytesIO
from multiprocessing import get_context
from typing import Any

import av
import numpy as np

from codec.cuer.voice import load_voice
from codec.cues.score import Score
from receiver.reception.events import SUPERFRAME_S
from tests.receiver.air import FS, marked_noise
from tests.receiver.seeded import seeded_speech
from tests.receiver.standin import make_motion

PACKET = 188
POOL_S = 41
STAMP_HZ = 90_000
STAMPS = 1 << 33
VOICE = load_voice()
_CHUNK = 7 * PACKET


@cache
def speech() -> Score:
    """What the pool says."""
    return seeded_speech(POOL_S - 1)


_pools: dict[str, bytes] = {}


def pool(codec: str) -> bytes:
    """Return the marked programme as a transport stream of sound alone, its first stamp 0.

    Another process makes it, so that the memory of this one is the receiver's.
    """
    if codec not in _pools:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as maker:
            _pools[codec] = maker.submit(make_pool, codec).result()
    return _pools[codec]


def make_pool(codec: str) -> bytes:
    """Mark and code the programme."""
    motion = replace(make_motion(VOICE, POOL_S + 3 * SUPERFRAME_S), score=speech())
    sound = marked_noise(VOICE, motion, POOL_S)
    file = BytesIO()
    with av.open(file, "w", format="mpegts") as out:
        stream: Any = out.add_stream(codec, rate=FS)
        stream.bit_rate, stream.layout = 192_000, "mono"
        for at in range(0, len(sound), FS // 25):
            part = np.ascontiguousarray(sound[at : at + FS // 25].T)
            if codec != "aac":
                part = np.rint(part * 32767).astype(np.int16)
            frame = av.AudioFrame.from_ndarray(
                part, format="fltp" if codec == "aac" else "s16", layout="mono"
            )
            frame.sample_rate, frame.time_base, frame.pts = FS, Fraction(1, FS), at
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return file.getvalue()


def stamp_place(packet: bytes | bytearray) -> tuple[int, int]:
    """Return offsets of program clock reference and PES time stamp in a packet; 0 for none."""
    clock = stamp = 0
    payload = 4
    if packet[3] & 0x20:
        if packet[4] and packet[5] & 0x10:
            clock = 6
        payload = 5 + packet[4]
    starts = packet[1] & 0x40 and packet[3] & 0x10 and payload < PACKET - 14
    if starts and packet[payload : payload + 3] == b"\0\0\1" and packet[payload + 7] & 0x80:
        stamp = payload + 9
    return clock, stamp


def read_stamp(field: bytes | bytearray) -> int:
    """Return the 33 bits of a PES time stamp (ISO/IEC 13818-1, section 2.4.3.7)."""
    high, middle, low = field[0] >> 1 & 7, int.from_bytes(field[1:3]) >> 1, 0
    low = int.from_bytes(field[3:5]) >> 1
    return high << 30 | middle << 15 | low


def restamp(packet: bytes, shift: int) -> bytes:
    """Return a transport packet whose clocks are `shift` ticks of 90 kHz later."""
    clock, stamp = stamp_place(packet)
    if not clock and not stamp:
        return packet
    out = bytearray(packet)
    if clock:
        whole = int.from_bytes(out[clock : clock + 6])
        base = ((whole >> 15) + shift) % STAMPS
        out[clock : clock + 6] = (base << 15 | whole & 0x7FFF).to_bytes(6)
    if stamp:
        value = (read_stamp(out[stamp : stamp + 5]) + shift) % STAMPS
        out[stamp] = out[stamp] & 0xF0 | (value >> 30) << 1 | 1
        out[stamp + 1 : stamp + 3] = ((value >> 15 & 0x7FFF) << 1 | 1).to_bytes(2)
        out[stamp + 3 : stamp + 5] = ((value & 0x7FFF) << 1 | 1).to_bytes(2)
    return bytes(out)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Part of the pool on air: its time stamps, modulo their period, are `shift` later."""

    shift: int
    first_s: float
    last_s: float


class BadLine:
    """A readable stream of transport packets that ends after `duration_s` of programme.

    Parameters
    ----------
    rng : np.random.Generator
    codec : str
        ``aac`` or ``mp2``.
    duration_s : float
    """

    def __init__(self, rng: np.random.Generator, codec: str, duration_s: float) -> None:
        self._rng, self._data, self._left_s = rng, pool(codec), duration_s
        self._at = 0
        self._shift = int(rng.integers(STAMPS))
        self._held = bytearray()
        self.stretches: deque[Stretch] = deque(maxlen=40)
        self._packets_per_s = len(self._data) / PACKET / POOL_S
        self._splice(0.0)

    def read(self, size: int) -> bytes:
        """Return some bytes; none at the end."""
        while len(self._held) < size and self._left_s > 0:
            self._held += self._send()
        out = bytes(self._held[:size])
        del self._held[:size]
        return out

    def _send(self) -> bytes:
        """Send a datagram with whatever befalls it."""
        rng = self._rng
        part = self._data[self._at : self._at + _CHUNK]
        seconds = len(part) / PACKET / self._packets_per_s
        self._left_s -= seconds
        self._at += _CHUNK
        if self._at >= len(self._data):
            self._splice(float(rng.uniform(0, POOL_S - 5)))
        happening = rng.random() / seconds
        if happening < 1 / 45:
            self._splice(float(rng.uniform(0, POOL_S - 5)))
        elif happening < 2 / 45:  # the line is dead for up to eight seconds
            self._skip(float(rng.exponential(1.0)))
        elif happening < 3 / 45:  # the clock jumps, the programme goes on
            self._jump(int(rng.integers(STAMPS)) if rng.random() < 0.5 else int(rng.normal(0, 9e5)))
        fate = rng.random()
        if fate < 0.01:
            return b""
        packets = [restamp(part[i : i + PACKET], self._shift) for i in range(0, len(part), PACKET)]
        sent = b"".join(packets)
        if fate < 0.012:
            return bytes(rng.integers(0, 256, len(sent), dtype=np.uint8))
        if fate < 0.014:
            noise = rng.integers(0, 256, 5, dtype=np.uint8)
            at = int(rng.integers(len(sent) - 5))
            return sent[:at] + noise.tobytes() + sent[at + 5 :]
        if fate < 0.015:
            return sent[: int(rng.integers(len(sent)))]
        if fate < 0.016:
            return sent + sent
        return sent

    def _skip(self, seconds: float) -> None:
        at = self._at + round(min(seconds, 8.0) * self._packets_per_s) * PACKET
        self._at = at if at < len(self._data) else self._at

    def _splice(self, to_s: float) -> None:
        self._at = round(to_s * self._packets_per_s) * PACKET
        self._jump(int(self._rng.integers(STAMPS)))

    def _jump(self, ticks: int) -> None:
        self._shift = (self._shift + ticks) % STAMPS
        self.stretches.append(
            Stretch(self._shift, self._at / PACKET / self._packets_per_s - 2.0, POOL_S + 1.0)
        )

    def sent_s(self, stamp_s: float) -> list[float]:
        """Return the times in the pool that a stamp can stand for, latest stretch first."""
        found = []
        for stretch in reversed(self.stretches):
            ticks = (round(stamp_s * STAMP_HZ) - stretch.shift) % STAMPS
            time_s = (ticks if ticks < STAMPS // 2 else ticks - STAMPS) / STAMP_HZ
            if stretch.first_s <= time_s <= stretch.last_s:
                found.append(time_s)
        return found
