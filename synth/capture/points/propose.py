"""A map from labels to our markers, proposed from where the points are: their labels say nothing.

Points whose distances stay the same belong together. One such group is laid on the voice's face;
that gives unit, size and axes. The rest is laid on the voice's hand in the postures of cueing,
as it is and mirrored. Then the models follow the take, frame by frame, and each point goes to the
marker that it keeps to. Known labels stay; uncertain pairs are left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform
from scipy.special import expit

from codec.cuer import layout
from codec.cuer.models.face import FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.models.inversion import invert_face, invert_hand
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.points.adapt import lowest, resized
from synth.capture.points.labels import Naming, find_names
from synth.capture.points.match import (
    FloatArray,
    IntArray,
    TemplateFit,
    assigned,
    lay,
    margins,
    mean_costs,
    spread_turns,
)
from synth.capture.points.place import LEAST_HEAD_MARKERS, Registration, find_place
from synth.capture.points.solve import FACE, HAND, likely_postures
from synth.capture.sources.recording import PointRecording

BoolArray = NDArray[np.bool_]

SURE = 0.9
"""Least confidence of a pair that is given."""

MAX_POINTS = 400
"""Points that are looked at, at most: assignments grow with their cube."""

_SAMPLED, _FRAMES = 400, 48
"""Frames of a take that are read, and those of them that show most and are used."""

_LEAST_SEEN = 0.2
"""Share of the sampled frames that must show a point."""

_GROUPS = range(2, 9)
"""Numbers of groups that the points are parted into on trial."""

_GROUP_SIZE = (20, 100)
"""Points of a group that may be a face, with strangers and without some markers."""

_TURNS = 48
"""Rotations that the search for a face starts from."""

_WORST_MM = 8.0
"""Distance in mm, root of the mean square, of the sure points of face or hand from their model,
above which they are none."""

_LEAST_FACE, _LEAST_HAND = 24, 16
"""Markers of either that must be sure for the whole to be believed."""

_MIRROR_LOSS = 1.25
"""How many times more a hand explains than its mirror image, at least."""

_LEAST_EXPLAINED = 0.5
"""Share of the points of a face or hand that the model explains at least.

Wrong hands, in takes whose markers were glued 3 mm per axis from their places, reached 0.45; right
ones 0.58 there, 0.88 where markers were in place.
"""

_ROUNDS = 6
"""Rounds of assignment and models at most; they end when no point changes its marker."""

_CAP_MM = 25.0
"""Distance in mm beyond which a point is a stranger to a marker in a frame."""

_NONE_MM2 = 12.0**2
"""Least mean squared distance in mm2 of a point that is no marker."""

_MARGIN = 0.9
"""Margin that multiplies the odds of a pair by e, in mean squared distances of its body's pairs.

