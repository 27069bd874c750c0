"""Natural against synthetic movement under natural speech, as points of light, rated.

The paradigm of Bailly, Gibert and Odisio (2002): the same sound with the speaker's own movement,
with the synthesiser's for the same phones at the same times, and with the speaker's own movement
of another sentence, which shows whether raters look at all.
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from codec.cuer.motion import Motion, load_motion, sample_params
from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from cuecast.practice.trial import ITEMS, ItemCondition, Step, Trial, save_item, write_trial
from synth.motion.rules.performance import motion_of

PROMPT = "Les mouvements vont-ils avec la voix, comme ceux d’une vraie personne ?"

SCALE = ("pas du tout", "plutôt non", "entre les deux", "plutôt oui", "tout à fait")

SOURCES = ("natural", "synthetic", "other")

_SOUNDS = (".wav", ".flac", ".mp3", ".ogg")

_SHORTEST_S = 0.5
"""Seconds of a recording at least."""

_MOST_APART = 0.5
"""Greatest relative difference in length between sound and motion of a recording."""


def prepare(
    folder: Path,
    recordings: Path,
    voice_name: str,
    *,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Trial:
    """Make the items of a test from a folder of recordings and write it into a folder that exists.

    Parameters
    ----------
    folder : Path
    recordings : Path
        For each sentence ``NAME.npz``, the natural movement with its score (`cuecast capture`
        gives it), and ``NAME.wav`` (or flac, mp3, ogg), the speech of the same take.
    voice_name : str
        The voice of the motions.
    seed : int
    progress : callable

    Raises
    ------
    CueError
        If there are fewer than two recordings, or one of them lacks its sound or its score.
    """
    voice = load_voice(voice_name)
    paths = sorted(recordings.glob("*.npz"))
    if len(paths) < 2:
        raise CueError(f"{recordings}: {len(paths)} motions (*.npz), at least 2 are needed")
    takes = [_take(path, voice) for path in paths]
    pool = []
    for number, (path, motion, sound) in enumerate(takes):
        other = takes[(number + 1) % len(takes)][1]
        pool.append(_entry(folder, path.stem, motion, other, sound, voice, seed))
        progress(number + 1, len(takes))
    trial = Trial(folder, "naturalness", voice_name, seed, {"sources": SOURCES}, pool)
    write_trial(trial)
    return trial


def _take(path: Path, voice: Voice) -> tuple[Path, Motion, Path]:
    motion = load_motion(path)
    voice.check_motion(motion)
    sounds = [path.with_suffix(end) for end in _SOUNDS if path.with_suffix(end).is_file()]
    if not sounds:
        raise CueError(f"{path}: no speech beside it ({', '.join(_SOUNDS)})")
    if motion.score is None or not motion.score.phones:
        raise CueError(
            f"{path}: no phones in its score: the synthesiser needs their times "
            "(cuecast capture with the text)"
        )
    if motion.duration_s < _SHORTEST_S:
        raise CueError(f"{path}: {motion.duration_s:.2f} s, the least is {_SHORTEST_S} s")
    _check_length(path, motion, sounds[0])
    return path, motion, sounds[0]


def _check_length(path: Path, motion: Motion, sound: Path) -> None:
    from receiver.media.programme import open_programme

    with open_programme(sound) as programme:
        length_s = programme.duration_s
    if length_s and abs(length_s - motion.duration_s) > _MOST_APART * motion.duration_s:
        raise CueError(
            f"{sound}: {length_s:.1f} s of sound, {motion.duration_s:.1f} s of motion in {path}"
        )


def _entry(
    folder: Path, name: str, motion: Motion, other: Motion, sound: Path, voice: Voice, seed: int
) -> dict[str, Any]:
    assert motion.score is not None
    made = motion_of(motion.score.shifted(-motion.start_s), voice, seed=seed)
    shutil.copyfile(sound, folder / ITEMS / f"{name}{sound.suffix}")
    shown = {"natural": motion, "synthetic": made, "other": other}
    return {
        "name": name,
        "sound": f"{ITEMS}/{name}{sound.suffix}",
        "motions": {
            source: save_item(folder, f"{name}-{source}", _as_long_as(one, motion))
            for source, one in shown.items()
        },
    }


def _as_long_as(motion: Motion, wanted: Motion) -> Motion:
    """Return a motion from time 0 on with as many frames as `wanted`, its ends held; no score."""
    times = motion.start_s + np.arange(len(wanted.params)) / wanted.rate_hz
    return Motion(sample_params(motion, times), wanted.rate_hz, 0.0, wanted.layout, wanted.voice)


def steps(trial: Trial, number: int) -> list[Step]:
    """Return a participant's trials: every recording in all three ways, in random order."""
    rng = trial.rng(number)
    found = [
        Step(
            item=entry["name"],
            condition=ItemCondition(source=source),
            prompt=PROMPT,
            choices=SCALE,
            motion=entry["motions"][source],
            sound=entry["sound"],
        )
        for entry in trial.pool
        for source in trial.settings["sources"]
    ]
    return [found[i] for i in rng.permutation(len(found))]
