"""From marked frames to parameters, window by window, in constant memory.

Each window is inverted by the speaker's models from the markers that are seen (masked least
squares), names are mended, changed frames inverted again, and what stays hidden is bridged from
the moments around it. Errors are counted on the way.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models.face import FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import bridge, invert_face, invert_hand
from codec.cuer.voice import Voice
from synth.capture.points.labels import Naming
from synth.capture.points.place import Registration
from synth.capture.points.relabel import Repairs, relabel
from synth.capture.points.speaker import Speaker
from synth.capture.sources.recording import PointRecording

FloatArray = NDArray[np.float64]

WINDOW, MARGIN = 1024, 96
"""Frames that are solved at once, and those on either side that are solved with them and not
kept."""

FACE = slice(0, layout.N_FACE)
HAND = slice(layout.N_FACE, layout.N_FACE + layout.N_HAND)
LEAST_HAND_MARKERS = 8
"""Markers of a hand without which nothing is said of it."""

_LEAST_SHOWN = 3
"""Markers that locate the head."""

_ERROR_STEPS_MM = np.arange(0.0, 50.0, 0.05)


@dataclass(slots=True)
class Quality:
    """Residuals of the markers, and counts of hidden ones.

    Attributes
    ----------
    seen : ndarray of int, shape (113,)
        Frames with each marker visible and believed.
    frames : int
    error_sum : ndarray of float64, shape (113,)
        Distances from the models, mm.
    longest_gap : ndarray of int, shape (113,)
        Frames.
    hand_unknown : int
        Frames that show too little of the hand.
    head_unknown : int
        Frames that show too little of the head.
    repairs : Repairs
    """

    seen: NDArray[np.int64] = field(default_factory=lambda: np.zeros(113, np.int64))
    frames: int = 0
    error_sum: FloatArray = field(default_factory=lambda: np.zeros(113))
    longest_gap: NDArray[np.int64] = field(default_factory=lambda: np.zeros(113, np.int64))
    hand_unknown: int = 0
    head_unknown: int = 0
    repairs: Repairs = field(default_factory=Repairs)
    _gap: NDArray[np.int64] = field(default_factory=lambda: np.zeros(113, np.int64), repr=False)

    def count(self, markers: FloatArray, model: FloatArray) -> None:
        """Count frames: markers (T, 113, 3), NaN where not believed, and the models' markers."""
        shown = np.asarray(np.isfinite(markers).all(-1))
        self.seen += shown.sum(0)
        self.frames += len(markers)
        gap = np.linalg.norm(markers - model, axis=-1)
        self.error_sum += np.where(shown, np.nan_to_num(gap), 0.0).sum(0)
        self.hand_unknown += int((shown[:, HAND].sum(1) < LEAST_HAND_MARKERS).sum())
        self.head_unknown += int((shown[:, FACE].sum(1) < _LEAST_SHOWN).sum())
        for row in shown:
            self._gap = np.where(row, 0, self._gap + 1)
            np.maximum(self.longest_gap, self._gap, out=self.longest_gap)

    def error_mm(self, columns: NDArray[np.intp]) -> float | None:
        """Return the mean distance of some markers from the models; None if never seen."""
        total = int(self.seen[columns].sum())
        return float(self.error_sum[columns].sum() / total) if total else None


