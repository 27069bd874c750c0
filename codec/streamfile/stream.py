"""Stream files (``.cue``): a motion as superframes one after another.

A head names the coding, the span of ticks and the lengths of the parts; superframes follow, as they
would be on air. Where the head states no lengths, they vary in size, and the score is encoded
once for all (`codec.streamfile.records`, `codec.streamfile.file_score`).
Specification: spec/bitstream.md, section 8.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import MOST_PARAM, Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.language import Language, french
from codec.cues.score import Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS, to_ticks
from codec.errors import BitstreamError, CueError, VoiceError
from codec.streamfile.file_score import NOTHING_TOLD, FileScore, read_told
from codec.streamfile.learning import Learner
from codec.streamfile.records import OVERHEAD_BYTES, read_records, record_bytes, write_records
from codec.streamfile.spread import MOST_COST, ByError, BySize, ScoreChoice, spread
from codec.streamfile.versions import Progress, Spread, SpreadMotion, line_of, silent
from codec.streamfile.whole_score import WholeResynthesis
from codec.superframe.bits import (
    FILE_BYTES,
    FILE_FIELDS,
    MAGIC,
    VERSION,
    crc16,
    pack_fields,
    unpack_fields,
)
from codec.superframe.coding import Coding, coding_for
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder, block_of
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import DecodedSuperframe, Superframe, merge_scores
from codec.superframe.window import MAX_BYTES, MIN_BYTES

Array = NDArray[np.float64]

RATE_HZ = 50.0
"""Frames per second of decoded motion."""

MIN_RATE_BPS = 60
"""Least rate of a file in bit/s."""

MAX_RATE_BPS = 20_000
"""Largest rate of a file in bit/s."""

_CRC_BYTES = 2
"""Bytes of the check of a file's head."""

_MAX_TICKS = 24 * 3600 * 50
"""Ticks of the longest file: a day."""


@dataclass(frozen=True, slots=True)
class StreamHead:
    """The head of a stream file.

    Attributes
    ----------
    coding : str
        Identity of the coding.
    first_tick, ticks : int
        Ticks of 20 ms that the motion covers.
    l0, l1 : int
        Lengths of the parts of every superframe; 0 for `l0` if each states its own (F7).
    """

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


@dataclass(frozen=True, slots=True)
class ChosenStream:
    """A stream file, and what became of the score.

    Attributes
    ----------
    data : bytes
        The file.
    scored : bool
        Whether it has the score.
    score_cost : float or None
        How much larger the file is for its score, or how much greater its error at the rate, as a
        share; negative if the score helps. Estimated where there is no doubt; None if the motion
        has no score or the choice was not left to the encoder.
    """

    data: bytes
    scored: bool
    score_cost: float | None


def encode_stream(
    motion: Motion,
    voice: Voice,
    *,
    rate_bps: float | None = None,
    error_mm: float | None = None,
    constant: bool = False,
    score: ScoreChoice = "auto",
    options: CueingOptions = DEFAULT_OPTIONS,
) -> bytes:
    """Return a motion as a stream file.

    Parameters
    ----------
    motion : Motion
        Of this voice, from time 0 on.
    voice : Voice
    rate_bps : float, optional
        Mean rate of the whole file, 60..20000 bit/s; superframes take what they need of it. Up to
        150 bit/s they may be compact instead, whichever is nearer to the motion.
    error_mm : float, optional
        Greatest error instead: RMS over all markers and frames, which the whole file keeps.
        Default without either: 2 mm.
    constant : bool
        Give every superframe the same size, as on air; the rate is that of the superframes. Up to
        150 bit/s they are compact: the score alone.
    score : {"auto", "keep", "drop"}
        Tell the score, and so the keys, if the file is at most 1 % larger with it, or its error at
        the rate at most 1 % greater; always; or never. Compact superframes of constant size are
        nothing without it.
    options : CueingOptions
        Under which the score's keys follow from its phones.

    Returns
    -------
    bytes

    Raises
    ------
    CueError
        If both or an impossible value is given, or the motion is empty or begins before 0.
    """
    return choose_stream(
        motion, voice, rate_bps=rate_bps, error_mm=error_mm, constant=constant, score=score,
        options=options,
    ).data  # fmt: skip


