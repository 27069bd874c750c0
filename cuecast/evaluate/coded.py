"""What becomes of a motion that is coded and perhaps loses parts: rate, error, keys."""

import bisect
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.layout import N_FACE
from codec.cuer.models import rigid
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key
from codec.cues.timeline import SUPERFRAME_S
from codec.streamfile.content import common_data, read_superframes
from codec.streamfile.stream import decode_stream, encode_stream
from codec.superframe.bits import HEADER_BYTES, PLAIN, SCORE
from codec.superframe.checks import CRC16_BYTES
from codec.superframe.coding import coding_for
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.payload import CRC8_BYTES, read_beginning, score_code
from codec.superframe.range_coder import RangeDecoder
from codec.superframe.settings import read_setting, setting_bits
from codec.superframe.superframe import DecodedSuperframe, Superframe, merge_scores, resynthesis_of
from codec.superframe.window import MAX_BYTES
from codec.training.coding_tables import blocks_of, near, parts_of

Array = NDArray[np.float64]
Row = dict[str, Any]

_SKULL = layout.marker_indices(layout.RIGID_FACE)

KEY_TOLERANCE_S = 0.101
"""How much too early or late a key may be: a viewer does not take this for wrong."""


@dataclass(frozen=True, slots=True)
class CodedMotion:
    """What became of a motion.

    Attributes
    ----------
    bps : float
        Rate.
    residual_bps : float or None
        What of it coefficients take, if there is a score.
    squares : ndarray of float64, shape (113,)
        Mean squared distance of each marker.
    sent, right, wrong : int
        Keys sent, received right, and received that were not sent.
    articulation_mm : float or None
        Error of the face in the head's frame.
    """

    bps: float
    squares: Array
    sent: int = 0
    right: int = 0
    wrong: int = 0
    articulation_mm: float | None = None
    residual_bps: float | None = None


def coded(voice: Voice, motion: Motion, count: int, size: int) -> CodedMotion:
    """Return what becomes of the first `count` superframes at `size` bytes each."""
    encoder = (
        CompactEncoder(voice, l0_bytes=size)
        if size <= MAX_BYTES
        else SuperframeEncoder(voice, l0_bytes=size, l1_bytes=0)
    )
    frames = [encoder.encode(motion, k) for k in range(count)]
    outcome = decoded(voice, motion, frames)
    params = np.concatenate([done.params for done in _received(voice, frames)])
    return replace(
        outcome,
        articulation_mm=_articulation_mm(voice, motion.params, params),
        residual_bps=_residual_bps(frames),
    )


def coded_within(voice: Voice, motion: Motion, error_mm: float) -> CodedMotion:
    """Return what becomes of a motion in a file that keeps an error: superframes of any length."""
    data = encode_stream(motion, voice, error_mm=error_mm, score="keep")
    found, frames = decode_stream(data, voice), list(read_superframes(data))
    squares = squares_of(voice, motion.params, found.params)
    end = len(frames) * SUPERFRAME_S
    sent = [key for key in motion.score.keys if key.start < end] if motion.score else []
    keys = found.score.keys if found.score else ()
    mode = PLAIN if common_data(data).line is None else SCORE
    settings = sum(setting_bits(read_setting(RangeDecoder(f.l0), mode), mode) for f in frames)
    residual = (8 * sum(len(frame.l0) for frame in frames) - settings) / end
    return CodedMotion(8 * len(data) / end, squares, *counted(sent, keys), residual_bps=residual)


def _residual_bps(frames: Sequence[Superframe]) -> float | None:
    """Return the rate of coefficients: what headers, checks, settings and scores leave."""
    contents = [read_beginning(frame.l0) for frame in frames]
    if any(content.header.mode != SCORE for content in contents):
        return None
    scored = sum(score_code(content, even=False).bits for content in contents)
    fixed = HEADER_BYTES + CRC16_BYTES
    left = sum(len(f.l0) - fixed + max(len(f.l1) - CRC8_BYTES, 0) for f in frames)
    return float((8 * left - scored) / (len(frames) * SUPERFRAME_S))


