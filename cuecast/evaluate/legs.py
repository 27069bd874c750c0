"""The codec on three test sets: rule-based cuers, the other virtual cuer, and real ones.

A rule-based cuer moves by the equations that the codec predicts with; results for her alone prove
little. The second virtual cuer shares none of them. Real cuers come from a folder that the user
names: tables of landmarks, one utterance each, with ``phones.csv`` (columns ``utterance`` and
``phones``) beside them where the text is known, or motions (``*.npz``) that `cuecast
capture` made of them with the camera's known properties. Both reach the codec as an interpreter
would: through a film and `synth.capture`.

Every take is coded as a file of a mean rate, or of a greatest error, three times: with its score,
without, and as ``encode`` chooses: the score is kept where it costs at most a hundredth.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from codec.analysis.compare import compare_motions
from codec.cuer.motion import Motion, load_motion
from codec.cuer.voice import Voice
from codec.cues.score import Score
from codec.errors import CueError
from codec.streamfile.spread import ScoreChoice
from codec.streamfile.stream import choose_stream, decode_stream
from cuecast.command.voices import coding_voice
from cuecast.evaluate.coded import Row
from cuecast.evaluate.films import as_rows, film
from cuecast.evaluate.options import EvaluateOptions
from synth.capture.capture import capture_motion
from synth.capture.options import CaptureOptions
from synth.motion.measured.cuer import MEASURED, performer
from synth.motion.measured.plan import paced
from synth.motion.rules.movement import LAWS
from synth.studio.recital import perform, recital, sentences

RATES_BPS = (150.0, 337.5, 900.0)
"""Rates in bit/s that files are made to keep."""

ERRORS_MM = (4.0, 2.0)
"""Errors that files are made to keep."""

RULE = "by rule"
"""Name of the leg of the voice's own cuer."""

REAL = "real"
"""Name of the leg of the user's folder."""

SECOND = f"solange/{MEASURED}"
"""Name of the second virtual cuer."""

PHONES = "phones.csv"

_CAMERA_HZ = 30.0
"""Frames per second of the film."""

_NOISE_MM = 3.0
"""Standard deviation in mm of the hand's landmarks."""

_TAIL_S = 1.0
"""Seconds after the last phone: the hand comes to rest."""

_TAKES = 8
"""Takes of the voice's own cuer; as many seconds as a minute or two of a real one."""

_SENTENCES = 4
"""Sentences of a take of the voice's own cuer, kept from training."""

_SECOND_TAKES = 16
"""Takes of the second virtual cuer, of one sentence each like those of real cuers."""

_IDLE_SHARE = 0.47
"""Share of a take of the second cuer in which she does not cue, half of it before the first key.
Real takes are idle for .42 to .53 of their time. Without it her takes cost 141 bits per key at
4 mm, with it 180 (real ones 198 to 228): a hand that comes up, goes down and rests is coded too."""