def choose_stream(
    motion: Motion,
    voice: Voice,
    *,
    rate_bps: float | None = None,
    error_mm: float | None = None,
    constant: bool = False,
    score: ScoreChoice = "auto",
    options: CueingOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
) -> ChosenStream:
    """Return a motion as a stream file, with what became of its score.

    Parameters
    ----------
    motion, voice, rate_bps, error_mm, constant, score, options
        As of `encode_stream`.
    progress : callable
        Called with the seconds of motion that were worked on: files take several rounds.

    Raises
    ------
    CueError
        As `encode_stream`.
    """
    head = _head_of(motion, coding_for(voice))
    if rate_bps is not None and error_mm is not None:
        raise CueError("a rate and an error cannot both be given")
    if constant and rate_bps is None:
        raise CueError("superframes of constant size need a rate")
    if rate_bps is not None and not MIN_RATE_BPS <= rate_bps <= MAX_RATE_BPS:
        raise CueError(f"rate {rate_bps} bit/s is not within {MIN_RATE_BPS}..{MAX_RATE_BPS}")
    if score not in get_args(ScoreChoice):
        raise CueError(f"score {score!r} is none of {', '.join(get_args(ScoreChoice))}")
    voice.check_motion(motion)
    if score == "drop":
        motion = replace(motion, score=None)
    if rate_bps is not None and constant:
        return _constant(motion, voice, head, rate_bps, score, options, progress)
    take = SpreadMotion(motion, voice, head.indices, options, progress)
    if rate_bps is not None:
        return _within_rate(motion, take, head, rate_bps, score, options)
    limit = 2.0 if error_mm is None else error_mm
    if not 0.05 <= limit <= 1000:
        raise CueError(f"error {limit} mm is not within 0.05..1000")
    return _of_records(head, spread(take, ByError(limit, len(head.indices), record_bytes), score))


def _constant(
    motion: Motion,
    voice: Voice,
    head: StreamHead,
    rate_bps: float,
    score: ScoreChoice,
    options: CueingOptions,
    progress: Progress,
) -> ChosenStream:
    """Return the file of superframes of one size."""
    size = int(rate_bps * SUPERFRAME_S / 8)

    def made(motion: Motion) -> bytes:
        if size <= MAX_BYTES:
            return _compact(motion, voice, head, size, options)
        encoder = SuperframeEncoder(voice, l0_bytes=size, l1_bytes=0, lead=0, options=options)
        body = bytearray()
        for index in head.indices:
            body += encoder.encode(motion, index).l0
            progress(SUPERFRAME_S)
        return _head_bytes(replace(head, l0=size)) + bytes(body)

    kept = made(motion)
    if motion.score is None or score == "keep" or size <= MAX_BYTES:
        return ChosenStream(kept, motion.score is not None, None)
    without = made(replace(motion, score=None))
    take = SpreadMotion(motion, voice, head.indices, options)
    errors = [take.error_of(np.stack(_drawn(data, voice)[0])) for data in (kept, without)]
    cost = errors[0] / errors[1] - 1
    return ChosenStream(kept if cost <= MOST_COST else without, cost <= MOST_COST, cost)


def _within_rate(
    motion: Motion,
    take: SpreadMotion,
    head: StreamHead,
    rate_bps: float,
    score: ScoreChoice,
    options: CueingOptions,
) -> ChosenStream:
    """Return the file of least error whose bytes keep a rate: spread, or compact if that fits."""
    room = int(rate_bps * motion.duration_s / 8) - FILE_BYTES - _CRC_BYTES
    compact = b""
    size = room // len(head.indices)
    if motion.score is not None and MIN_BYTES <= size <= MAX_BYTES:
        compact = _compact(motion, take.voice, head, size, options)
    try:
        found = spread(take, BySize(room - OVERHEAD_BYTES, len(head.indices), record_bytes), score)
    except CueError:
        if not compact:
            raise
        return ChosenStream(compact, scored=True, score_cost=None)
    if not compact:
        return _of_records(head, found)
    ratio = take.error_of(np.stack(_drawn(compact, take.voice)[0])) / take.error_of(found.blocks)
    if ratio > (1.0 if found.told else 1 + MOST_COST):
        return _of_records(head, found)
    # The cost of a score that was left out is that of the file without it: none.
    cost = found.cost if found.told else 0.0
    return ChosenStream(compact, True, None if cost is None else (1 + cost) * ratio - 1)


def _compact(
    motion: Motion, voice: Voice, head: StreamHead, size: int, options: CueingOptions
) -> bytes:
    encoder = CompactEncoder(voice, l0_bytes=size, options=options, first=head.indices.start)
    body = b"".join(encoder.encode(motion, index).l0 for index in head.indices)
    return _head_bytes(replace(head, l0=size)) + body


def _of_records(head: StreamHead, found: Spread) -> ChosenStream:
    data = write_records(_head_bytes(head), found.told, found.payloads)
    return ChosenStream(data, bool(found.told), found.cost)


def _head_of(motion: Motion, coding: Coding) -> StreamHead:
    first, ticks = to_ticks(motion.start_s), to_ticks(motion.duration_s)
    if first < 0 or not 0 < ticks <= _MAX_TICKS or first > _MAX_TICKS:
        raise CueError(
            f"motion of {motion.duration_s} s from {motion.start_s} s does not fit into a stream: "
            f"0.02..86400 s, from 0..86400 s"
        )
    return StreamHead(coding.identity, first, ticks)


