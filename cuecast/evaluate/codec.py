"""Evaluation of the codec: rate and error beside other codecs and the Gaussian bound.

The material are sentences that were kept from training, performed by the voice's virtual cuer, or
the motions (``*.npz``) of a folder. Rates of the codec count every byte of its superframes:
headers, checksums and terminations too.

Two bounds go with each rate: that of a Gaussian process with the motion's spectra, which knows
nothing of the score, and, for superframes with a score, that of the residual
(`residual_bound_bps`, to be compared with `residual_bps`, the bits of the coefficients).
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion, load_motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, cue
from codec.cues.score import Score
from codec.cues.timeline import SUPERFRAME_S, TICKS, to_line
from codec.streamfile.stream import RATE_HZ
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.merging import score_of
from codec.superframe.window import read_window
from codec.superframe.window_writer import WindowWriter
from cuecast.command.voices import coding_voice
from cuecast.evaluate.baselines import BASELINES, Material
from cuecast.evaluate.bound import Bound, bound_of
from cuecast.evaluate.coded import (
    CodedMotion,
    Row,
    coded,
    coded_within,
    counted,
    decoded,
    lacking,
    row_of,
    squares_of,
)
from cuecast.evaluate.options import EvaluateOptions
from synth.motion.rules.movement import LAWS
from synth.studio.recital import PACES, imprecise, paced, perform, recital, sentences

Array = NDArray[np.float64]

RATES_BPS = (150, 200, 250, 337.5, 450, 600, 900, 1500, 3000, 6000)
"""Rates in bit/s that are tried, those of the carriers' profiles among them."""

ERRORS_MM = (1.0, 2.0, 4.0)
"""Errors that files are made to keep."""

STEPS_MM = (4.0, 6.0, 9.0, 13.0, 19.0, 28.0)
"""Steps in mm that the baselines are tried with."""

LOSSES = (0.05, 0.1, 0.2)
"""Shares of superframes that are lost."""

STANDARD_BYTES = (20, 7)
"""Parts of a superframe in the standard profile of the sound carrier."""

COMPACT_BYTES = (5, 6, 7, 9, 12)
"""Sizes of compact superframes; 7 is that of the sound carrier's robust profile."""

REPEATS = 40
"""Patterns of losses over which the error is averaged; two without previews."""

TUNED_IN = 6
"""Superframes that a receiver has before it loses any: those whose previews it needs."""

HURRIED_BYTES = (6, 7)
"""Sizes of compact superframes whose keys are counted at other paces of speech."""

_TRAINING_SENTENCES = 60
"""Sentences that the baselines learn from."""

_FEW = 20
"""Sentences of the shorter measurements."""

_LONG = 10_000
"""Least frames of a motion for losses to mean anything."""

BUILT_IN = "minimum-jerk"
"""Name of the data that the baselines are measured on as well."""


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row per codec and rate, and per loss of superframes."""
    voice = coding_voice(options.voice)
    training = recital(sentences()[:_TRAINING_SENTENCES], seed=options.seed)
    train = perform(voice, training, seed=options.seed + 1).params.astype(np.float64)
    rows: list[Row] = []
    for name, motion in _material(voice, options):
        options.say(f"{name}: {len(motion.params) / motion.rate_hz:.0f} s of motion")
        test = motion.params[: len(motion.params) // TICKS * TICKS].astype(np.float64)
        bounds = {"bound_bps": bound_of(test, voice)}
        if motion.score is not None and motion.start_s == 0 and motion.rate_hz == RATE_HZ:
            bounds["residual_bound_bps"] = bound_of(lacking(voice, motion), voice)
        found = _codec_rows(voice, motion, options)
        if name in (BUILT_IN, *_clips(options)):
            found = itertools.chain(found, _others(voice, train, test))
        for row in found:
            rows.append(row | {"data": name} | _bounds(row, bounds))
        if name == BUILT_IN:
            rows += _hurried_rows(motion.score, options)
    return rows


def _bounds(row: Row, bounds: dict[str, Bound]) -> Row:
    """Return the bounds at a row's error."""
    return {
        key: None
        if key == "residual_bound_bps" and row.get("residual_bps") is None
        else round(bound.rate_bps(row["marker_rms_mm"]), 1)
        for key, bound in bounds.items()
    }


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
            yield row_of("cuecast-compact", coded(voice, motion, count, size))
    for rate in RATES_BPS:
        options.say(f"cuecast at {rate} bit/s")
        yield row_of("cuecast", coded(voice, motion, count, int(rate * SUPERFRAME_S / 8)))
    plain = Motion(motion.params, motion.rate_hz, motion.start_s, motion.layout, motion.voice)
    for rate in RATES_BPS[3:]:
        options.say(f"cuecast without a score at {rate} bit/s")
        yield row_of("cuecast-plain", coded(voice, plain, count, int(rate * SUPERFRAME_S / 8)))
    whole = replace(motion, params=motion.params[: count * TICKS])
    for error in ERRORS_MM:
        options.say(f"cuecast within {error} mm")
        yield row_of("cuecast-error", coded_within(voice, whole, error))
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
    yield row_of(name, decoded(voice, motion, frames))
    for burst in (1, 2):
        for loss in LOSSES:
            options.say(f"{name} with losses of {loss:.0%} in runs of {burst}")
            tries = [
                decoded(
                    voice,
                    motion,
                    frames,
                    *(
                        losses(count, loss, burst=burst, seed=[options.seed, repeat, part])
                        for part in (0, 1)
                    ),
                )
                for repeat in range(REPEATS if protected else 2)
            ]
            yield row_of(name if burst == 1 else f"{name}-bursts", *tries) | {"loss": loss}


