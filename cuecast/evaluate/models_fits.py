"""Learning the models from recorded takes, and explaining takes by them.

The models' fit to a take is compared with its visible markers, and, where the truth
of hidden markers is known, with the truth: by placement, by how much of the hand is hidden and by
part of the hand.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.phases import Phase, extents, profiles, strokes
from codec.analysis.recognise import Recogniser
from codec.cuer import layout
from codec.cuer.models.completion import HandCompletion, fit_completion, recover_hand, smoothed
from codec.cuer.models.face import FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import FOREARM_COLUMNS, RIGID_FACE_COLUMNS, bridge, invert_face
from codec.cues.score import PLACEMENTS
from codec.training.fit_face import fit_face
from codec.training.fit_hand import Regressors, fit_hand
from cuecast.evaluate.takes import EvaluatedTake, Material

_TRAINING_HZ = 30.0
"""Frames per second that are learnt from: neighbours at the studio's rate are alike."""

_COMPLETION_STRIDE = 5
"""Stride in frames of learning for completion."""

_FACE = slice(0, layout.N_FACE)
_HAND = slice(layout.N_FACE, layout.N_FACE + layout.N_HAND)

_PARTS = {
    "thumb": "F1", "index": "F2", "middle": "F3", "ring": "F4", "little": "F5", "sides": "S",
    "palm": "KP", "wrist and forearm": "WA",
}  # fmt: skip
_OCCLUSION = ("0-5", "6-10", "11-15", "16-20", "21-50")

_OCCLUSION_EDGES = (6, 11, 16, 21)
"""Hidden markers at which the classes of occlusion begin."""


@dataclass(frozen=True, slots=True)
class Models:
    """A fitted model, and its training frames."""

    face: FaceModel
    hand: HandModel
    completion: HandCompletion
    hand_frames: NDArray[np.float64] = field(repr=False)
    forearm_frames: NDArray[np.float64] = field(repr=False)
    n_face_frames: int
    cpu_s: float
    """What fitting took, without the performance."""

    def control(self, *, n_parameters: int = 12, regress_on: Regressors = "angles") -> "Models":
        """Return the models with a hand of another kind, learnt from the same frames."""
        hand = fit_hand(
            self.hand_frames, self.forearm_frames, n_parameters=n_parameters, regress_on=regress_on
        )
        return replace(self, hand=hand)


@dataclass(frozen=True, slots=True)
class ModelFit:
    """How well one take is explained, millimetres.

    Attributes
    ----------
    name : str
    hand_mm, hand_sd_mm, face_mm, face_sd_mm : float
        Mean and standard deviation of the distance from visible markers.
    markers : ndarray of float32, shape (T, 113, 3)
        The models' markers.
    recovered : ndarray of float32, shape (T, 50, 3)
        The hand as it was seen, its hidden markers recovered.
    duration_s, cpu_s : float
        Of the take, and what its inversion took on one core.
    """

    name: str
    hand_mm: float
    hand_sd_mm: float
    face_mm: float
    face_sd_mm: float
    markers: NDArray[np.float32] = field(repr=False)
    recovered: NDArray[np.float32] = field(repr=False)
    duration_s: float
    cpu_s: float

    def without_markers(self) -> "ModelFit":
        """Return the figures alone."""
        empty = np.zeros((0, 0, 3), dtype=np.float32)
        return replace(self, markers=empty, recovered=empty)


def learn(material: Material, training: Sequence[EvaluatedTake]) -> Models:
    """Fit face and hand as the paper does: corpora 1 and 2, then jointly with sentences."""
    lines = np.concatenate([_thinned(take) for take in training])
    sounds = np.concatenate([_thinned(take) for take in material.takes(2)])
    of_shapes = list(material.takes(1))
    shapes = np.concatenate([_thinned(take) for take in of_shapes])
    faces = np.concatenate([_complete(sounds[:, _FACE]), _complete(lines[:, _FACE])])
    hands = np.concatenate([shapes[:, _HAND], lines[:, _HAND]])
    # Sentences last long and show few folded fingers: they must not outweigh corpus 1.
    folding = np.concatenate(
        [
            *(_calm_hand(take, 1) for take in of_shapes),
            *(_calm_hand(take, _COMPLETION_STRIDE) for take in training),
        ]
    )
    forearm = _complete(lines[:, layout.N_FACE + FOREARM_COLUMNS])
    begun = time.process_time()
    face = fit_face(faces, _complete(lines[:, RIGID_FACE_COLUMNS]))
    hand, completion = fit_hand(hands, forearm), fit_completion(folding)
    taken = time.process_time() - begun
    return Models(face, hand, completion, hands, forearm, len(faces), taken)


def _thinned(take: EvaluatedTake) -> NDArray[np.float64]:
    return take.observed[:: _step(take)].astype(np.float64)


def _calm_hand(take: EvaluatedTake, stride: int) -> NDArray[np.float64]:
    """Return every `stride`-th of the thinned frames of the hand, smoothed."""
    observed = take.observed[:, _HAND].astype(np.float64)
    visible = np.asarray(np.isfinite(observed).all(-1))
    calm = smoothed(np.where(visible[..., None], observed, 0.0), visible, rate_hz=take.rate_hz)
    return np.where(visible[..., None], calm, np.nan)[:: stride * _step(take)]


