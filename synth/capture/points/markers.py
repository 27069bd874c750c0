"""A take of markers becomes a motion: names, place, speaker, parameters, report."""

from pathlib import Path
from typing import Any

import numpy as np

from codec.cuer import layout
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.cues.finish import finish, resting_when_away
from synth.capture.options import Captured, CaptureOptions
from synth.capture.points.adapt import adapt
from synth.capture.points.hand_place import find_hand_place
from synth.capture.points.labels import Naming, find_names
from synth.capture.points.place import LEAST_HEAD_MARKERS, Registration, find_place, shows_head
from synth.capture.points.solve import HAND, LEAST_HAND_MARKERS, Quality, resting, solve
from synth.capture.points.speaker import Speaker
from synth.capture.sources.readers import read_markers, read_points
from synth.capture.sources.recording import PointRecording

_SAMPLED_FRAMES = 400
"""Frames that a take's place and speaker are found from."""

_LISTED = 8
"""Labels that a message lists."""

_MOST_REPAIRED = 0.02
"""Share of dropped markers above which the report warns."""

_AWAY_S = 1.0
"""Seconds for which a hand may be hidden before it counts as at rest."""

PARTS = {
    "head": (*layout.RIGID_FACE, *layout.BROWS),
    "lips": (*layout.UPPER_LIP, *layout.LOWER_LIP, *layout.LIP_CORNERS),
    "jaw and cheeks": (*layout.CHIN, *layout.JAW, *layout.CHEEKS, *layout.NASOLABIAL),
    "throat": layout.THROAT,
    "fingers": tuple(n for f in layout.FINGERS for n in f) + layout.SIDES,
    "palm": (*layout.KNUCKLES, *layout.PALM),
    "wrist and forearm": (*layout.WRIST, *layout.FOREARM),
}
"""Parts of the body in the report."""


def capture_markers(path: Path, kind: str, voice: Voice, options: CaptureOptions) -> Captured:
    """Return the motion of a take of markers.

    Parameters
    ----------
    path : Path
    kind : str
        As for `synth.capture.sources.readers.read_points`.
    voice : Voice
    options : CaptureOptions

    Raises
    ------
    CueError
        If the file is malformed, or shows too little of the cuer.
    """
    recording = read_points(path, kind)
    naming = _named(recording, options)
    sample = naming.markers(recording.spread(_SAMPLED_FRAMES))
    has_hand = int(naming.found[HAND].sum()) >= LEAST_HAND_MARKERS
    try:
        has_head = shows_head(sample)
        find = find_place if has_head or not has_hand else find_hand_place
        place = find(sample, recording.unit, voice)
    except CueError as error:
        raise CueError(f"{path}: {error}") from error
    speaker = _speaker(voice, place.apply(sample), options)
    quality = Quality()
    parts, seen = [], []
    for part, shown in solve(recording, naming, place, speaker, quality, progress=options.progress):
        parts.append(part.astype(np.float32))
        seen.append(shown)
    params = np.concatenate(parts)
    if has_hand:
        columns = voice.hand_columns
        params[:, columns] = resting_when_away(
            params[:, columns],
            np.concatenate(seen),
            resting(speaker)[columns],
            away_s=_AWAY_S,
            rate_hz=recording.rate_hz,
        )
    report = _report(recording, naming, place, speaker, quality)
    return finish(
        voice,
        params,
        recording.rate_hz,
        recording.start_s,
        options,
        report,
        has_hand=has_hand and has_head,
    )


def _named(recording: PointRecording, options: CaptureOptions) -> Naming:
    """Return where our markers are; if too few are, name the labels found instead."""
    try:
        naming = find_names(recording.labels, mapping=options.mapping, subject=options.subject)
    except CueError as error:
        raise CueError(f"{recording.name}: {error}") from error
    if int(naming.found.sum()) < LEAST_HEAD_MARKERS:
        shown = ", ".join(recording.labels[:_LISTED])
        more = "" if len(recording.labels) <= _LISTED else ", ..."
        raise CueError(
            f"{recording.name}: {int(naming.found.sum())} of its {len(recording.labels)} labels "
            f"name markers of the cuer; it has {shown}{more}: give --map or --propose-map"
        )
    return naming


