"""Filmed cuers on air: superframes of constant size, without a score, with keys, and after losses.

A folder of real takes, and the second virtual cuer, reach the codec as an interpreter does
(`cuecast.evaluate.legs`) and are coded in the sound's superframes. Three ways stand side by side:
``no score`` has no keys; ``keys`` is the form that `dub` sends of a filmed cuer; ``score and
previews`` the one of a rule-based cuer.
"""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.analysis.compare import at_times
from codec.cuer.layout import N_FACE
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.timeline import SUPERFRAME_S, TICK_S
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import DecodedSuperframe, Superframe, merge_scores
from cuecast.command.voices import coding_voice
from cuecast.evaluate.coded import Row, counted
from cuecast.evaluate.legs import REAL, SECOND, real_takes, second_takes
from cuecast.evaluate.options import EvaluateOptions
from watermark.audio.signal.profile import STANDARD

LOST = 0.05
"""Share of superframes that are lost, at random."""

WORSE = 1.03
"""Least ratio of errors of a take that counts as worse with keys than without a score."""

_RUNS = 6
"""Times that each take loses superframes."""

_ABOUT_S = 0.1
"""Time before and after a key that counts as cueing."""

WAYS = {"no score": False, "keys": True, "score and previews": False}
"""Ways, and whether superframes are filmed ones."""


@dataclass(frozen=True, slots=True)
class OnAir:
    """What becomes of one take in one way.

    Attributes
    ----------
    marker_mm, hand_mm : float
        RMS distance of all markers, and of the hand's while she cues; NaN if she never does.
    keys, lost, wrong : int
        Keys sent in all runs with losses, those that are not there, and those that nobody sent.
    """

    marker_mm: float
    hand_mm: float
    keys: int
    lost: int
    wrong: int


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row per leg and way: means over its takes, the worst ratio, and lost keys."""
    voice, rows = coding_voice(options.voice), list[Row]()
    for leg, takes in _legs(voice, options):
        found: dict[str, list[OnAir]] = {way: [] for way in WAYS}
        seconds = 0.0
        for name, motion in takes:
            seconds += motion.duration_s
            for way in WAYS:
                found[way].append(on_air(motion, voice, way, seed=options.seed))
            shown = ", ".join(f"{way} {found[way][-1].marker_mm:.2f} mm" for way in WAYS)
            options.say(f"{leg}: {name}, {motion.duration_s:.0f} s: {shown}")
        plain = np.array([one.marker_mm for one in found["no score"]])
        rows += [
            {"leg": leg, "takes": len(plain), "seconds": round(seconds, 1), "way": way}
            | _summary(found[way], plain)
            for way in WAYS
        ]
    return rows


def _legs(
    voice: Voice, options: EvaluateOptions
) -> Iterator[tuple[str, Iterator[tuple[str, Motion]]]]:
    if options.clips is not None:
        yield REAL, real_takes(voice, options.clips)
    else:
        yield SECOND, second_takes(voice, options)


def _summary(takes: Sequence[OnAir], plain: NDArray[np.float64]) -> Row:
    errors = np.array([one.marker_mm for one in takes])
    ratios = errors / plain
    keys, lost, wrong = (sum(getattr(one, n) for one in takes) for n in ("keys", "lost", "wrong"))
    return {
        "marker_rms_mm": round(float(errors.mean()), 3),
        "hand_cueing_mm": round(float(np.nanmean([one.hand_mm for one in takes])), 3),
        "mean_ratio": round(float(ratios.mean()), 4),
        "worst_ratio": round(float(ratios.max()), 4),
        "worse_takes": int(np.sum(ratios > WORSE)),
        "keys": keys,
        "keys_lost_share": round(lost / keys, 5) if keys else None,
        "keys_wrong": wrong,
    }


def on_air(motion: Motion, voice: Voice, way: str, *, seed: int = 0) -> OnAir:
    """Return what becomes of a take in one of `WAYS`."""
    score = motion.score
    sent = replace(motion, score=None) if way == "no score" else motion
    encoder = SuperframeEncoder(
        voice,
        l0_bytes=STANDARD.l0_bytes,
        l1_bytes=STANDARD.l1_bytes,
        protected=way != "no score",
        filmed=WAYS[way],
    )
    first = int(motion.start_s // SUPERFRAME_S)
    end = int(np.ceil((motion.start_s + motion.duration_s) / SUPERFRAME_S))
    frames = [encoder.encode(sent, k) for k in range(first, end)]
    shown = np.concatenate([one.params for one in received(voice, frames)])
    times = first * SUPERFRAME_S + TICK_S * np.arange(len(shown), dtype=np.float64)
    there = (times >= motion.start_s) & (times < motion.start_s + motion.duration_s - TICK_S)
    meant = voice.reconstruct(at_times(motion, times[there])).astype(np.float64)
    squares = np.square(meant - voice.reconstruct(shown[there])).sum(axis=-1)
    cueing = np.zeros(len(times), dtype=bool)
    for key in score.keys if score else ():
        cueing |= (times >= key.start - _ABOUT_S) & (times < key.end + _ABOUT_S)
    hand = squares[cueing[there], N_FACE:]
    keys = lost = wrong = 0
    for run in range(_RUNS if score and way != "no score" else 0):
        rng = np.random.default_rng([seed, run, zlib.crc32(motion.params.tobytes())])
        gone = {frames[int(k)].index for k in np.flatnonzero(rng.random(len(frames)) < LOST)}
        got = merge_scores(received(voice, frames, gone)).keys
        total, right, others = counted(score.keys if score else (), got)
        keys, lost, wrong = keys + total, lost + total - right, wrong + others
    error = float(np.sqrt(squares.mean()))
    return OnAir(error, float(np.sqrt(hand.mean())) if hand.size else np.nan, keys, lost, wrong)


def received(
    voice: Voice, frames: Sequence[Superframe], lost: set[int] | None = None
) -> list[DecodedSuperframe]:
    """Return superframes as a receiver draws them: each once the one after it is there.

    Parameters
    ----------
    voice : Voice
    frames : sequence of Superframe
        In order, none missing.
    lost : set of int, optional
        Indices of those that do not arrive.
    """
    decoder, done = SuperframeDecoder(voice), list[DecodedSuperframe]()
    for frame in frames:
        there = frame.index not in (lost or ())
        decoder.take(frame.l0 if there else None, frame.l1 if there else None, frame.index)
        if frame.index > frames[0].index:
            done.append(decoder.render(frame.index - 1))
    done.append(decoder.render(frames[-1].index))
    return done