By logistic regression on bodies whose markers were glued 0 to 5 mm per axis from their places: 0.74
on one, 1.67 with an offset on the other.
"""

_LEAST_ERROR_MM2 = 9.0
"""Mean squared distance in mm2 that is assumed at least: other bodies lie no closer."""

_LEAST_IN_FRAME = 8
"""Markers that a frame shows of a hand to say anything of it."""

_SEED_FRAMES = 8
"""Frames searched for the hand."""

_SIZES = np.linspace(0.8, 1.25, 10)
"""Sizes of hands that are tried, over the voice's."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Which label may be which marker.

    Attributes
    ----------
    pairs : tuple of (str, str, float)
        Label, marker, and how sure that is, 0..1, the surest first; those that were known are not
        among them.
    points : int
        Labels that were looked at.
    known : int
        Markers whose labels were known.
    face_mm, hand_mm : float
        Distances of the sure points from the models, roots of the mean squares.
    """

    pairs: tuple[tuple[str, str, float], ...]
    points: int
    known: int
    face_mm: float
    hand_mm: float

    @property
    def sure(self) -> dict[str, str]:
        """From labels to markers, those of `SURE` and above."""
        return {label: marker for label, marker, confidence in self.pairs if confidence >= SURE}


def propose_map(
    recording: PointRecording,
    voice: Voice,
    *,
    mapping: Mapping[str, str] | None = None,
    subject: str | None = None,
) -> Proposal:
    """Return possible markers for the labels of a recording that name none.

    Parameters
    ----------
    recording : PointRecording
    voice : Voice
        Whose models are the template.
    mapping, subject
        Known names, as for `find_names`.

    Raises
    ------
    CueError
        If the points are not those of a cuer's face and hand.
    """
    naming = find_names(recording.labels, mapping=mapping, subject=subject)
    sample = recording.spread(_SAMPLED)
    points = _free_points(recording, naming, sample, subject)
    if not len(points):
        raise CueError("every label that is seen for long enough names a marker already")
    shown = np.asarray(np.isfinite(sample).all(-1))
    wanted = np.union1d(points, naming.columns[naming.found])
    if len(wanted) < _LEAST_FACE + _LEAST_HAND:
        raise CueError(
            f"{len(wanted)} points are seen for long enough, {_LEAST_FACE + _LEAST_HAND} needed"
        )
    take = _Take(
        sample[_fullest(shown[:, wanted], _FRAMES)].astype(np.float64),
        points,
        naming.columns,
        recording.unit,
        voice,
    )
    # The face is rigid enough to be laid on templates; the hand is looked for in the head's
    # coordinates; then all pairs are judged together.
    columns, place = _lay_face(take)
    world = place.points(take.x)
    columns, share = _follow(take, world, columns, voice.face)
    if share < _LEAST_EXPLAINED:
        raise CueError("the points fit no face of a cuer")
    columns, side, hand = _find_hand(take, world, columns)
    found = _judged(take, world, columns, side, hand)
    return _believed(recording, naming, *found)


def _free_points(
    recording: PointRecording, naming: Naming, sample: NDArray[np.float32], subject: str | None
) -> IntArray:
    """Return the columns of labels that are not known and are seen for long enough."""
    known = set(naming.columns[naming.found].tolist())
    seen = np.isfinite(sample).all(-1).mean(0) >= _LEAST_SEEN
    folded = [label.strip().casefold() for label in recording.labels]
    out = []
    for number, label in enumerate(recording.labels):
        prefix = label.rpartition(":")[0]
        other = subject is not None and prefix.casefold() != subject.casefold()
        if number in known or not seen[number] or other:
            continue
        if not folded[number] or folded.count(folded[number]) > 1:
            raise CueError(f"several labels are {label!r}: no map can tell them apart")
        out.append(number)
    if len(out) > MAX_POINTS:
        raise CueError(f"{len(out)} labels name no marker, at most {MAX_POINTS} are looked at")
    return np.array(out, dtype=np.intp)


def _fullest(shown: BoolArray, count: int) -> IntArray:
    """Return some frames, in order, out of the half that shows most."""
    half = np.sort(np.argsort(-shown.sum(1), kind="stable")[: max(count, len(shown) // 2)])
    return np.asarray(half[np.unique(np.linspace(0, len(half) - 1, count).astype(int))])


@dataclass(frozen=True, slots=True)
class _Take:
    """Points (T, N, 3) of some frames, which of them are free, and the columns that are known."""

    x: FloatArray
    points: IntArray
    known: IntArray
    unit: str
    voice: Voice

    @property
    def markers(self) -> IntArray:
        """Markers whose points are looked for."""
        return np.flatnonzero(self.known < 0)

    def given(self, points: IntArray, markers: IntArray) -> IntArray:
        """Return the columns of markers (113,): the known ones, and `points` as `markers`."""
        columns = self.known.copy()
        columns[markers] = points
        return columns


def _as_markers(x: FloatArray, columns: IntArray) -> FloatArray:
    """Return points (T, N, 3) as markers (T, 113, 3), NaN where there is none."""
    out = x[:, columns].copy()
    out[:, columns < 0] = np.nan
    return out


def _groups(x: FloatArray) -> list[IntArray]:
    """Return groups of points (T, N, 3) that keep their distances, or lie together."""
    if x.shape[1] < _GROUP_SIZE[0]:
        return []
    away = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
    known = np.isfinite(away)
    count = np.maximum(known.sum(0), 1)
    away[~known] = 0.0
    mean = away.sum(0) / count
    # Standard deviation of each pair's distance, by frames that show both: points of one rigid body
    # keep theirs.
    spread = np.sqrt(np.maximum((away**2).sum(0) / count - mean**2, 0.0))
    found: dict[bytes, IntArray] = {}
    # Rigid groups by hierarchical clustering of the deviations; those that lie together by
    # distance.
    for distance, method in ((spread, "average"), (mean, "single"), (mean, "average")):
        distance[~known.any(0)] = distance.max(initial=0.0)
        distance[np.diag_indices(len(distance))] = 0.0
        tree = linkage(squareform(distance, checks=False), method)
        for number in (1, *_GROUPS):
            group = fcluster(tree, number, "maxclust")
            for name in np.unique(group):
                members = np.flatnonzero(group == name)
                if _GROUP_SIZE[0] <= len(members) <= _GROUP_SIZE[1]:
                    found[members.tobytes()] = members
    return list(found.values())


def _lay_face(take: _Take) -> tuple[IntArray, Registration]:
    """Return columns of the face's markers, and the place of all."""
    try:
        return take.known, _placed(take, take.known)
    except CueError:
        pass
    whole = take.voice.face.reconstruct(np.zeros((1, take.voice.face.n_parameters)))[0]
    templates = (whole, whole[: layout.N_FACE - len(layout.THROAT)])
    free = take.markers[take.markers < layout.N_FACE]
    tried: list[tuple[float, int, TemplateFit, np.intp]] = []
    # Templates are laid on each group of near points from many turns, at a free scale; the best fit
    # by which the head has a place is taken.
    for group in _groups(take.x[:, take.points]):
        points = take.points[group]
        shown = np.isfinite(take.x[:, points, 0])
        frame = shown.sum(1).argmax()
        at = take.x[frame, points[shown[frame]]]
        if len(at) >= _GROUP_SIZE[0]:
            fits = lay(at, templates, spread_turns(_TURNS), free_scale=True, kept=3)
            tried += [(fit.error_mm2, len(tried) + n, fit, frame) for n, fit in enumerate(fits)]
    for _, _, fit, frame in sorted(tried):
        laid = fit.apply(take.x[frame, take.points])[None]
        cost = mean_costs(laid, whole[None, free], cap_mm=_CAP_MM)
        rows, columns, _ = assigned(cost, none=_NONE_MM2)
        face = take.given(take.points[rows], free[columns])
        try:
            return face, _placed(take, face)
        except CueError:
            continue
    raise CueError("no face is found among the points")


