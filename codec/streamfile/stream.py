"""Stream files (``.cue``): a motion as superframes one after another.

A head names the coding, the span of ticks and the lengths of the parts; superframes follow, as they
would be on air. Where the head states no lengths, they vary in size, and the score is encoded
once for all (`codec.streamfile.records`, `codec.streamfile.file_score`).
Specification: spec/bitstream.md, section 8.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import MOST_PARAM, Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.cues.timeline import SUPERFRAME_S, TICK_S, TICKS, to_ticks
from codec.errors import CueError, VoiceError, check_kind
from codec.streamfile.content import (
    HEAD_BYTES,
    MAX_TICKS,
    StreamHead,
    common_data,
    read_head,
    read_superframes,
    write_head,
)
from codec.streamfile.learning import Learner
from codec.streamfile.records import OVERHEAD_BYTES, record_bytes, write_records
from codec.streamfile.spread import MOST_COST, ByError, BySize, ScoreChoice, spread
from codec.streamfile.versions import Progress, Spread, SpreadMotion, line_of, silent
from codec.streamfile.whole_score import WholeResynthesis
from codec.superframe.coding import Coding, coding_for
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder, block_of
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import DecodedSuperframe, merge_scores
from codec.superframe.window import MAX_BYTES, MIN_BYTES

Array = NDArray[np.float64]

RATE_HZ = 50.0
"""Frames per second of decoded motion."""

MIN_RATE_BPS = 60
"""Least rate of a file in bit/s."""

MAX_RATE_BPS = 20_000
"""Largest rate of a file in bit/s."""


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
        Code the score, and so the keys, if the file is at most 1 % larger with it, or its error at
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

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> encode_stream(motion_of(score_of_text("Oui"), voice), voice, error_mm=4.0)[:4]
    b'CUES'
    """
    return choose_stream(
        motion,
        voice,
        rate_bps=rate_bps,
        error_mm=error_mm,
        constant=constant,
        score=score,
        options=options,
    ).data


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
    check_kind(motion, Motion, "encode_stream", "motion_of and load_motion make one")
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
        return write_head(replace(head, l0=size)) + bytes(body)

    # A score takes bytes from the residual: with "auto" it is dropped where the error without it is
    # smaller by more than MOST_COST. Compact files are made of the score and always keep it.
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
    room = int(rate_bps * motion.duration_s / 8) - HEAD_BYTES
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
    if ratio > (1.0 if found.common else 1 + MOST_COST):
        return _of_records(head, found)
    # The cost of a score that was left out is that of the file without it: none.
    cost = found.cost if found.common else 0.0
    return ChosenStream(compact, True, None if cost is None else (1 + cost) * ratio - 1)


def _compact(
    motion: Motion, voice: Voice, head: StreamHead, size: int, options: CueingOptions
) -> bytes:
    encoder = CompactEncoder(voice, l0_bytes=size, options=options, first=head.indices.start)
    body = b"".join(encoder.encode(motion, index).l0 for index in head.indices)
    return write_head(replace(head, l0=size)) + body


def _of_records(head: StreamHead, found: Spread) -> ChosenStream:
    data = write_records(write_head(head), found.common, found.payloads)
    return ChosenStream(data, bool(found.common), found.cost)


def _head_of(motion: Motion, coding: Coding) -> StreamHead:
    first, ticks = to_ticks(motion.start_s), to_ticks(motion.duration_s)
    if first < 0 or not 0 < ticks <= MAX_TICKS or first > MAX_TICKS:
        raise CueError(
            f"motion of {motion.duration_s} s from {motion.start_s} s does not fit into a stream: "
            f"0.02..86400 s, from 0..86400 s"
        )
    return StreamHead(coding.identity, first, ticks)


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

    Examples
    --------
    >>> from codec import encode_stream, load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> stream = encode_stream(motion_of(score_of_text("Oui"), voice), voice, error_mm=4.0)
    >>> [str(key) for key in decode_stream(stream, voice).score.keys]
    ['26']
    """
    check_kind(data, bytes, "decode_stream", "the content of a file, not its name")
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
        params[skip : skip + head.ticks].astype(np.float32),
        RATE_HZ,
        head.first_tick * TICK_S,
        voice.layout,
        voice.identity,
        score,
    )


def _drawn(data: bytes, voice: Voice) -> tuple[Sequence[Array], Score | None]:
    """Return the parameters of a file's superframes, and its score."""
    if read_head(data).l0 == 0:
        return _of_file(data, voice)
    done = _decoded(data, voice)
    scored = any(frame.part is not None for frame in done)
    blocks = [frame.params.astype(np.float64) for frame in done]
    return blocks, merge_scores(done) if scored else None


def _of_file(data: bytes, voice: Voice) -> tuple[Sequence[Array], Score | None]:
    """Return the same of a file with one score for all (F7 to F11)."""
    coding, indices = coding_for(voice), read_head(data).indices
    common = common_data(data, coding.language)
    if common.line is None:
        plain = [block_of(frame.l0, None, coding) for frame in read_superframes(data)]
        return plain, None
    joined = line_of(common.line, indices, common.options)
    learner = Learner(WholeResynthesis(joined, coding.targets), coding)
    blocks = []
    for frame in read_superframes(data):
        blocks.append(block_of(frame.l0, partial(learner.params, frame.index), coding))
        if common.learning:
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