def _received(
    voice: Voice,
    frames: Sequence[Superframe],
    lost: Set[int] = frozenset(),
    lost_l1: Set[int] = frozenset(),
) -> list[DecodedSuperframe]:
    decoder = SuperframeDecoder(voice)
    done = []
    for frame in frames:
        l0 = frame.l0 if frame.index not in lost else None
        l1 = frame.l1 if frame.index not in lost_l1 else None
        decoder.push(l0, l1, frame.index)
        if frame.index > 0:
            done.append(decoder.render(frame.index - 1))
    done.append(decoder.render(frames[-1].index))
    return done


def decoded(
    voice: Voice,
    motion: Motion,
    frames: Sequence[Superframe],
    lost: Set[int] = frozenset(),
    lost_l1: Set[int] = frozenset(),
) -> CodedMotion:
    """Return the superframes received when some lose L0 or L1."""
    done = _received(voice, frames, lost, lost_l1)
    squares = squares_of(voice, motion.params, np.concatenate([frame.params for frame in done]))
    end = len(frames) * SUPERFRAME_S
    size = sum(len(frame.l0) + len(frame.l1) for frame in frames)
    sent = [key for key in motion.score.keys if key.start < end] if motion.score else []
    return CodedMotion(8 * size / end, squares, *counted(sent, merge_scores(done).keys))


def counted(sent: Sequence[Key], got: Sequence[Key]) -> tuple[int, int, int]:
    """Return the numbers of keys sent, received right, and received that were not sent."""
    return len(sent), _matched(sent, got), len(got) - _matched(got, sent)


def _matched(keys: Sequence[Key], others: Sequence[Key]) -> int:
    """Return how many keys have their like among others, at most `KEY_TOLERANCE_S` away."""
    times = [key.start for key in others]
    matched = 0
    for key in keys:
        first = bisect.bisect_left(times, key.start - KEY_TOLERANCE_S)
        last = bisect.bisect_right(times, key.start + KEY_TOLERANCE_S)
        matched += any(str(other) == str(key) for other in others[first:last])
    return matched


def squares_of(
    voice: Voice, a: Array | NDArray[np.float32], b: Array | NDArray[np.float32]
) -> Array:
    """Return the mean squared distance of each marker, shape (113,)."""
    n = min(len(a), len(b))
    gap = voice.reconstruct(a[:n]).astype(np.float64) - voice.reconstruct(b[:n])
    squares: Array = np.square(gap).sum(axis=-1).mean(axis=0)
    return squares


def _articulation_mm(voice: Voice, a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    """Return the RMS distance of two faces, each moved to where its skull is at rest."""
    n = min(len(a), len(b))
    rest = voice.face.mean[_SKULL].astype(np.float64)
    faces = []
    for params in (a[:n], b[:n]):
        face = voice.reconstruct(params)[:, :N_FACE].astype(np.float64)
        motion, _ = rigid.estimate_motion(rest, face[:, _SKULL])
        faces.append(rigid.inverse_rigid_motion(face, motion))
    return float(np.sqrt(np.square(faces[0] - faces[1]).sum(axis=-1).mean()))


def row_of(name: str, *outcomes: CodedMotion) -> Row:
    """Return the row of one outcome, or of several on the same motion together."""
    squares = np.mean([one.squares for one in outcomes], axis=0)
    first = outcomes[0]

    def rms(part: Array) -> float:
        return round(float(np.sqrt(part.mean())), 3)

    def rounded(value: float | None, digits: int) -> float | None:
        return None if value is None else round(value, digits)

    return {
        "codec": name,
        "bps": round(first.bps, 1),
        "marker_rms_mm": rms(squares),
        "hand_rms_mm": rms(squares[N_FACE:]),
        "face_rms_mm": rms(squares[:N_FACE]),
        "articulation_rms_mm": rounded(first.articulation_mm, 3),
        "residual_bps": rounded(first.residual_bps, 1),
        "keys_total": sum(one.sent for one in outcomes),
        "keys_correct": sum(one.right for one in outcomes),
        "keys_wrong": sum(one.wrong for one in outcomes),
        "loss": 0.0,
    }


def lacking(voice: Voice, motion: Motion) -> Array:
    """Return what resynthesis from a motion's whole score lacks of it, shape (T, P)."""
    blocks = blocks_of(motion)
    parts, coding = parts_of(motion, len(blocks)), coding_for(voice)
    predicted = [resynthesis_of(coding, near(parts, k), k).params() for k in range(len(blocks))]
    return np.asarray(np.concatenate(list(blocks)) - np.concatenate(predicted))
