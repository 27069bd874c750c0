"""How well the models fit: the tables of the paper's sections 3.3 and 4, and its figures 3 to 5.

The models are learnt from corpora 1 and 2 and the first 68 sentences of corpus 3; the next 114
sentences are inverted by them. Errors are mean distances between model and visible markers.
Source: Gibert, Bailly, Elisei 2004.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec import layout
from codec.errors import CueError
from codec.models.bridging import bridge
from codec.models.face import FaceModel
from codec.models.fit_face import fit_face
from codec.models.fit_hand import Regressors, fit_hand
from codec.models.hand import HandModel
from codec.models.inversion import (
    FOREARM_COLUMNS,
    RIGID_FACE_COLUMNS,
    invert_face,
    invert_hand,
)
from codec.phasing import Phase, extents, profiles, strokes
from codec.recognise import Recogniser, fit_recogniser
from codec.score import PLACEMENT_NUMBER, PLACEMENTS
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.takes import Material, Recorded, Take, performed

N_TRAINING = 68
N_TEST = 114
_TRAINING_HZ = 30.0
_CONTROL_TAKES = 6
_FACE = slice(0, layout.N_FACE)
_HAND = slice(layout.N_FACE, layout.N_FACE + layout.N_HAND)


@dataclass(frozen=True, slots=True)
class Models:
    """What is learnt, and the frames it was learnt from."""

    face: FaceModel
    hand: HandModel
    hand_frames: NDArray[np.float64] = field(repr=False)
    forearm_frames: NDArray[np.float64] = field(repr=False)
    n_face_frames: int

    def control(self, *, n_parameters: int = 12, regress_on: Regressors = "angles") -> HandModel:
        """Return a hand model of another kind, learnt from the same frames."""
        return fit_hand(
            self.hand_frames, self.forearm_frames,
            n_parameters=n_parameters, regress_on=regress_on,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Fit:
    """How well one take is explained, millimetres.

    Attributes
    ----------
    name : str
    hand_mm, hand_sd_mm, face_mm, face_sd_mm : float
        Mean and standard deviation of the distance from visible markers.
    truth_mm, hidden_mm : float
        Mean distance of the hand from the truth of visible and of hidden markers; NaN if unknown.
    n_hidden : int
    markers : ndarray of float32, shape (T, 113, 3)
        The models' markers.
    """

    name: str
    hand_mm: float
    hand_sd_mm: float
    face_mm: float
    face_sd_mm: float
    truth_mm: float
    hidden_mm: float
    n_hidden: int
    markers: NDArray[np.float32] = field(repr=False)


def evaluate(options: EvaluateOptions) -> dict[str, Any]:
    """Learn the models, invert sentences, recognise gestures, measure their phasing.

    Parameters
    ----------
    options : EvaluateOptions
        ``clips`` may name a folder of corpora as `synth.corpus.make` writes it.
    """
    material = performed() if options.clips is None else Recorded(options.clips)
    return measure(material, options)


def measure(
    material: Material, options: EvaluateOptions, *, n_training: int = N_TRAINING,
    n_test: int = N_TEST,
) -> dict[str, Any]:  # fmt: skip
    """Return the figures of one cuer; `evaluate` says of which."""
    from cuecast.evaluate import models_figures

    sentences = material.takes(3)
    options.say(f"learning from corpora 1 and 2 and {n_training} sentences")
    training = list(itertools.islice(sentences, n_training))
    models = learn(material, training)
    options.say(f"inverting {len(training)} sentences")
    seen = [explain(take, models.face, models.hand) for take in training]
    controls = _controls(models, training[:_CONTROL_TAKES])
    recogniser, accuracy = _recognition(training, seen)
    unseen, phases, hidden, example = [], Phases(), Occlusion(), None
    options.say(f"inverting the next {n_test} sentences")
    for take in itertools.islice(sentences, n_test):
        fit = explain(take, models.face, models.hand)
        phases.add(take, fit, recogniser)
        hidden.add(take, fit, recogniser)
        example = example or (take, fit)
        unseen.append(_without_markers(fit))
    if not unseen or example is None:
        raise CueError(f"{material}: more than {n_training} sentences are needed")
    if options.out is not None:
        models_figures.write_all(
            options.out, str(material), seen, unseen, recogniser, example, phases, hidden
        )
    return {
        **_errors(seen, unseen), **accuracy, **controls, **phases.summary(),
        "training_sentences": len(seen), "test_sentences": len(unseen),
        "hand_frames": len(models.hand_frames), "face_frames": models.n_face_frames,
        "head_parameters": models.face.n_motion, "forearm_parameters": models.hand.n_motion,
        "data": str(material),
    }  # fmt: skip


def learn(material: Material, training: Iterable[Take]) -> Models:
    """Fit face and hand as the paper does: corpora 1 and 2, then jointly with sentences."""
    lines = np.concatenate([_thinned(take) for take in training])
    sounds = np.concatenate([_thinned(take) for take in material.takes(2)])
    shapes = np.concatenate([_thinned(take) for take in material.takes(1)])
    faces = np.concatenate([_complete(sounds[:, _FACE]), _complete(lines[:, _FACE])])
    hands = np.concatenate([shapes[:, _HAND], lines[:, _HAND]])
    forearm = _complete(lines[:, layout.N_FACE + FOREARM_COLUMNS])
    face = fit_face(faces, _complete(lines[:, RIGID_FACE_COLUMNS]))
    return Models(face, fit_hand(hands, forearm), hands, forearm, len(faces))


def _thinned(take: Take) -> NDArray[np.float64]:
    return take.observed[:: max(1, round(take.rate_hz / _TRAINING_HZ))].astype(np.float64)


def _complete(frames: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(frames[np.isfinite(frames).all((1, 2))])


def explain(take: Take, face: FaceModel, hand: HandModel) -> Fit:
    """Invert one take and compare the models' markers with it."""
    visible = np.asarray(np.isfinite(take.observed).all(-1))
    world = np.where(visible[..., None], take.observed, 0.0).astype(np.float64)
    markers = np.empty_like(take.observed)
    of_face, of_hand = visible[:, _FACE], visible[:, _HAND]
    found = invert_face(face, world[:, _FACE], of_face)
    found = bridge(face, world[:, _FACE], of_face, found, rate_hz=take.rate_hz)
    markers[:, _FACE] = face.reconstruct(found)
    found = invert_hand(hand, world[:, _HAND], of_hand)
    found = bridge(hand, world[:, _HAND], of_hand, found, rate_hz=take.rate_hz)
    markers[:, _HAND] = hand.reconstruct(found)
    distance = np.linalg.norm(markers - world, axis=-1)
    on_hand = distance[:, _HAND][visible[:, _HAND]]
    on_face = distance[:, _FACE][visible[:, _FACE]]
    true_mm, hidden_mm = np.nan, np.nan
    if take.truth is not None:
        off = np.linalg.norm(markers - take.truth, axis=-1)[:, _HAND]
        true_mm, hidden_mm = off[visible[:, _HAND]].mean(), off[~visible[:, _HAND]].mean()
    return Fit(
        take.name,
        float(on_hand.mean()), float(on_hand.std()), float(on_face.mean()), float(on_face.std()),
        float(true_mm), float(hidden_mm), int((~of_hand).sum()), markers,
    )  # fmt: skip