def _placed(take: _Take, columns: IntArray) -> Registration:
    face = columns.copy()
    face[layout.N_FACE :] = -1
    return find_place(_as_markers(take.x, face), take.unit, take.voice)


def _expected(model: FaceModel | HandModel, x: FloatArray) -> FloatArray:
    """Return where a model has its markers in frames (T, K, 3); NaN where too little is seen."""
    seen = np.asarray(np.isfinite(x).all(-1))
    filled = np.where(seen[..., None], x, 0.0)
    if isinstance(model, FaceModel):
        out = model.reconstruct(invert_face(model, filled, seen))
    else:
        out = model.reconstruct(invert_hand(model, filled, seen))
    least = LEAST_HEAD_MARKERS if isinstance(model, FaceModel) else _LEAST_IN_FRAME
    out[seen.sum(1) < least] = np.nan
    return out


def _follow(
    take: _Take, world: FloatArray, columns: IntArray, model: FaceModel | HandModel
) -> tuple[IntArray, float]:
    """Return better columns of the face or hand, and the share of the points that they explain.

    A pair counts in full without a distance, and as nothing if it is no better than none.
    """
    part = FACE if isinstance(model, FaceModel) else HAND
    free = take.markers[(take.markers >= part.start) & (take.markers < part.stop)]
    others = np.setdiff1d(columns, columns[part])
    points = np.setdiff1d(take.points, others)
    share = 0.0
    for _ in range(_ROUNDS):
        expected = _expected(model, _as_markers(world, columns)[:, part])
        costs = mean_costs(world[:, points], expected[:, free - part.start], cap_mm=_CAP_MM)
        rows, found, _ = assigned(costs, none=_NONE_MM2)
        before, columns = columns, columns.copy()
        columns[free] = -1
        columns[free[found]] = points[rows]
        most = max(min(costs.shape), 1)
        share = float((1.0 - costs[rows, found] / _NONE_MM2).sum()) / most
        if (columns == before).all():
            break
    return columns, share


def _find_hand(
    take: _Take, world: FloatArray, columns: IntArray
) -> tuple[IntArray, float, HandModel]:
    """Return columns with those of the hand, -1 if it is the left one, else 1, and its model."""
    sides = []
    for side in (1.0, -1.0):
        view = world * np.array([side, 1.0, 1.0])
        found, hand = _one_hand(take, view, columns)
        sides.append((*_follow(take, view, found, hand), side, hand))
    (_, other, _, _), (best, most, side, hand) = sorted(sides, key=lambda each: each[1])
    if most < _MIRROR_LOSS * other:
        raise CueError("the points fit no hand of a cuer better than its mirror image")
    if most < _LEAST_EXPLAINED:
        raise CueError("the points fit no hand of a cuer")
    return best, side, hand


