"""Evaluation of the codec: rate and error beside other codecs and the Gaussian bound.

The material are sentences that were kept from training, performed by the built-in cuer, or the
motions (``*.npz``) of a folder. Rates of the codec count every byte of its superframes: headers,
checksums and terminations too.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.layout import N_FACE
from codec.merge import merge_scores
from codec.motion import Motion, load_motion
from codec.quantise import NO_RESIDUAL
from codec.superframe import Superframe, SuperframeDecoder, SuperframeEncoder
from codec.timeline import SUPERFRAME_S, TICKS
from codec.voice import Voice, load_voice
from cuecast.evaluate.baselines import BASELINES, Material
from cuecast.evaluate.bound import bound_of
from cuecast.evaluate.options import EvaluateOptions
from synth.build_coding import perform, recital, sentences

Array = NDArray[np.float64]
Row = dict[str, Any]

RATES_BPS = (150, 200, 250, 337.5, 450, 600, 900, 1500, 3000, 6000)
STEPS_MM = (4.0, 6.0, 9.0, 13.0, 19.0, 28.0)
LOSSES = (0.05, 0.1, 0.2)
STANDARD_BYTES = (20, 7)
"""Parts of a superframe in the standard profile of the sound carrier."""

_SCORE_ONLY_BYTES = 24
_TRAINING_SENTENCES = 60


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row per codec and rate, and per loss of superframes."""
    voice = load_voice()
    motions = _material(voice, options)
    options.say(f"{sum(len(m.params) for m in motions) / 50:.0f} s of motion")
    training = recital(sentences()[:_TRAINING_SENTENCES], seed=options.seed)
    train = perform(voice, training, seed=options.seed + 1).params.astype(np.float64)
    rows: list[Row] = []
    for motion in motions:
        test = motion.params[: len(motion.params) // TICKS * TICKS].astype(np.float64)
        bound = bound_of(test, voice)
        for row in [*_codec_rows(voice, motion, options), *_others(voice, train, test)]:
            rows.append(row | {"bound_bps": round(bound.rate_bps(row["marker_rms_mm"]), 1)})
    return rows


def _material(voice: Voice, options: EvaluateOptions) -> list[Motion]:
    if options.clips is not None:
        return [load_motion(path) for path in sorted(options.clips.glob("*.npz"))]
    score = recital(sentences(held_out=True), seed=options.seed)
    return [perform(voice, score, seed=options.seed)]


def _codec_rows(voice: Voice, motion: Motion, options: EvaluateOptions) -> Iterator[Row]:
    count = len(motion.params) // TICKS
    options.say("score alone")
    alone = SuperframeEncoder(voice, l0_bytes=_SCORE_ONLY_BYTES, l1_bytes=0, score_only=True)
    frames = [alone.encode_at(motion, k, NO_RESIDUAL) for k in range(count)]
    yield _row("cuecast-score-only", *_decoded(voice, motion, frames, set()))
    for rate in RATES_BPS:
        options.say(f"cuecast at {rate} bit/s")
        yield _row("cuecast", *_coded(voice, motion, count, int(rate * SUPERFRAME_S / 8)))
    plain = Motion(motion.params, motion.rate_hz, motion.start_s, motion.layout, motion.voice)
    for rate in RATES_BPS[3:]:
        options.say(f"cuecast without a score at {rate} bit/s")
        yield _row("cuecast-plain", *_coded(voice, plain, count, int(rate * SUPERFRAME_S / 8)))
    encoder = SuperframeEncoder(voice, l0_bytes=STANDARD_BYTES[0], l1_bytes=STANDARD_BYTES[1])
    frames = [encoder.encode(motion, k) for k in range(count)]
    for burst in (1, 2):
        for loss in (0.0, *LOSSES) if burst == 1 else LOSSES:
            lost = losses(count, loss, burst=burst, seed=options.seed)
            name = "cuecast-standard" if burst == 1 else "cuecast-standard-bursts"
            yield _row(name, *_decoded(voice, motion, frames, lost)) | {"loss": loss}


def losses(count: int, share: float, *, burst: int, seed: int) -> set[int]:
    """Return the numbers of lost superframes: runs of `burst`, `share` of all in the mean."""
    rng = np.random.default_rng([seed, burst, round(1000 * share)])
    starts = np.flatnonzero(rng.random(count) < share / burst)
    return {int(k) + i for k in starts for i in range(burst)}


def _coded(voice: Voice, motion: Motion, count: int, size: int) -> tuple[float, Array, int, int]:
    encoder = SuperframeEncoder(voice, l0_bytes=size, l1_bytes=0)
    return _decoded(voice, motion, [encoder.encode(motion, k) for k in range(count)], set())


def _decoded(
    voice: Voice, motion: Motion, frames: list[Superframe], lost: set[int]
) -> tuple[float, Array, int, int]:
    """Return rate, squared distances (T, 113), keys sent and keys received right."""
    decoder = SuperframeDecoder(voice)
    done = []
    for frame in frames:
        arrived = frame.index not in lost
        decoder.push(frame.l0 if arrived else None, frame.l1 if arrived else None, frame.index)
        if frame.index > 0:
            done.append(decoder.render(frame.index - 1))
    done.append(decoder.render(frames[-1].index))
    squares = _squares(voice, motion.params, np.concatenate([frame.params for frame in done]))
    end = len(frames) * SUPERFRAME_S
    sent = [k for k in motion.score.keys if k.start < end] if motion.score else []
    got = {(round(k.start, 2), str(k)) for k in merge_scores(done).keys}
    right = sum((round(k.start, 2), str(k)) in got for k in sent)
    size = sum(len(frame.l0) + len(frame.l1) for frame in frames)
    return 8 * size / end, squares, len(sent), right


def _squares(voice: Voice, a: Array | NDArray[np.float32], b: Array | NDArray[np.float32]) -> Array:
    n = min(len(a), len(b))
    gap = voice.reconstruct(a[:n]).astype(np.float64) - voice.reconstruct(b[:n])
    squares: Array = np.square(gap).sum(axis=-1)
    return squares


def _row(name: str, bps: float, squares: Array, sent: int = 0, right: int = 0) -> Row:
    def rms(part: Array) -> float:
        return round(float(np.sqrt(part.mean())), 3)

    return {
        "codec": name, "bps": round(bps, 1), "marker_rms_mm": rms(squares),
        "hand_rms_mm": rms(squares[:, N_FACE:]), "face_rms_mm": rms(squares[:, :N_FACE]),
        "keys_total": sent, "keys_correct": right, "loss": 0.0,
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
    names = dict.fromkeys(row["codec"] for row in results if not row["loss"])
    for name in names:
        rows = sorted(
            (row for row in results if row["codec"] == name and not row["loss"]),
            key=lambda row: row["bps"],
        )
        axes.loglog(
            [row["marker_rms_mm"] for row in rows], [row["bps"] for row in rows], ".-", label=name
        )
    rows = sorted(results, key=lambda row: row["marker_rms_mm"])
    axes.loglog(
        [row["marker_rms_mm"] for row in rows], [max(row["bound_bps"], 1.0) for row in rows],
        "k--", label="Gaussian bound",
    )  # fmt: skip
    axes.set_xlabel("marker error, mm RMS")
    axes.set_ylabel("rate, bit/s")
    axes.legend()
    axes.grid(True, which="both", alpha=0.3)
