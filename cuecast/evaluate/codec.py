"""Evaluation of the codec: rate and error beside other codecs and the Gaussian bound.

The material are sentences that were kept from training, performed by the built-in cuer, or the
motions (``*.npz``) of a folder. Rates of the codec count every byte of its superframes: headers,
checksums and terminations too.
"""

import bisect
from collections.abc import Iterator, Sequence, Set
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.layout import N_FACE
from codec.merge import merge_scores
from codec.motion import Motion, load_motion
from codec.score import Key
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
KEY_TOLERANCE_S = 0.101
"""How much too early or late a key may be: what a viewer does not take for wrong."""

STANDARD_BYTES = (20, 7)
"""Parts of a superframe in the standard profile of the sound carrier."""

COMPACT_BYTES = (5, 6, 7, 9, 12)
"""Sizes of compact superframes; 7 is that of the sound carrier's robust profile."""

REPEATS = 5
"""Patterns of losses over which the error is averaged."""

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
    for protected in (True, False):
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
                for repeat in range(REPEATS)
            ]  # fmt: skip
            squares = np.concatenate([squares for _, squares, _, _, _ in tries])
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


Outcome = tuple[float, Array, int, int, int]
"""Rate, squared distances (T, 113), keys sent, received right, and received that were not sent."""


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
    squares = _squares(voice, motion.params, np.concatenate([frame.params for frame in done]))
    end = len(frames) * SUPERFRAME_S
    sent = [key for key in motion.score.keys if key.start < end] if motion.score else []
    got = list(merge_scores(done).keys)
    right = _matched(sent, got)
    size = sum(len(frame.l0) + len(frame.l1) for frame in frames)
    return 8 * size / end, squares, len(sent), right, len(got) - _matched(got, sent)


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


def _row(
    name: str, bps: float, squares: Array, sent: int = 0, right: int = 0, wrong: int = 0
) -> Row:
    def rms(part: Array) -> float:
        return round(float(np.sqrt(part.mean())), 3)

    return {
        "codec": name, "bps": round(bps, 1), "marker_rms_mm": rms(squares),
        "hand_rms_mm": rms(squares[:, N_FACE:]), "face_rms_mm": rms(squares[:, :N_FACE]),
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