def _speaker(voice: Voice, sample: np.ndarray, options: CaptureOptions) -> Speaker:
    if options.calibration is None:
        return adapt(voice, sample)
    still = read_markers(options.calibration, "a calibration holds markers")
    naming = _named(still, options)
    frames = naming.markers(still.spread(_SAMPLED_FRAMES))
    placed = find_place(frames, still.unit, voice).apply(frames)
    return adapt(voice, sample, still=placed)


def _report(
    recording: PointRecording,
    naming: Naming,
    place: Registration,
    speaker: Speaker,
    quality: Quality,
) -> dict[str, Any]:
    found = naming.found
    names = [name for name, there in zip(layout.MARKERS, found, strict=True) if there]
    missing = [name for name, there in zip(layout.MARKERS, found, strict=True) if not there]
    seen = quality.seen[found]
    gap = quality.longest_gap / recording.rate_hz
    worst = sorted(names, key=lambda n: quality.seen[layout.MARKER_NUMBER[n]])[:5]
    repairs = quality.repairs
    hand_seen = bool(quality.seen[HAND].any())
    return {
        "input": {
            "file": recording.name, "kind": recording.kind, "frames": recording.n_frames,
            "rate_hz": round(recording.rate_hz, 4), "duration_s": round(recording.duration_s, 3),
            "labels": len(recording.labels),
        },
        "markers": {
            "found": int(found.sum()), "of_face": int(found[: layout.N_FACE].sum()),
            "of_hand": int(found[HAND].sum()), "missing": missing,
            "unused": list(naming.unused), "unnamed": len(naming.unnamed),
        },
        "place": {
            "unit_mm": place.unit_mm, "head_size": round(place.scale, 4),
            "left_handed_axes": place.left_axes,
            "left_hand": place.left_handed if hand_seen else None,
            "turned_deg": round(float(np.degrees(np.linalg.norm(place.motion[:3]))), 1),
        },
        "speaker": {
            "hand_size": round(speaker.hand_size, 4),
            "face_offset_mm": round(speaker.face_offset_mm, 2),
            "hand_offset_mm": round(speaker.hand_offset_mm, 2),
        },
        "gaps": {
            "hidden_share": round(1 - float(seen.sum()) / max(quality.frames * len(seen), 1), 4),
            "longest_s": round(float(gap[found].max()), 3),
            "most_hidden": {
                name: round(1 - quality.seen[layout.MARKER_NUMBER[name]] / quality.frames, 3)
                for name in worst
            },
            "hand_unknown_s": round(quality.hand_unknown / recording.rate_hz, 3),
            "head_unknown_s": round(quality.head_unknown / recording.rate_hz, 3),
        },
        "repairs": {
            "renamed": repairs.renamed, "recovered": repairs.recovered, "dropped": repairs.dropped,
        },
        "residual_mm": {
            part: _rounded(quality.error_mm(layout.marker_indices(members)))
            for part, members in PARTS.items()
        },
        "notes": _notes(recording, naming, place, quality),
    }  # fmt: skip


def _notes(
    recording: PointRecording, naming: Naming, place: Registration, quality: Quality
) -> list[str]:
    notes = [*recording.notes, *place.notes]
    if int(naming.found[HAND].sum()) < LEAST_HAND_MARKERS:
        notes.append(
            f"{int(naming.found[HAND].sum())} markers of the hand, {LEAST_HAND_MARKERS} needed: "
            "the hand rests"
        )
    elif quality.hand_unknown:
        lost = quality.hand_unknown / recording.rate_hz
        notes.append(
            f"the hand is hardly seen for {lost:.2f} s: bridged, at rest after {_AWAY_S:g} s"
        )
    if quality.head_unknown and quality.seen[: layout.N_FACE].any():
        lost = quality.head_unknown / recording.rate_hz
        notes.append(f"the head is hardly seen for {lost:.2f} s: bridged")
    if quality.repairs.dropped > _MOST_REPAIRED * max(int(quality.seen.sum()), 1):
        notes.append("many markers are far from where they should be: are the names right?")
    return notes


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
