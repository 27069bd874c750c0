"""Stream files (``.cue``): a motion as superframes one after another.

A head names the voice, the span of ticks and the lengths of the parts; superframes follow. Where
the head states no lengths, every superframe is preceded by its own.
Specification: spec/bitstream.md, section 8.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.bitstream.bits import (
    FILE_BYTES,
    FILE_FIELDS,
    MAGIC,
    RECORD_BYTES,
    RECORD_FIELDS,
    VERSION,
    crc16,
    pack_fields,
    unpack_fields,
)
from codec.bitstream.coding import Coding, coding_for
from codec.bitstream.compact_encoder import CompactEncoder
from codec.bitstream.decoder import SuperframeDecoder
from codec.bitstream.encoder import SuperframeEncoder
from codec.bitstream.quantise import NO_RESIDUAL
from codec.bitstream.superframe import Superframe, merge_scores
from codec.bitstream.window import MAX_BYTES
from codec.cuer.motion import MOST_PARAM, Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS, to_ticks
from codec.errors import BitstreamError, CueError, VoiceError

RATE_HZ = 50.0
MIN_RATE_BPS = 60
MAX_RATE_BPS = 20_000
_CRC_BYTES = 2
_MAX_TICKS = 24 * 3600 * 50
_OPEN_BYTES = 4000
_GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True, slots=True)
class StreamHead:
    """The head of a stream file.

    Attributes
    ----------
    voice, coding : str
        Identities of the voice and of its coding.
    first_tick, ticks : int
        Ticks of 20 ms that the motion covers.
    l0, l1 : int
        Lengths of the parts of every superframe; 0 for `l0` if each states its own.
    """

    voice: str
    coding: str
    first_tick: int
    ticks: int
    l0: int = 0
    l1: int = 0

    @property
    def indices(self) -> range:
        """Numbers of the superframes that cover the motion."""
        end = -(-(self.first_tick + self.ticks) // TICKS)
        return range(self.first_tick // TICKS, end)


def encode_stream(
    motion: Motion,
    voice: Voice,
    *,
    rate_bps: float | None = None,
    error_mm: float | None = None,
    options: CueingOptions = DEFAULT_OPTIONS,
) -> bytes:
    """Return a motion as a stream file.

    Parameters
    ----------
    motion : Motion
        Of this voice, from time 0 on.
    voice : Voice
    rate_bps : float, optional
        Constant rate of the superframes, checksums included, 60..20000 bit/s. Up to 150 bit/s
        they are compact: without a residual, and without a checksum each.
    error_mm : float, optional
        Greatest error instead: RMS over all markers and frames, which the whole file keeps.
        Default without either: 2 mm.
    options : CueingOptions
        Under which the score's keys follow from its phones.

    Raises
    ------
    CueError
        If both or an impossible value is given, or the motion is empty or begins before 0.
    """
    head = _head_of(motion, coding_for(voice))
    if rate_bps is not None and error_mm is not None:
        raise CueError("a rate and an error cannot both be given")
    if rate_bps is not None:
        if not MIN_RATE_BPS <= rate_bps <= MAX_RATE_BPS:
            raise CueError(f"rate {rate_bps} bit/s is not within {MIN_RATE_BPS}..{MAX_RATE_BPS}")
        size = int(rate_bps * SUPERFRAME_S / 8)
        encoder: CompactEncoder | SuperframeEncoder = (
            CompactEncoder(voice, l0_bytes=size, options=options, first=head.indices.start)
            if size <= MAX_BYTES
            else SuperframeEncoder(voice, l0_bytes=size, l1_bytes=0, lead=0, options=options)
        )
        head = replace(head, l0=size)
        body = b"".join(encoder.encode(motion, index).l0 for index in head.indices)
    else:
        limit = 2.0 if error_mm is None else error_mm
        if not 0.05 <= limit <= 1000:
            raise CueError(f"error {limit} mm is not within 0.05..1000")
        body = b"".join(map(_record, _within(limit, motion, voice, head, options)))
    return _head_bytes(head) + body


def _head_of(motion: Motion, coding: Coding) -> StreamHead:
    first, ticks = to_ticks(motion.start_s), to_ticks(motion.duration_s)
    if first < 0 or not 0 < ticks <= _MAX_TICKS or first > _MAX_TICKS:
        raise CueError(
            f"motion of {motion.duration_s} s from {motion.start_s} s does not fit into a stream: "
            f"0.02..86400 s, from 0..86400 s"
        )
    return StreamHead(motion.voice, coding.identity, first, ticks)


def _within(
    error_mm: float, motion: Motion, voice: Voice, head: StreamHead, options: CueingOptions
) -> list[Superframe]:
    """Return superframes at the widest steps at which the error stays within its limit.

    They are one step and, for as many superframes as the limit allows, the next wider one.
    """
    encoder = SuperframeEncoder(voice, l0_bytes=_OPEN_BYTES, l1_bytes=0, lead=0, options=options)

    @functools.cache
    def squares(step: int) -> NDArray[np.float64]:
        return np.square([encoder.error_mm(motion, index, step) for index in head.indices])

    low, high = 0, NO_RESIDUAL
    while low < high:
        step = (low + high + 1) // 2
        if squares(step).mean() <= error_mm**2:
            low = step
        else:
            high = step - 1
    steps = np.full(len(head.indices), low)
    if low < NO_RESIDUAL:
        # Spread evenly by the golden section, in whatever number.
        order = np.argsort(np.arange(len(steps)) * _GOLDEN % 1.0)
        more = np.cumsum((squares(low + 1) - squares(low))[order]) + squares(low).sum()
        within = np.flatnonzero(more <= len(steps) * error_mm**2)
        steps[order[: within.max(initial=-1) + 1]] += 1
    return [
        encoder.encode_at(motion, index, int(step))
        for index, step in zip(head.indices, steps, strict=True)
    ]


def _head_bytes(head: StreamHead) -> bytes:
    fields = {
        "magic": MAGIC, "version": VERSION, "voice": int(head.voice, 16),
        "coding": int(head.coding, 16), "first_tick": head.first_tick, "ticks": head.ticks,
        "l0": head.l0, "l1": head.l1,
    }  # fmt: skip
    body = pack_fields(FILE_FIELDS, fields)
    return body + crc16(body).to_bytes(_CRC_BYTES, "big")


def _record(frame: Superframe) -> bytes:
    lengths = {"l0": len(frame.l0), "l1": len(frame.l1)}
    return pack_fields(RECORD_FIELDS, lengths) + frame.l0 + frame.l1


def read_head(data: bytes) -> StreamHead:
    """Read the head of a stream file.

    Raises
    ------
    BitstreamError
        If it is short (F1), of another kind (F2), version (F3) or checksum (F4), or covers an
        impossible time (F5).
    """
    if len(data) < FILE_BYTES + _CRC_BYTES:
        raise BitstreamError(f"{len(data)} bytes are no head of a stream file", section="F1")
    fields = unpack_fields(FILE_FIELDS, data[:FILE_BYTES])
    if fields["magic"] != MAGIC:
        raise BitstreamError(f"magic {fields['magic']:08x} is not a stream's", section="F2", bit=0)
    if fields["version"] != VERSION:
        raise BitstreamError(f"version {fields['version']} is not {VERSION}", section="F3", bit=32)
    check = data[FILE_BYTES : FILE_BYTES + _CRC_BYTES]
    if crc16(data[:FILE_BYTES]).to_bytes(_CRC_BYTES, "big") != check:
        raise BitstreamError("checksum of the head", section="F4", bit=8 * FILE_BYTES)
    voice, coding = (f"{fields[name]:016x}" for name in ("voice", "coding"))
    head = StreamHead(
        voice, coding, fields["first_tick"], fields["ticks"], fields["l0"], fields["l1"]
    )
    if not 0 < head.ticks <= _MAX_TICKS or head.first_tick > _MAX_TICKS:
        raise BitstreamError(f"{head.ticks} ticks from {head.first_tick}", section="F5", bit=168)
    return head


def read_superframes(data: bytes) -> Iterator[Superframe]:
    """Yield the superframes of a stream file, their checksums not looked at.

    Raises
    ------
    BitstreamError
        As `read_head`; if the file ends within a record, or goes on after the last one (F6).
    """
    head = read_head(data)
    place = FILE_BYTES + _CRC_BYTES
    for index in head.indices:
        l0, l1 = head.l0, head.l1
        if l0 == 0:
            if place + RECORD_BYTES > len(data):
                raise BitstreamError(f"no superframe {index}", section="F6", bit=8 * place)
            lengths = unpack_fields(RECORD_FIELDS, data[place : place + RECORD_BYTES])
            l0, l1 = lengths["l0"], lengths["l1"]
            place += RECORD_BYTES
        middle, end = place + l0, place + l0 + l1
        if end > len(data):
            raise BitstreamError(f"superframe {index} is cut off", section="F6", bit=8 * place)
        yield Superframe(index, data[place:middle], data[middle:end])
        place = end
    if place != len(data):
        raise BitstreamError(f"{len(data) - place} bytes too many", section="F6", bit=8 * place)


def decode_stream(data: bytes, voice: Voice) -> Motion:
    """Return the motion of a stream file, at 50 Hz.

    Superframes with a wrong checksum are concealed.

    Raises
    ------
    BitstreamError
        If the file breaks a rule.
    VoiceError
        If it was made with another voice or with other coding tables.
    """
    head = read_head(data)
    if head.voice != voice.identity:
        raise VoiceError(f"stream of voice {head.voice}, voice {voice.name} is {voice.identity}")
    if head.coding != coding_for(voice).identity:
        raise VoiceError(
            f"stream coded with tables {head.coding}, those of voice {voice.name} here are "
            f"{coding_for(voice).identity}"
        )
    decoder, done, previous = SuperframeDecoder(voice), [], None
    for frame in read_superframes(data):
        decoder.push(frame.l0, frame.l1, frame.index)
        if previous is not None:
            done.append(decoder.render(previous))
        previous = frame.index
    if previous is not None:
        done.append(decoder.render(previous))
    params = np.concatenate([frame.params for frame in done]).clip(-MOST_PARAM, MOST_PARAM)
    skip = head.first_tick % TICKS
    score = merge_scores(done) if any(frame.part is not None for frame in done) else None
    return Motion(
        params[skip : skip + head.ticks], RATE_HZ, head.first_tick * TICK_S, voice.layout,
        head.voice, score,
    )  # fmt: skip