_WORSE = 1.01
"""Least ratio of a take that counts as worse with its score than without."""


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row per leg and wish: means over its takes, and how they spread."""
    voice = coding_voice(options.voice)
    rows: list[Row] = []
    for leg, takes in _legs(voice, options):
        found, seconds = list[list[list[float]]](), 0.0
        for name, motion in takes:
            options.say(f"{leg}: {name}, {motion.duration_s:.0f} s")
            seconds += motion.duration_s
            found.append([_figures(motion, voice, wish) for wish in _WISHES])
        rows += [
            {"leg": leg, "takes": len(found), "seconds": round(seconds, 1), "wish": wish}
            | _summary(np.array([take[i] for take in found]))
            for i, wish in enumerate(_WISHES)
        ]
    return rows


_WISHES: dict[str, dict[str, Any]] = {
    **{f"{rate:g} bit/s": {"rate_bps": rate} for rate in RATES_BPS},
    **{f"{error:g} mm": {"error_mm": error} for error in ERRORS_MM},
}


def plot(rows: Sequence[Row], figure: Any) -> None:
    """Draw the legs side by side: error at the standard rate, and rate within 4 mm."""
    legs = list(dict.fromkeys(row["leg"] for row in rows))
    panels = figure.subplots(1, 2)
    for axes, (wish, unit, title) in zip(panels, _DRAWN, strict=True):
        found = {row["leg"]: row for row in rows if row["wish"] == wish}
        for side, (field, label) in enumerate(_BARS.items()):
            places = np.arange(len(legs)) + (side - 1) * _BAR_WIDTH
            axes.bar(places, [found[leg][field] for leg in legs], _BAR_WIDTH, label=label)
        axes.set_xticks(range(len(legs)), [re.sub(", |/", "\n", leg) for leg in legs])
        axes.set_ylabel(unit)
        axes.set_title(title)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)


_DRAWN = (("337.5 bit/s", "error in mm", "at 337.5 bit/s"), ("4 mm", "bit/s", "within 4 mm"))
"""Wishes that are drawn, with unit and title."""

_BARS = {"with_score": "with its score", "without_score": "without", "chosen": "as encode chooses"}

_BAR_WIDTH = 0.27
"""Share of the distance between two legs."""


def _summary(figures: np.ndarray[Any, np.dtype[np.float64]]) -> Row:
    """Return the figures of a wish; `figures` are those of each take, as `_figures` says."""
    scored, auto = figures[:, 0] / figures[:, 1], figures[:, 2] / figures[:, 1]
    means = [round(float(x), 3) for x in figures[:, :3].mean(axis=0)]
    return {
        "with_score": means[0],
        "without_score": means[1],
        "chosen": means[2],
        "worst_ratio": round(float(scored.max()), 4),
        "worse_takes": int(np.sum(scored > _WORSE)),
        "worst_ratio_chosen": round(float(auto.max()), 4),
        "kept_takes": int(figures[:, 3].sum()),
    }


def _figures(motion: Motion, voice: Voice, wish: str) -> list[float]:
    """Return error in mm, or bit/s, of a take with score, without, as chosen; if it was kept."""
    choices: tuple[ScoreChoice, ...] = ("keep", "drop", "auto")
    made = [choose_stream(motion, voice, score=score, **_WISHES[wish]) for score in choices]
    figures = [_figure(one.data, motion, voice, in_bits="mm" in wish) for one in made]
    return [*figures, float(made[-1].scored)]


def _figure(data: bytes, motion: Motion, voice: Voice, *, in_bits: bool) -> float:
    if in_bits:
        return 8 * len(data) / motion.duration_s
    return compare_motions(motion, decode_stream(data, voice), voice).marker_rms_mm


def _legs(
    voice: Voice, options: EvaluateOptions
) -> Iterator[tuple[str, Iterator[tuple[str, Motion]]]]:
    """Yield the legs: name, and names and motions of takes."""
    yield f"{voice.name}, {RULE}", _ruled(voice, options.seed)
    yield SECOND, second_takes(voice, options)
    if options.clips is not None:
        yield REAL, real_takes(voice, options.clips)


def _texts(take: int) -> list[str]:
    return sentences(held_out=True)[_SENTENCES * take :][:_SENTENCES]


def _ruled(voice: Voice, seed: int) -> Iterator[tuple[str, Motion]]:
    """Yield takes by all laws of movement in turn."""
    for take in range(_TAKES):
        law = list(LAWS)[take % len(LAWS)]
        score = recital(_texts(take), seed=seed + take)
        yield law, perform(voice, score, seed=seed + take, law=law)


def second_takes(voice: Voice, options: EvaluateOptions) -> Iterator[tuple[str, Motion]]:
    """Yield takes of the second virtual cuer, filmed and captured, with their names."""
    for take, text in enumerate(sentences(held_out=True)[:_SECOND_TAKES]):
        motion = second_cuer(voice, text, options.folder, seed=options.seed + take)
        yield f"take {take}", motion


def real_takes(voice: Voice, folder: Path) -> Iterator[tuple[str, Motion]]:
    """Yield the takes of a folder, motions or else tables of landmarks, with their names."""
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        yield from real_utterances(folder, voice)
    for path in paths:
        yield path.stem, load_motion(path)


def second_cuer(voice: Voice, text: str, folder: Path, *, seed: int = 0) -> Motion:
    """Return the second virtual cuer's film of a sentence, captured into a voice.

    Parameters
    ----------
    voice : Voice
    text : str
        Said at her pace.
    folder : Path
        For the film's landmarks.
    seed : int

    Returns
    -------
    Motion
        With the score that she performed.
    """
    spoken = paced(recital([text]))
    cueing_s = spoken.keys[-1].end - spoken.keys[0].start
    quiet_s = 0.5 * cueing_s * _IDLE_SHARE / (1.0 - _IDLE_SHARE)
    score = paced(recital([text], start_s=quiet_s))
    path = folder / f"second-{seed}.csv"
    filmed_as_csv(SECOND, score, path, seed=seed, tail_s=quiet_s)
    found = capture_motion(path, voice, CaptureOptions(score=score))
    return found.motion


def filmed_as_csv(
    cuer: str,
    score: Score,
    path: Path,
    *,
    seed: int = 0,
    noise_mm: float = _NOISE_MM,
    tail_s: float = _TAIL_S,
) -> None:
    """Write the landmarks of a film of a virtual cuer, ``identity/law``, as a table.

    Parameters
    ----------
    cuer : str
    score : Score
    path : Path
    seed : int
    noise_mm : float
        As for `cuecast.evaluate.films.film`.
    tail_s : float
        Seconds of film after the last phone.
    """
    identity, law = cuer.split("/")
    actor = performer(identity, law, rate_hz=_CAMERA_HZ, seed=seed)
    seconds = (score.phones[-1].end if score.phones else 0.0) + tail_s
    face, hand, _ = film(actor, score, seconds=seconds, noise_mm=noise_mm, seed=seed)
    path.write_text(as_rows(face, hand, _CAMERA_HZ), encoding="utf-8")


def real_utterances(
    folder: Path, voice: Voice, options: CaptureOptions | None = None
) -> Iterator[tuple[str, Motion]]:
    """Yield the captured utterances of a folder of real cuers with their names.

    Parameters
    ----------
    folder : Path
        Of landmark tables; ``phones.csv`` beside them is no utterance.
    voice : Voice
    options : CaptureOptions, optional
        For all of them: aspect and frame rate of their camera.

    Raises
    ------
    CueError
        If there is none.
    """
    paths = sorted(path for path in folder.glob("*.csv") if path.name != PHONES)
    if not paths:
        raise CueError(f"{folder}: no tables of landmarks (*.csv)")
    for path in paths:
        yield path.stem, capture_motion(path, voice, options or CaptureOptions()).motion
