"""A voice from the takes of a new speaker: models, targets, motion to train tables on, units.

The models are the paper's (`codec.training.fit`); targets are the means of held frames
(`synth.voices.holds`). Sounds that no take has borrow the face of one that looks alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.phonology import PHONE_NUMBER, PHONES
from codec.errors import CueError
from codec.training.fit import UNLABELLED, TrainingSet, fit_voice
from synth.capture.cues.appearance import looks_of
from synth.capture.sources.resample import even_times, resample
from synth.motion.rules.movement import Gestures
from synth.units.recordings.recording import UnitRecording
from synth.voices.holds import Labelled, labelled
from synth.voices.takes import FACE, HAND, MarkerTake, read_corpora

MOTION_HZ = 50.0
"""Rate of the motions that tables are trained on."""

_LOOKALIKES = (
    "p b m", "f v", "t d n", "s z", "ʃ ʒ", "k g ŋ ɲ", "l n", "ʁ k", "j i", "ɥ y", "w u", "i e",
    "ɛ ɛ̃ e", "a ɑ", "o ɔ̃", "ɔ ɑ̃ o", "ø œ ə", "œ œ̃", "y ø u",
)  # fmt: skip
"""Sounds that show the same lips, or nearly."""

_STAND_INS = 5
"""Frames that a sound without any borrows."""

_LONG_AGO_S = -1e6
"""A time in seconds before any that occurs."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Learnt:
    """The models learnt from a speaker's takes.

    Attributes
    ----------
    voice : Voice
    motions : tuple of Motion
        Of her sentences, at 50 Hz, with their scores.
    recordings : tuple of UnitRecording
        Of the sentences that have a sound beside them.
    residual_mm : dict of str to float
        Mean distance of the model from the seen markers of sentences, ``face`` and ``hand``.
    borrowed : dict of str to str
        Sounds that no take has, and those that stand in.
    left_out : tuple of str
        Takes whose hand does not show their labels.
    """

    voice: Voice
    motions: tuple[Motion, ...]
    recordings: tuple[UnitRecording, ...]
    residual_mm: dict[str, float]
    borrowed: dict[str, str]
    left_out: tuple[str, ...]


def learn_speaker(
    folder: Path,
    name: str,
    *,
    takes: Sequence[MarkerTake] | None = None,
    progress: Progress = lambda done, of: None,
) -> Learnt:
    """Return the voice of the speaker of a folder of takes.

    Parameters
    ----------
    folder : Path
    name : str
        Of the voice.
    takes : sequence of MarkerTake, optional
        If they have been read already (`synth.voices.takes.read_corpora`).
    progress : callable
        Called with the work done and the total.

    Raises
    ------
    CueError
        If the takes are malformed, or do not show every shape, placement and kind of sound.
    """
    given = read_corpora(folder) if takes is None else takes
    steps = 2 * len(given) + 1
    found, looks = [], looks_of(load_voice())
    for take in given:
        found.append(labelled(take, looks))
        progress(len(found), steps)
    left_out = tuple(str(one.take.path) for one in found if not one.believed)
    found = [one for one in found if one.believed]
    # Takes of face and hand together place the hand; those of one alone, if any, shape its model.
    joint = [one for one in found if one.followed is not None]
    if not joint:
        raise CueError(
            f"{folder}: no take of face and hand shows the keys of its TextGrid"
            + (f", such as {left_out[0]}" if left_out else "")
        )
    alone = [one for one in found if one.followed is None]
    hands = [one for one in alone if one.take.has_hand and one.take.score.keys]
    faces = [one for one in alone if one.take.has_face and not one.take.score.keys]
    face_set, borrowed = _with_stand_ins(_joined(faces or joint), _joined(joint), folder)
    try:
        voice = fit_voice(name, hand=_joined(hands or joint), face=face_set, joint=_joined(joint))
    except CueError as error:
        raise CueError(f"{folder}: {error}") from error
    progress(len(given) + 1, steps)
    motions, recordings, errors = [], [], []
    for number, one in enumerate(joint):
        motion, away = _motion(voice, one.take)
        motions.append(motion)
        errors.append(away)
        sound = _sound(one.take.path)
        if sound is not None:
            gestures = _gestures(one)
            recordings.append(
                UnitRecording.analysed(
                    *sound, score=one.take.score, gestures=gestures, motion=motion
                )
            )
        progress(len(given) + 2 + number, steps)
    progress(steps, steps)
    face_mm, hand_mm = np.mean(errors, axis=0)
    residual = {"face": round(float(face_mm), 3), "hand": round(float(hand_mm), 3)}
    return Learnt(voice, tuple(motions), tuple(recordings), residual, borrowed, left_out)


