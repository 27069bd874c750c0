"""Evaluation of the codec: rate and error beside other codecs and the Gaussian bound.

The material are sentences that were kept from training, performed by the built-in cuer, or the
motions (``*.npz``) of a folder. Rates of the codec count every byte of its superframes: headers,
checksums and terminations too.
"""

import bisect
import itertools
from collections.abc import Iterator, Sequence, Set
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec import layout
from codec.decoder import SuperframeDecoder
from codec.encoder import SuperframeEncoder
from codec.layout import N_FACE
from codec.merge import merge_scores
from codec.models import rigid
from codec.motion import Motion, load_motion
from codec.score import Key
from codec.superframe import Superframe
from codec.timeline import SUPERFRAME_S, TICKS
from codec.voice import Voice, load_voice
from cuecast.evaluate.baselines import BASELINES, Material
from cuecast.evaluate.bound import bound_of
from cuecast.evaluate.options import EvaluateOptions
from synth.build_coding import imprecise, perform, recital, sentences
from synth.movement import LAWS

Array = NDArray[np.float64]
Row = dict[str, Any]

RATES_BPS = (150, 200, 250, 337.5, 450, 600, 900, 1500, 3000, 6000)
STEPS_MM = (4.0, 6.0, 9.0, 13.0, 19.0, 28.0)
LOSSES = (0.05, 0.1, 0.2)
_SKULL = layout.marker_indices(layout.RIGID_FACE)

KEY_TOLERANCE_S = 0.101
"""How much too early or late a key may be: what a viewer does not take for wrong."""

STANDARD_BYTES = (20, 7)
"""Parts of a superframe in the standard profile of the sound carrier."""

COMPACT_BYTES = (5, 6, 7, 9, 12)
"""Sizes of compact superframes; 7 is that of the sound carrier's robust profile."""

REPEATS = 12
"""Patterns of losses over which the error is averaged; two without previews."""

_TRAINING_SENTENCES = 60
_FEW = 20
_LONG = 10_000
"""Frames of a motion from which losses tell anything."""