def _one_hand(take: _Take, view: FloatArray, columns: IntArray) -> tuple[IntArray, HandModel]:
    """Return columns with those of a right hand, and its model in her size."""
    hand = take.voice.hand
    templates = list(hand.reconstruct(likely_postures(take.voice)))
    points = np.setdiff1d(take.points, columns)
    free = take.markers[take.markers >= layout.N_FACE]
    shown = np.isfinite(view[:, points, 0])
    begun = [(0.0, columns)]
    known = (take.known[HAND] >= 0).sum() >= _LEAST_IN_FRAME
    # Lay typical postures over the fullest frames, follow each start through the take, and keep
    # what explains most of it.
    for frame in () if known else _fullest(shown, _SEED_FRAMES):
        at = view[frame, points]
        if shown[frame].sum() < _LEAST_HAND:
            continue
        fit = lay(at[shown[frame]], templates, np.eye(3)[None], free_scale=False, kept=1)[0]
        laid, template = fit.apply(at)[None], templates[fit.template][None]
        cost = mean_costs(laid, template[:, free - layout.N_FACE], cap_mm=_CAP_MM)
        rows, found, _ = assigned(cost, none=_NONE_MM2)
        seed = columns.copy()
        seed[free] = -1
        seed[free[found]] = points[rows]
        followed, share = _follow(take, view, seed, hand)
        begun.append((share, followed))
    best = max(begun, key=lambda each: each[0])[1]
    return best, _sized(hand, _as_markers(view, best)[:, HAND])


def _sized(hand: HandModel, x: FloatArray) -> HandModel:
    """Return the hand's model in the size that frames (T, 50, 3) fit best."""
    models = [resized(hand, float(size)) for size in _SIZES]
    if np.isfinite(x).all(-1).sum(1).max(initial=0) < _LEAST_IN_FRAME:
        return hand
    gaps = [np.linalg.norm(_expected(model, x) - x, axis=-1) for model in models]
    errors = np.array([np.median(gap[np.isfinite(gap)]) for gap in gaps])
    return resized(hand, lowest(_SIZES, errors))


def _judged(
    take: _Take, world: FloatArray, columns: IntArray, side: float, hand: HandModel
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return points, markers, margins and mean squared distances (mm2) of all pairs."""
    markers = _as_markers(world, columns)
    mirror = np.array([side, 1.0, 1.0])
    of_face = _expected(take.voice.face, markers[:, FACE])
    of_hand = _expected(hand, markers[:, HAND] * mirror) * mirror
    expected = np.concatenate([of_face, of_hand], axis=1)
    cost = mean_costs(world[:, take.points], expected[:, take.markers], cap_mm=_CAP_MM)
    rows, found, _ = assigned(cost, none=_NONE_MM2)
    margin = margins(cost, rows, found, none=_NONE_MM2)
    return take.points[rows], take.markers[found], margin, cost[rows, found]


def _believed(
    recording: PointRecording,
    naming: Naming,
    points: IntArray,
    markers: IntArray,
    margin: FloatArray,
    error_mm2: FloatArray,
) -> Proposal:
    """Return the proposal, if its certain part has a face and a hand.

    Raises
    ------
    CueError
        If it is not.
    """
    confidence = np.zeros(len(markers))
    told = []
    for what, part, least in (("face", FACE, _LEAST_FACE), ("hand", HAND, _LEAST_HAND)):
        ours = np.asarray((markers >= part.start) & (markers < part.stop))
        if ours.any():
            # Confidence of a name: how much worse the next best assignment is, in units of the mean
            # error.
            unit = _MARGIN * max(float(error_mm2[ours].mean()), _LEAST_ERROR_MM2)
            confidence[ours] = expit(margin[ours] / unit)
        sure = ours & (confidence >= SURE)
        known = int(naming.found[part].sum())
        if sure.sum() + known < least:
            raise CueError(
                f"the points fit no {what} of a cuer: {sure.sum() + known} of its markers are "
                f"sure, {least} needed"
            )
        error = float(np.sqrt(error_mm2[sure].mean())) if sure.any() else 0.0
        if error > _WORST_MM:
            raise CueError(
                f"the points fit no {what} of a cuer: they lie {error:.1f} mm from its model, "
                f"at most {_WORST_MM:g} mm"
            )
        told.append(error)
    order = np.argsort(-confidence, kind="stable")
    pairs = tuple(
        (recording.labels[points[k]], layout.MARKERS[markers[k]], float(confidence[k]))
        for k in order
    )
    return Proposal(pairs, len(points), int(naming.found.sum()), told[0], told[1])
