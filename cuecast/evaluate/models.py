"""How well the models fit: the tables of the paper's sections 3.3 and 4, and its figures 3 to 5.

The models are learnt from corpora 1 and 2 and the first 68 sentences of corpus 3; the next 114
sentences are inverted by them. Errors are mean distances between model and visible markers.
Source: Gibert, Bailly, Elisei 2004.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.phases import strokes
from codec.analysis.recognise import Recogniser, fit_recogniser
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, SHAPES
from codec.errors import CueError
from cuecast.evaluate import models_figures
from cuecast.evaluate.models_fits import ModelFit, Models, Occlusion, Phases, explain, learn
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.tables import write_results
from cuecast.evaluate.takes import EvaluatedTake, Material, Recorded, performed
from synth.motion.body.anatomy import BY_RULE, IDENTITIES
from synth.motion.measured.cuer import MEASURED
from synth.motion.rules.movement import LAWS

N_TRAINING = 68
"""Sentences that are learnt from, as in the paper (section 4)."""

N_TEST = 114
"""Sentences that are not, as in the paper."""

_CONTROL_TAKES = 6
"""Takes that the controls learn from."""

_FEW_SENTENCES = 10
"""Sentences that the recogniser learns from in the test with few."""

_FEW_EXAMPLES = 6
"""Examples of a class that count when sentences are chosen."""


def evaluate(options: EvaluateOptions) -> dict[str, Any] | list[dict[str, Any]]:
    """Learn the models, invert sentences, recognise gestures, measure their phasing.

    Parameters
    ----------
    options : EvaluateOptions
        ``clips`` may name a folder of corpora as `lab.corpora` writes it (of fewer sentences
        than the paper's the same share is for training); ``cuers`` names
        virtual cuers as ``identity/law``, or ``all``: one row of figures each, and one folder.
    """
    if options.clips is not None:
        material = Recorded(options.clips)
        share = N_TRAINING / (N_TRAINING + N_TEST)
        return measure(
            material, options, n_training=min(N_TRAINING, max(1, round(share * material.sentences)))
        )
    if options.cuers is None:
        return measure(performed(), options)
    names = cuers_named(options.cuers)
    folders = [options.out and options.out / name.replace("/", "-") for name in names]
    # A lambda of the command line cannot travel to another process.
    told = replace(options, say=_silent)
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        work = pool.map(_measure_cuer, names, [replace(told, out=out) for out in folders])
        rows = []
        for name, row in zip(names, work, strict=True):
            rows.append(row)
            options.say(f"{len(rows)} of {len(names)} cuers measured: {name}")
    return rows


def cuers_named(chosen: Sequence[str]) -> list[str]:
    """Return the names ``identity/law`` that are meant; a name without a law means all laws."""
    known = [f"{identity}/{law}" for identity in BY_RULE for law in LAWS]
    known += [f"{identity}/{MEASURED}" for identity in IDENTITIES]
    names = []
    for word in chosen:
        found = [name for name in known if word in ("all", name, name.split("/")[0])]
        if not found:
            raise CueError(f"unknown cuer {word!r}; known: all, {', '.join(known)}")
        names += [name for name in found if name not in names]
    return names


def _silent(_: str) -> None:
    """Say nothing."""


def _measure_cuer(name: str, options: EvaluateOptions) -> dict[str, Any]:
    identity, law = name.split("/")
    row = measure(performed(identity=identity, law=law), options)
    if options.out is not None:
        write_results(options.out, "models", row)
    return row


def measure(
    material: Material,
    options: EvaluateOptions,
    *,
    n_training: int = N_TRAINING,
    n_test: int = N_TEST,
) -> dict[str, Any]:
    """Return the figures of one cuer; see `evaluate`."""
    sentences = material.takes(3)
    options.say(f"learning from corpora 1 and 2 and {n_training} sentences")
    training = list(itertools.islice(sentences, n_training))
    models = learn(material, training)
    options.say(f"inverting {len(training)} sentences")
    seen = [explain(take, models) for take in training]
    controls = _controls(models, training[:_CONTROL_TAKES])
    recogniser, accuracy = _recognition(training, seen)
    unseen, phases, hidden, example = [], Phases(), Occlusion(), None
    options.say(f"inverting the next sentences, {n_test} at most")
    for take in itertools.islice(sentences, n_test):
        fit = explain(take, models)
        phases.add(take, fit, recogniser)
        hidden.add(take, fit, recogniser)
        example = example or (take, fit)
        unseen.append(fit.without_markers())
    if not unseen or example is None:
        raise CueError(f"{material}: more than {n_training} sentences are needed")
    if options.out is not None:
        models_figures.write_all(
            options.out, str(material), seen, unseen, recogniser, example, phases, hidden
        )
    return {
        **_errors(seen, unseen), **hidden.summary(), **accuracy,
        **_few(training, seen), **controls, **phases.summary(),
        "fit_cpu_s": round(models.cpu_s, 1),
        "inversion_realtime_factor": round(
            sum(fit.duration_s for fit in unseen) / sum(fit.cpu_s for fit in unseen), 1
        ),
        "training_sentences": len(seen), "test_sentences": len(unseen),
        "hand_frames": len(models.hand_frames), "face_frames": models.n_face_frames,
        "head_parameters": models.face.n_motion, "forearm_parameters": models.hand.n_motion,
        "data": str(material),
    }  # fmt: skip


def _errors(seen: list[ModelFit], unseen: list[ModelFit]) -> dict[str, Any]:
    return {
        "hand_mae_mm": _mean(fit.hand_mm for fit in seen),
        "face_mae_mm": _mean(fit.face_mm for fit in seen),
        "hand_mae_test_mm": _mean(fit.hand_mm for fit in unseen),
        "face_mae_test_mm": _mean(fit.face_mm for fit in unseen),
    }


def _controls(models: Models, takes: list[EvaluatedTake]) -> dict[str, Any]:
    """Return the errors of hand models that should be worse."""
    kinds = {
        "reference_mm": models,
        "regression_on_parameters_mm": models.control(regress_on="parameters"),
        "linear_mm": models.control(regress_on="linear"),
        "six_parameters_mm": models.control(n_parameters=6),
    }
    return {
        f"control_{name}": _mean(explain(take, kind).hand_mm for take in takes)
        for name, kind in kinds.items()
    }


def targets(take: EvaluatedTake, markers: NDArray[np.float32]) -> Iterator[tuple[int, int, int]]:
    """Yield frame, shape and placement of each target of the hand, rests too.

    Where the time of a target is not known it is the end of the stroke about the key's onset.
    """
    reached = take.targets
    if reached is None:
        found = strokes(markers, take.score, rate_hz=take.rate_hz)
        ends = (0.1, len(markers) / take.rate_hz - 0.1)
        reached = (*((phase.key, phase.end_s) for phase in found), *((None, end) for end in ends))
    for key, time_s in reached:
        frame = round(time_s * take.rate_hz)
        if 0 <= frame < len(markers):
            yield frame, key.shape if key else 0, PLACEMENT_NUMBER[key.placement] if key else 0


Labelled = tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64]]


def _labelled(takes: Sequence[EvaluatedTake], fits: Sequence[ModelFit]) -> Labelled:
    """Return markers (N, 113, 3), shapes and placements of all targets."""
    frames, labels = [], []
    for take, fit in zip(takes, fits, strict=True):
        for frame, shape, placement in targets(take, fit.markers):
            frames.append(fit.markers[frame])
            labels.append((shape, placement))
    shape, placement = np.array(labels).T
    return np.array(frames), shape, placement


def _accuracy(recogniser: Recogniser, labelled: Labelled) -> tuple[float, float]:
    markers, shape, placement = labelled
    right_shape = recogniser.shape_posteriors(markers).argmax(1) == shape
    right_place = recogniser.placement_posteriors(markers).argmax(1) == placement
    return round(float(right_shape.mean()), 4), round(float(right_place.mean()), 4)


def _recognition(
    takes: Sequence[EvaluatedTake], fits: Sequence[ModelFit]
) -> tuple[Recogniser, dict[str, Any]]:
    """Learn the recogniser from one half of the targets and try it on the other.

    Classes missing in the training half are named; they count as not recognised.
    """
    markers, shape, placement = _labelled(takes, fits)
    recogniser = fit_recogniser(markers[::2], shape[::2], placement[::2])
    right = _accuracy(recogniser, (markers[1::2], shape[1::2], placement[1::2]))
    return recogniser, {
        "shape_accuracy": right[0],
        "placement_accuracy": right[1],
        "targets": len(markers),
        "shapes_not_learnt": _named(recogniser.shapes.missing, range(len(SHAPES))),
        "placements_not_learnt": _named(recogniser.placements.missing, PLACEMENTS),
    }


def _named(classes: Sequence[int], names: Sequence[object]) -> str | None:
    return " ".join(str(names[label]) for label in classes) or None


def _few(takes: Sequence[EvaluatedTake], fits: Sequence[ModelFit]) -> dict[str, Any]:
    """Learn the recogniser from ten sentences that hold every key, try it on the others."""
    kinds = [list(targets(take, fit.markers)) for take, fit in zip(takes, fits, strict=True)]
    chosen = _covering(kinds, _FEW_SENTENCES)
    others = [k for k in range(len(takes)) if k not in chosen]
    if not others:
        return {"shape_accuracy_10": None, "placement_accuracy_10": None}
    few = _labelled([takes[k] for k in chosen], [fits[k] for k in chosen])
    rest = _labelled([takes[k] for k in others], [fits[k] for k in others])
    right = _accuracy(fit_recogniser(*few), rest)
    return {"shape_accuracy_10": right[0], "placement_accuracy_10": right[1]}


def _covering(kinds: Sequence[Sequence[tuple[int, int, int]]], count: int) -> list[int]:
    """Return the sentences that together hold most examples of every shape and placement."""
    table = np.array(
        [
            np.bincount(
                [s for _, s, _ in line] + [len(SHAPES) + p for _, _, p in line],
                minlength=len(SHAPES) + len(PLACEMENTS),
            )
            for line in kinds
        ]
    )
    chosen: list[int] = []
    for _ in range(min(count, len(kinds))):
        have = table[chosen].sum(0)
        gain = np.minimum(have + table, _FEW_EXAMPLES).sum(1)
        gain[chosen] = -1
        chosen.append(int(gain.argmax()))
    return chosen


def _mean(values: Iterable[float]) -> float:
    return round(float(np.mean(list(values))), 3)