def _step(take: EvaluatedTake) -> int:
    return max(1, round(take.rate_hz / _TRAINING_HZ))


def _complete(frames: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(frames[np.isfinite(frames).all((1, 2))])


def explain(take: EvaluatedTake, models: Models) -> ModelFit:
    """Invert one take and compare the models' markers with it."""
    visible = np.asarray(np.isfinite(take.observed).all(-1))
    world = np.where(visible[..., None], take.observed, 0.0).astype(np.float64)
    markers = np.empty_like(take.observed)
    of_face, of_hand = visible[:, _FACE], visible[:, _HAND]
    begun = time.process_time()
    face = invert_face(models.face, world[:, _FACE], of_face)
    face = bridge(models.face, world[:, _FACE], of_face, face, rate_hz=take.rate_hz)
    hand, recovered = recover_hand(
        models.hand, models.completion, world[:, _HAND], of_hand, rate_hz=take.rate_hz
    )
    taken = time.process_time() - begun
    markers[:, _FACE] = models.face.reconstruct(face)
    markers[:, _HAND] = models.hand.reconstruct(hand)
    distance = np.linalg.norm(markers - world, axis=-1)
    on_hand, on_face = distance[:, _HAND][of_hand], distance[:, _FACE][of_face]
    return ModelFit(
        take.name,
        float(on_hand.mean()), float(on_hand.std()), float(on_face.mean()), float(on_face.std()),
        markers, recovered.astype(np.float32), len(world) / take.rate_hz, taken,
    )  # fmt: skip


class Occlusion:
    """Distances from the truth of the hand, hidden and visible, grouped in several ways."""

    def __init__(self) -> None:
        self._sums: dict[tuple[str, str], NDArray[np.float64]] = {}

    def add(self, take: EvaluatedTake, fit: ModelFit, recogniser: Recogniser) -> None:
        """Count a take; nothing is known where there is no truth."""
        if take.truth is None:
            return
        truth = take.truth[:, _HAND]
        model = np.linalg.norm(fit.markers[:, _HAND] - truth, axis=-1)
        recovered = np.linalg.norm(fit.recovered - truth, axis=-1)
        hidden = np.asarray(~np.isfinite(take.observed[:, _HAND]).all(-1))
        self._count("all", "all", hidden, recovered, model)
        placement = recogniser.placement_posteriors(fit.markers).argmax(1)
        level = np.searchsorted(_OCCLUSION_EDGES, hidden.sum(1), side="right")
        for what, label, names in (
            ("placement", placement, PLACEMENTS),
            ("markers hidden", level, _OCCLUSION),
        ):
            for number, name in enumerate(names):
                at = label == number
                self._count(what, name, hidden[at], recovered[at], model[at])
        for name, stems in _PARTS.items():
            of = [
                k
                for k, marker in enumerate(layout.HAND_MARKERS)
                if marker.startswith(stems if len(stems) == 2 and stems[0] == "F" else tuple(stems))
            ]
            self._count("part", name, hidden[:, of], recovered[:, of], model[:, of])

    def _count(
        self,
        what: str,
        name: str,
        hidden: NDArray[np.bool_],
        recovered: NDArray[np.float64],
        model: NDArray[np.float64],
    ) -> None:
        sums = self._sums.setdefault((what, name), np.zeros(5))
        sums += (
            hidden.sum(),
            (~hidden).sum(),
            recovered[hidden].sum(),
            model[hidden].sum(),
            model[~hidden].sum(),
        )

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row per group: share hidden, errors in millimetres, their ratio."""
        for (what, name), (hidden, shown, recovered, model, visible) in self._sums.items():
            error = recovered / hidden if hidden else np.nan
            ground = visible / shown if shown else np.nan
            yield {
                "by": what,
                "group": name,
                "hidden_share": _rounded(hidden / max(hidden + shown, 1)),
                "recovered_hidden_mm": _rounded(error),
                "model_hidden_mm": _rounded(model / hidden if hidden else np.nan),
                "model_visible_mm": _rounded(ground),
                "ratio": _rounded(error / ground),
            }

    def summary(self) -> dict[str, Any]:
        """Return the figures over all markers; None where the truth is not known."""
        row = next((row for row in self.rows() if row["by"] == "all"), {})
        places = [row["ratio"] for row in self.rows() if row["by"] == "placement" and row["ratio"]]
        return {
            "hidden_hand_mae_mm": row.get("recovered_hidden_mm"),
            "hidden_hand_model_mm": row.get("model_hidden_mm"),
            "visible_hand_truth_mm": row.get("model_visible_mm"),
            "hidden_ratio": row.get("ratio"),
            "hidden_ratio_worst_placement": max(places, default=None),
        }


class Phases:
    """Phases of gestures, gathered take by take."""

    def __init__(self) -> None:
        self.shapes: list[Phase] = []
        self.placements: list[Phase] = []
        self.strokes: list[Phase] = []

    def add(self, take: EvaluatedTake, fit: ModelFit, recogniser: Recogniser) -> None:
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


def _rounded(value: float) -> float | None:
    return round(float(value), 3) if np.isfinite(value) else None