def _without_markers(fit: Fit) -> Fit:
    empty = np.zeros((0, len(layout.MARKERS), 3), dtype=np.float32)
    return Fit(
        fit.name, fit.hand_mm, fit.hand_sd_mm, fit.face_mm, fit.face_sd_mm, fit.truth_mm,
        fit.hidden_mm, fit.n_hidden, empty,
    )  # fmt: skip


def _errors(seen: list[Fit], unseen: list[Fit]) -> dict[str, Any]:
    known = [fit for fit in unseen if np.isfinite(fit.hidden_mm)]
    weights = [fit.n_hidden for fit in known]
    hidden = float(np.average([fit.hidden_mm for fit in known], weights=weights)) if known else None
    visible = float(np.mean([fit.truth_mm for fit in known])) if known else None
    return {
        "hand_mae_mm": _mean(fit.hand_mm for fit in seen),
        "face_mae_mm": _mean(fit.face_mm for fit in seen),
        "hand_mae_test_mm": _mean(fit.hand_mm for fit in unseen),
        "face_mae_test_mm": _mean(fit.face_mm for fit in unseen),
        "hidden_hand_mae_mm": None if hidden is None else round(hidden, 3),
        "visible_hand_truth_mm": None if visible is None else round(visible, 3),
    }


def _controls(models: Models, takes: list[Take]) -> dict[str, Any]:
    """Return the errors of hand models that should be worse."""
    kinds: dict[str, HandModel] = {
        "reference_mm": models.hand,
        "regression_on_parameters_mm": models.control(regress_on="parameters"),
        "linear_mm": models.control(regress_on="linear"),
        "six_parameters_mm": models.control(n_parameters=6),
    }
    return {
        f"control_{name}": _mean(explain(take, models.face, hand).hand_mm for take in takes)
        for name, hand in kinds.items()
    }