def _joined(parts: Sequence[Labelled]) -> TrainingSet:
    sets = [one.frames for one in parts]
    return TrainingSet(
        np.concatenate([one.markers for one in sets]),
        *(
            np.concatenate([getattr(one, kind) for one in sets])
            for kind in ("shape", "placement", "phone")
        ),
    )


def _with_stand_ins(
    face: TrainingSet, joint: TrainingSet, folder: Path
) -> tuple[TrainingSet, dict[str, str]]:
    """Return the face's frames, with copies for sounds that neither set has."""
    phone, of_joint = _numbers(face.phone), _numbers(joint.phone)
    frames, labels, borrowed = [face.markers], [phone], {}
    there = set(np.unique(np.concatenate([phone, of_joint])).tolist())
    for symbol in PHONES:
        if PHONE_NUMBER[symbol] in there:
            continue
        # Sounds that look alike on the lips lend their frames.
        likes = [s for group in _LOOKALIKES if symbol in group.split() for s in group.split()]
        sister = next((s for s in likes if PHONE_NUMBER[s] in there), None)
        if sister is None:
            raise CueError(f"{folder}: no take holds the sound {symbol!r} or one that looks alike")
        borrowed[symbol] = sister
        own = phone == PHONE_NUMBER[sister]
        shown = face.markers[own] if own.any() else joint.markers[of_joint == PHONE_NUMBER[sister]]
        copies = shown[:_STAND_INS]
        frames.append(copies)
        labels.append(np.full(len(copies), PHONE_NUMBER[symbol], dtype=np.int64))
    more = np.full(sum(map(len, frames)) - len(phone), UNLABELLED, dtype=np.int64)
    whole = TrainingSet(
        np.concatenate(frames),
        np.concatenate([_numbers(face.shape), more]),
        np.concatenate([_numbers(face.placement), more]),
        np.concatenate(labels),
    )
    return whole, borrowed


def _numbers(labels: NDArray[np.int64] | None) -> NDArray[np.int64]:
    return np.asarray(labels, dtype=np.int64)


def _motion(voice: Voice, take: MarkerTake) -> tuple[Motion, tuple[float, float]]:
    """Return a take's motion at 50 Hz from time 0, and the model's errors of face and hand."""
    found = voice.invert(take.markers, rate_hz=take.rate_hz)
    away = np.linalg.norm(voice.reconstruct(found.params) - take.markers, axis=2)
    errors = float(np.nanmean(away[:, FACE])), float(np.nanmean(away[:, HAND]))
    times = even_times(0.0, take.duration_s, MOTION_HZ)
    params = resample(found.params.astype(np.float64), take.rate_hz, times)
    motion = Motion(
        params.astype(np.float32), MOTION_HZ, 0.0, voice.layout, voice.identity, take.score
    )
    return motion, errors


def _sound(path: Path) -> tuple[NDArray[np.float32], int] | None:
    """Return the sound beside a take, one channel, and its rate; None if there is none."""
    beside = next(
        (p for p in (path.with_suffix(end) for end in (".wav", ".flac")) if p.exists()), None
    )
    if beside is None:
        return None
    try:
        sound, fs = soundfile.read(beside, dtype="float32", always_2d=True)
    except (OSError, soundfile.SoundFileError) as error:
        raise CueError(f"{beside}: not a readable sound") from error
    return sound.mean(axis=1), int(fs)


def _gestures(one: Labelled) -> Gestures:
    """Return the keys that a take's hand was found to hold, rest before and after."""
    assert one.followed is not None
    held = [key for key in one.followed.held if key is not None]
    shape = [0, *(key.shape for key in held), 0]
    placement = [0, *(key.placement for key in held), 0]
    leaves = [key.leave_s for key in held]
    reach = [_LONG_AGO_S, *(key.reach_s for key in held), leaves[-1] + _TO_REST_S]
    before = max(0.0, held[0].reach_s - _TO_REST_S)
    leave = [_LONG_AGO_S, before, *leaves[:-1], leaves[-1]]
    return Gestures(np.array(shape), np.array(placement), np.array(leave), np.array(reach))


_TO_REST_S = 0.4
"""Seconds that a hand takes from rest or to it."""