BUILT_IN = "minimum-jerk"
"""Name of the data that the baselines are measured on as well."""


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row per codec and rate, and per loss of superframes."""
    voice = load_voice()
    training = recital(sentences()[:_TRAINING_SENTENCES], seed=options.seed)
    train = perform(voice, training, seed=options.seed + 1).params.astype(np.float64)
    rows: list[Row] = []
    for name, motion in _material(voice, options):
        options.say(f"{name}: {len(motion.params) / motion.rate_hz:.0f} s of motion")
        test = motion.params[: len(motion.params) // TICKS * TICKS].astype(np.float64)
        bound = bound_of(test, voice)
        found = _codec_rows(voice, motion, options)
        if name in (BUILT_IN, *_clips(options)):
            found = itertools.chain(found, _others(voice, train, test))
        for row in found:
            bps = bound.rate_bps(row["marker_rms_mm"])
            rows.append(row | {"data": name, "bound_bps": round(bps, 1)})
    return rows


def _clips(options: EvaluateOptions) -> list[str]:
    return [path.stem for path in sorted(options.clips.glob("*.npz"))] if options.clips else []


def _material(voice: Voice, options: EvaluateOptions) -> Iterator[tuple[str, Motion]]:
    """Yield motions with their names.

    The built-in cuer performs sentences that were kept from training, exactly and, fewer of
    them, by other laws of movement and imprecisely.
    """
    if options.clips is not None:
        for name in _clips(options):
            yield name, load_motion(options.clips / f"{name}.npz")
        return
    kept = sentences(held_out=True)
    yield BUILT_IN, perform(voice, recital(kept, seed=options.seed), seed=options.seed)
    score = recital(kept[:_FEW], seed=options.seed + 1)
    for law in LAWS:
        if law != "minimum-jerk":
            yield law, perform(voice, score, seed=options.seed, law=law)
        yield f"imprecise {law}", imprecise(voice, score, seed=options.seed, law=law)


def _codec_rows(voice: Voice, motion: Motion, options: EvaluateOptions) -> Iterator[Row]:
    count = len(motion.params) // TICKS
    if motion.score is not None:
        for size in COMPACT_BYTES:
            options.say(f"cuecast in {size} bytes")
            yield _row("cuecast-compact", *_coded(voice, motion, count, size))
    for rate in RATES_BPS:
        options.say(f"cuecast at {rate} bit/s")
        yield _row("cuecast", *_coded(voice, motion, count, int(rate * SUPERFRAME_S / 8)))
    plain = Motion(motion.params, motion.rate_hz, motion.start_s, motion.layout, motion.voice)
    for rate in RATES_BPS[3:]:
        options.say(f"cuecast without a score at {rate} bit/s")
        yield _row("cuecast-plain", *_coded(voice, plain, count, int(rate * SUPERFRAME_S / 8)))
    for protected in (True, False) if len(motion.params) > _LONG else ():
        yield from _loss_rows(voice, motion, count, options, protected=protected)


def _loss_rows(
    voice: Voice, motion: Motion, count: int, options: EvaluateOptions, *, protected: bool
) -> Iterator[Row]:
    """Yield the rows of losses of parts: each L0 and each L1 is lost for itself."""
    l0, l1 = STANDARD_BYTES
    encoder = SuperframeEncoder(voice, l0_bytes=l0, l1_bytes=l1, protected=protected)
    frames = [encoder.encode(motion, k) for k in range(count)]
    name = "cuecast-protected" if protected else "cuecast-unprotected"
    yield _row(name, *_decoded(voice, motion, frames))
    for burst in (1, 2):
        for loss in LOSSES:
            options.say(f"{name} with losses of {loss:.0%} in runs of {burst}")
            tries = [
                _decoded(voice, motion, frames, *(
                    losses(count, loss, burst=burst, seed=[options.seed, repeat, part])
                    for part in (0, 1)
                ))
                for repeat in range(REPEATS if protected else 2)
            ]  # fmt: skip
            squares = np.concatenate([one[1] for one in tries])
            sent, right, wrong = (sum(one[i] for one in tries) for i in (2, 3, 4))
            row = _row(name if burst == 1 else f"{name}-bursts", tries[0][0], squares)
            keys = {"keys_total": sent, "keys_correct": right, "keys_wrong": wrong}
            yield row | keys | {"loss": loss}


def losses(count: int, share: float, *, burst: int, seed: list[int]) -> set[int]:
    """Return the numbers of lost superframes: runs of `burst`, `share` of all in the mean."""
    rng = np.random.default_rng([*seed, burst, round(1000 * share)])
    # Runs overlap: the share of those that begin is less than the quotient.
    begin = 1.0 - (1.0 - share) ** (1.0 / burst)
    starts = np.flatnonzero(rng.random(count) < begin)
    return {int(k) + i for k in starts for i in range(burst)}


Outcome = tuple[float, Array, int, int, int, float]
"""Rate, squared distances (T, 113), keys sent, received right, and received that were not sent, and
the face's error in the head's frame, mm."""


def _coded(voice: Voice, motion: Motion, count: int, size: int) -> Outcome:
    encoder = SuperframeEncoder(voice, l0_bytes=size, l1_bytes=0)
    return _decoded(voice, motion, [encoder.encode(motion, k) for k in range(count)])


def _decoded(
    voice: Voice,
    motion: Motion,
    frames: list[Superframe],
    lost: Set[int] = frozenset(),
    lost_l1: Set[int] = frozenset(),
) -> Outcome:
    decoder = SuperframeDecoder(voice)
    done = []
    for frame in frames:
        l0 = frame.l0 if frame.index not in lost else None
        l1 = frame.l1 if frame.index not in lost_l1 else None
        decoder.push(l0, l1, frame.index)
        if frame.index > 0:
            done.append(decoder.render(frame.index - 1))
    done.append(decoder.render(frames[-1].index))
    got_params = np.concatenate([frame.params for frame in done])
    squares = _squares(voice, motion.params, got_params)
    face_mm = _articulation_mm(voice, motion.params, got_params)
    end = len(frames) * SUPERFRAME_S
    sent = [key for key in motion.score.keys if key.start < end] if motion.score else []
    got = list(merge_scores(done).keys)
    right = _matched(sent, got)
    size = sum(len(frame.l0) + len(frame.l1) for frame in frames)
    return 8 * size / end, squares, len(sent), right, len(got) - _matched(got, sent), face_mm


def _matched(keys: Sequence[Key], others: Sequence[Key]) -> int:
    """Return how many keys have their like among others, at most `KEY_TOLERANCE_S` away."""
    times = [key.start for key in others]
    matched = 0
    for key in keys:
        first = bisect.bisect_left(times, key.start - KEY_TOLERANCE_S)
        last = bisect.bisect_right(times, key.start + KEY_TOLERANCE_S)
        matched += any(str(other) == str(key) for other in others[first:last])
    return matched


def _squares(voice: Voice, a: Array | NDArray[np.float32], b: Array | NDArray[np.float32]) -> Array:
    n = min(len(a), len(b))
    gap = voice.reconstruct(a[:n]).astype(np.float64) - voice.reconstruct(b[:n])
    squares: Array = np.square(gap).sum(axis=-1)
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


def _row(
    name: str, bps: float, squares: Array, sent: int = 0, right: int = 0, wrong: int = 0,
    articulation_mm: float | None = None,
) -> Row:  # fmt: skip
    def rms(part: Array) -> float:
        return round(float(np.sqrt(part.mean())), 3)

    return {
        "codec": name, "bps": round(bps, 1), "marker_rms_mm": rms(squares),
        "hand_rms_mm": rms(squares[:, N_FACE:]), "face_rms_mm": rms(squares[:, :N_FACE]),
        "articulation_rms_mm": None if articulation_mm is None else round(articulation_mm, 3),
        "keys_total": sent, "keys_correct": right, "keys_wrong": wrong, "loss": 0.0,
    }  # fmt: skip


def _others(voice: Voice, train: Array, test: Array) -> Iterator[Row]:
    material = Material.of(train, test, voice)
    for name, code in BASELINES.items():
        for step in STEPS_MM if name != "raw-8bit" else STEPS_MM[:1]:
            bps, decoded = code(material, step)
            yield _row(name, bps, _squares(voice, test, decoded))


def plot(results: list[Row], figure: Any) -> None:
    """Draw rate against error into a matplotlib figure."""
    axes = figure.subplots()
    loss_free = [row for row in results if not row["loss"]]
    first = loss_free[0].get("data")
    for data, name in dict.fromkeys((row.get("data"), row["codec"]) for row in loss_free):
        if data != first and name != "cuecast":
            continue
        rows = sorted(
            (row for row in loss_free if (row.get("data"), row["codec"]) == (data, name)),
            key=lambda row: row["bps"],
        )
        axes.loglog(
            [row["marker_rms_mm"] for row in rows], [row["bps"] for row in rows],
            ".-" if data == first else ".:", label=name if data == first else f"{name}, {data}",
        )  # fmt: skip
    rows = sorted(
        (row for row in results if row.get("data") == first), key=lambda row: row["marker_rms_mm"]
    )
    axes.loglog(
        [row["marker_rms_mm"] for row in rows], [max(row["bound_bps"], 1.0) for row in rows],
        "k--", label="Gaussian bound",
    )  # fmt: skip
    axes.set_ylim(bottom=40.0)
    axes.set_xlabel("marker error, mm RMS")
    axes.set_ylabel("rate, bit/s")
    axes.legend(fontsize="x-small")
    axes.grid(True, which="both", alpha=0.3)