def targets(take: Take, markers: NDArray[np.float32]) -> Iterator[tuple[int, int, int]]:
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


def _recognition(takes: list[Take], fits: list[Fit]) -> tuple[Recogniser, dict[str, Any]]:
    """Learn the recogniser from one half of the targets and try it on the other."""
    frames, labels = [], []
    for take, fit in zip(takes, fits, strict=True):
        for frame, shape, placement in targets(take, fit.markers):
            frames.append(fit.markers[frame])
            labels.append((shape, placement))
    markers, (shape, placement) = np.array(frames), np.array(labels).T
    recogniser = fit_recogniser(markers[::2], shape[::2], placement[::2])
    right_shape = recogniser.shape_posteriors(markers[1::2]).argmax(1) == shape[1::2]
    right_place = recogniser.placement_posteriors(markers[1::2]).argmax(1) == placement[1::2]
    return recogniser, {
        "shape_accuracy": round(float(right_shape.mean()), 4),
        "placement_accuracy": round(float(right_place.mean()), 4),
        "targets": len(frames),
    }


class Occlusion:
    """Distances of the model from the truth of the hand, by recognised placement."""

    def __init__(self) -> None:
        self._count = np.zeros((len(PLACEMENTS), 2))
        self._total_mm = np.zeros((len(PLACEMENTS), 2))

    def add(self, take: Take, fit: Fit, recogniser: Recogniser) -> None:
        """Count a take; nothing is known where there is no truth."""
        if take.truth is None:
            return
        placement = recogniser.placement_posteriors(fit.markers).argmax(1)
        off = np.linalg.norm(fit.markers - take.truth, axis=-1)[:, _HAND]
        hidden = ~np.isfinite(take.observed[:, _HAND]).all(-1)
        place = np.broadcast_to(placement[:, None], off.shape)
        for column, chosen in enumerate((hidden, ~hidden)):
            self._count[:, column] += np.bincount(place[chosen], minlength=len(PLACEMENTS))
            self._total_mm[:, column] += np.bincount(place[chosen], off[chosen], len(PLACEMENTS))

    def rows(self) -> list[tuple[str, float, float, float]]:
        """Return placement, share hidden, error of hidden and of visible markers (mm)."""
        mean = self._total_mm / np.maximum(self._count, 1)
        share = self._count[:, 0] / np.maximum(self._count.sum(1), 1)
        return [
            (
                name,
                round(float(share[k]), 3),
                round(float(mean[k, 0]), 3),
                round(float(mean[k, 1]), 3),
            )
            for k, name in enumerate(PLACEMENTS)
        ]


class Phases:
    """Phases of gestures, gathered take by take."""

    def __init__(self) -> None:
        self.shapes: list[Phase] = []
        self.placements: list[Phase] = []
        self.strokes: list[Phase] = []

    def add(self, take: Take, fit: Fit, recogniser: Recogniser) -> None:
        """Measure the gestures of a take."""
        rate_hz = take.rate_hz
        shape = recogniser.shape_posteriors(fit.markers)
        placement = recogniser.placement_posteriors(fit.markers, shape.argmax(1))
        self.shapes += extents(shape, take.score, rate_hz=rate_hz)
        self.placements += extents(placement, take.score, rate_hz=rate_hz)
        self.strokes += strokes(fit.markers, take.score, rate_hz=rate_hz)

    def summary(self) -> dict[str, Any]:
        """Return mean begin and end of the strokes of consonant-vowel keys, milliseconds."""
        found = {profile.kind: profile for profile in profiles(self.strokes)}
        if "CV" not in found:
            return {"stroke_lead_ms": None, "stroke_lag_ms": None}
        return {
            "stroke_lead_ms": round(1000 * found["CV"].lead_s),
            "stroke_lag_ms": round(1000 * found["CV"].lag_s),
        }


def _mean(values: Iterable[float]) -> float:
    return round(float(np.mean(list(values))), 3)