def _head_bytes(head: StreamHead) -> bytes:
    fields = {
        "magic": MAGIC, "version": VERSION, "coding": int(head.coding, 16),
        "first_tick": head.first_tick, "ticks": head.ticks, "l0": head.l0, "l1": head.l1,
    }  # fmt: skip
    body = pack_fields(FILE_FIELDS, fields)
    return body + crc16(body).to_bytes(_CRC_BYTES, "big")


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
    head = StreamHead(
        f"{fields['coding']:016x}", fields["first_tick"], fields["ticks"], fields["l0"],
        fields["l1"],
    )  # fmt: skip
    if not 0 < head.ticks <= _MAX_TICKS or head.first_tick > _MAX_TICKS:
        raise BitstreamError(f"{head.ticks} ticks from {head.first_tick}", section="F5", bit=104)
    return head


def read_superframes(data: bytes) -> Iterator[Superframe]:
    """Yield the superframes of a stream file, their checksums not looked at.

    Those of a file with one score for all have their payload for L0 (F7).

    Raises
    ------
    BitstreamError
        As `read_head`; if the file ends within a superframe, or goes on after the last one (F6); if
        the check of a file with one score for all is wrong (F7).
    """
    head, place = read_head(data), FILE_BYTES + _CRC_BYTES
    if head.l0 == 0:
        _, payloads = read_records(data, place, len(head.indices))
        for index, payload in zip(head.indices, payloads, strict=True):
            yield Superframe(index, payload, b"")
        return
    for index in head.indices:
        middle, end = place + head.l0, place + head.l0 + head.l1
        if end > len(data):
            raise BitstreamError(f"superframe {index} is cut off", section="F6", bit=8 * place)
        yield Superframe(index, data[place:middle], data[middle:end])
        place = end
    if place != len(data):
        raise BitstreamError(f"{len(data) - place} bytes too many", section="F6", bit=8 * place)


def told_by(data: bytes, language: Language | None = None) -> FileScore:
    """Return a file's common data (F8), nothing if its superframes stand alone.

    Parameters
    ----------
    data : bytes
    language : Language, optional
        Of its tables; default: French.

    Raises
    ------
    BitstreamError
        As `read_superframes`; if its score has no end (F10).
    """
    head = read_head(data)
    if head.l0:
        return NOTHING_TOLD
    told, _ = read_records(data, FILE_BYTES + _CRC_BYTES, len(head.indices))
    return read_told(told, head.indices, language or french())


def decode_stream(data: bytes, voice: Voice) -> Motion:
    """Return the motion of a stream file, at 50 Hz.

    Superframes with a wrong checksum are concealed.

    Parameters
    ----------
    data : bytes
        A whole file.
    voice : Voice
        That of the motion.

    Returns
    -------
    Motion

    Raises
    ------
    BitstreamError
        If the file breaks a rule.
    VoiceError
        If it was made with another voice or with other coding tables.
    """
    head = read_head(data)
    if head.coding != coding_for(voice).identity:
        raise VoiceError(
            f"stream coded with tables {head.coding}, those of voice {voice.name} here are "
            f"{coding_for(voice).identity}"
        )
    blocks, score = _drawn(data, voice)
    params = np.concatenate(blocks).clip(-MOST_PARAM, MOST_PARAM)
    skip = head.first_tick % TICKS
    return Motion(
        params[skip : skip + head.ticks].astype(np.float32), RATE_HZ, head.first_tick * TICK_S,
        voice.layout, voice.identity, score,
    )  # fmt: skip


def _drawn(data: bytes, voice: Voice) -> tuple[Sequence[Array], Score | None]:
    """Return the parameters of a file's superframes, and its score."""
    if read_head(data).l0 == 0:
        return _of_file(data, voice)
    done = _decoded(data, voice)
    told = any(frame.part is not None for frame in done)
    blocks = [frame.params.astype(np.float64) for frame in done]
    return blocks, merge_scores(done) if told else None


def _of_file(data: bytes, voice: Voice) -> tuple[Sequence[Array], Score | None]:
    """Return the same of a file with one score for all (F7 to F11)."""
    coding, indices = coding_for(voice), read_head(data).indices
    told = told_by(data, coding.language)
    if told.line is None:
        plain = [block_of(frame.l0, None, coding) for frame in read_superframes(data)]
        return plain, None
    joined = line_of(told.line, indices, told.options)
    learner = Learner(WholeResynthesis(joined, coding.targets), coding)
    blocks = []
    for frame in read_superframes(data):
        blocks.append(block_of(frame.l0, partial(learner.params, frame.index), coding))
        if told.learning:
            learner.take(frame.index, blocks[-1])
    return blocks, joined.score()


def _decoded(data: bytes, voice: Voice) -> list[DecodedSuperframe]:
    """Return the superframes of a file, each with its neighbours known."""
    decoder, done, previous = SuperframeDecoder(voice), list[DecodedSuperframe](), None
    for frame in read_superframes(data):
        decoder.take(frame.l0, frame.l1, frame.index)
        if previous is not None:
            done.append(decoder.render(previous))
        previous = frame.index
    if previous is not None:
        done.append(decoder.render(previous))
    return done