def losses(count: int, share: float, *, burst: int, seed: list[int]) -> set[int]:
    """Return the numbers of lost superframes: runs of `burst`, `share` of all in the mean.

    None of the first `TUNED_IN` is lost.
    """
    rng = np.random.default_rng([*seed, burst, round(1000 * share)])
    # Runs overlap: the share of those that begin is less than the quotient.
    begin = 1.0 - (1.0 - share) ** (1.0 / burst)
    starts = np.flatnonzero(rng.random(count) < begin)
    lost = {int(k) + i for k in starts for i in range(burst)}
    return {k for k in lost if k >= TUNED_IN}


def _hurried_rows(score: Score | None, options: EvaluateOptions) -> Iterator[Row]:
    """Yield how many keys compact superframes keep where speech is uneven, faster or slower."""
    assert score is not None
    for pace, other in zip(PACES, paced(score), strict=True):
        sent = list(cue(other.phones))
        line = to_line(other)
        count = line.starts[-1] // TICKS + 2
        for size in HURRIED_BYTES:
            options.say(f"keys at {pace} times their lengths in {size} bytes")
            writer = WindowWriter(line, DEFAULT_OPTIONS, "0" * 16, size)
            got = score_of({k: read_window(writer.l0(k)) for k in range(count)}).keys
            total, right, wrong = counted(sent, got)
            yield {
                "codec": "cuecast-compact",
                "bps": 8 * size / SUPERFRAME_S,
                "loss": 0.0,
                "keys_total": total,
                "keys_correct": right,
                "keys_wrong": wrong,
                "data": f"uneven, {pace} times as long",
            }


def _others(voice: Voice, train: Array, test: Array) -> Iterator[Row]:
    material = Material.of(train, test, voice)
    for name, code in BASELINES.items():
        for step in STEPS_MM if name != "raw-8bit" else STEPS_MM[:1]:
            bps, decoded = code(material, step)
            yield row_of(name, CodedMotion(bps, squares_of(voice, test, decoded)))


def plot(results: list[Row], figure: Any) -> None:
    """Draw rate against error into a matplotlib figure."""
    axes = figure.subplots()
    drawn = [row for row in results if "marker_rms_mm" in row]
    loss_free = [row for row in drawn if not row["loss"]]
    first = loss_free[0].get("data")
    for data, name in dict.fromkeys((row.get("data"), row["codec"]) for row in loss_free):
        if data != first and name != "cuecast":
            continue
        rows = sorted(
            (row for row in loss_free if (row.get("data"), row["codec"]) == (data, name)),
            key=lambda row: row["bps"],
        )
        axes.loglog(
            [row["marker_rms_mm"] for row in rows],
            [row["bps"] for row in rows],
            ".-" if data == first else ".:",
            label=name if data == first else f"{name}, {data}",
        )
    rows = sorted(
        (row for row in drawn if row.get("data") == first), key=lambda row: row["marker_rms_mm"]
    )
    axes.loglog(
        [row["marker_rms_mm"] for row in rows],
        [max(row["bound_bps"], 1.0) for row in rows],
        "k--",
        label="Gaussian bound",
    )
    axes.set_ylim(bottom=40.0)
    axes.set_xlabel("marker error, mm RMS")
    axes.set_ylabel("rate, bit/s")
    figure.legend(loc="outside upper center", ncols=2)
    axes.grid(True, which="both", alpha=0.3)