def solve(
    recording: PointRecording,
    naming: Naming,
    place: Registration,
    speaker: Speaker,
    quality: Quality,
    *,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Iterator[tuple[FloatArray, NDArray[np.bool_]]]:
    """Yield the parameters of a recording in the voice's order, window by window.

    Parameters
    ----------
    recording, naming, place, speaker
        Findings about the recording.
    quality : Quality
        Counts on.
    progress : callable
        Called with the seconds that each window brought.

    Yields
    ------
    params : ndarray of float64, shape (n, P)
    shown : ndarray of bool, shape (n,)
        Frames that show enough of the hand.
    """
    has_hand = int(naming.found[HAND].sum()) >= LEAST_HAND_MARKERS
    for begin in range(0, recording.n_frames, WINDOW):
        end = min(begin + WINDOW, recording.n_frames)
        low, high = max(0, begin - MARGIN), min(recording.n_frames, end + MARGIN)
        raw = recording.frames(low, high)
        markers = place.apply(naming.markers(raw))
        unnamed = place.points(raw[:, naming.unnamed].astype(np.float64))
        own = slice(begin - low, end - low)
        params, shown = _window(
            markers, unnamed, naming, speaker, quality, own, has_hand, recording.rate_hz
        )
        progress((end - begin) / recording.rate_hz)
        yield params[own], shown[own]


def _window(
    markers: FloatArray,
    unnamed: FloatArray,
    naming: Naming,
    speaker: Speaker,
    quality: Quality,
    own: slice,
    has_hand: bool,
    rate_hz: float,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return parameters and where the hand is seen."""
    voice = speaker.voice
    parts: list[tuple[slice, FaceModel | HandModel]] = []
    if naming.found[FACE].sum() >= _LEAST_SHOWN:
        parts.append((FACE, speaker.face))
    if has_hand:
        parts.append((HAND, speaker.hand))
    found = {part.start: _invert(model, markers[:, part]) for part, model in parts}
    expected = np.full(markers.shape, np.nan)
    for part, model in parts:
        expected[:, part] = model.reconstruct(found[part.start])
        few = np.isfinite(markers[:, part]).all(-1).sum(1) < LEAST_HAND_MARKERS
        expected[few, part] = np.nan
    repairs = Repairs()
    markers, changed = relabel(markers, expected, unnamed, naming.found, repairs)
    for name in ("renamed", "recovered", "dropped"):
        # Margins are seen by two windows; they are a small part of one.
        share = (own.stop - own.start) / len(markers)
        before = getattr(quality.repairs, name)
        setattr(quality.repairs, name, before + round(share * getattr(repairs, name)))
    params = np.tile(resting(speaker), (len(markers), 1))
    model_markers = np.full(markers.shape, np.nan)
    for part, model in parts:
        if changed.any():
            found[part.start][changed] = _invert(model, markers[changed][:, part])
        shown = np.asarray(np.isfinite(markers[:, part]).all(-1))
        world = np.where(shown[..., None], markers[:, part], 0.0)
        found[part.start] = bridge(model, world, shown, found[part.start], rate_hz=rate_hz)
        model_markers[:, part] = model.reconstruct(found[part.start])
    quality.count(markers[own], model_markers[own])
    if FACE.start in found:
        params[:, voice.face_columns] = found[FACE.start]
    if has_hand:
        face = params[:, voice.face_columns]
        params[:, voice.hand_columns] = speaker.to_voice(found[HAND.start], face)
    seen = np.isfinite(markers[:, HAND]).all(-1).sum(1)
    return params, np.asarray(seen >= LEAST_HAND_MARKERS)


def _invert(model: FaceModel | HandModel, markers: FloatArray) -> FloatArray:
    seen = np.asarray(np.isfinite(markers).all(-1))
    x = np.where(seen[..., None], markers, 0.0)
    if isinstance(model, FaceModel):
        return invert_face(model, x, seen)
    return invert_hand(model, x, seen)


def resting(speaker: Speaker) -> FloatArray:
    """Return the parameters (P,) of a cuer who looks straight on, her hand at rest."""
    voice, table = speaker.voice, speaker.voice.gestures
    row = np.zeros(len(voice.layout))
    row[voice.face_columns] = np.concatenate([table.viseme_targets[0], table.neutral_head])
    row[voice.hand_columns] = np.concatenate(
        [table.shape_targets[0], table.placement_targets[0, 0]]
    )
    return row


def likely_postures(voice: Voice) -> FloatArray:
    """Return the hand's parameters at all shapes and placements, shape (54, naH + nmH)."""
    table = voice.gestures
    shapes = np.repeat(table.shape_targets, table.placement_targets.shape[1], axis=0)
    places = table.placement_targets.reshape(len(shapes), -1)
    return np.concatenate([shapes, places], axis=1).astype(np.float64)
