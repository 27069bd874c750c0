"""Pairs of speaking voices for people: one sentence, two voices, which is understood better.

Each pair of voices meets in every sentence; half of the sentences begin with either. Sounds of a
pair are one file with a pause between them, at one loudness.
"""

import itertools
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray
from scipy.signal import resample_poly

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from cuecast.dubbing.performance import unit_synthesiser
from cuecast.practice.trial import ITEMS, ItemCondition, Step, Trial, save_item, write_trial
from synth.planning.scoring.text_score import score_of_text
from synth.units.recordings.archive import READER, RENDERED
from synth.units.speech.espeak_voice import speak

PROMPT = "Quelle voix comprend-on le mieux ?"

CHOICES = ("la première", "la seconde", "les deux aussi bien")

VOICES = ("reader", "units", "espeak")
"""Units of the built-in reader, units of espeak-ng, and espeak-ng itself."""

_FS = 24_000
"""Rate of the items in Hz: that of the reader's units."""

_PAUSE_S = 0.8
"""Silence between the two voices."""

_LEVEL = 0.08
"""Root mean square of each voice, full scale 1: -22 dB."""

_REST_HZ = 10.0
"""Frames per second of the motion at rest that gives an item its length."""

_WORDS_PER_MINUTE = 150
"""At which espeak-ng reads, as for `cuecast evaluate intelligibility`."""

Speech = Callable[[str], NDArray[np.float64]]


def prepare(
    folder: Path,
    voice_name: str,
    *,
    speakers: Sequence[str] = ("reader", "espeak"),
    sentences: int = 10,
    texts: Path | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Trial:
    """Make the sounds of a test and write it into a folder that exists.

    Parameters
    ----------
    folder : Path
    voice_name : str
        The cuer's voice, whose units speak.
    speakers : sequence of str
        At least two of `VOICES`.
    sentences : int
        Sentences that are said, the first of the text; an even number.
    texts : Path, optional
        One sentence a line; by default sentences of news.
    seed : int
    progress : callable

    Raises
    ------
    CueError
        If a speaker is unknown or alone, or there are not as many sentences.
    """
    unknown = [name for name in speakers if name not in VOICES]
    if unknown or len(set(speakers)) < 2:
        raise CueError(f"speakers {','.join(speakers)}: two or more of {', '.join(VOICES)}")
    if sentences % 2:
        raise CueError(f"{sentences} sentences: half of them begin with either voice")
    lines = _lines(texts)[:sentences]
    if len(lines) < sentences:
        raise CueError(f"{len(lines)} sentences, {sentences} are wanted")
    voice = load_voice(voice_name)
    says = {name: _speech(name, voice) for name in speakers}
    rng = np.random.default_rng(seed)
    pairs = list(itertools.combinations(speakers, 2))
    turned = {pair: rng.permutation(np.arange(sentences) % 2) for pair in pairs}
    pool = []
    for number, text in enumerate(lines):
        said = {name: _levelled(say(text)) for name, say in says.items()}
        for pair in pairs:
            first, second = pair[::-1] if turned[pair][number] else pair
            name = f"{number:02}-{first}-{second}"
            sound = np.concatenate([said[first], np.zeros(round(_PAUSE_S * _FS)), said[second]])
            soundfile.write(folder / ITEMS / f"{name}.flac", sound, _FS)
            pool.append(
                {
                    "name": name,
                    "text": text,
                    "source": f"{first}-{second}",
                    "sound": f"{ITEMS}/{name}.flac",
                    "motion": save_item(folder, name, _at_rest(voice, len(sound) / _FS)),
                }
            )
        progress(number + 1, sentences)
    trial = Trial(folder, "voices", voice_name, seed, {"trials": sentences}, pool)
    write_trial(trial)
    return trial


def _lines(path: Path | None) -> list[str]:
    """Return the sentences of a file.

    Raises
    ------
    CueError
        If it cannot be read.
    """
    source = resources.files("cuecast") / "evaluate" / "news.txt" if path is None else path
    try:
        return [line.strip() for line in source.read_text("utf-8").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise CueError(f"{source}: cannot be read: {error}") from error


def _speech(name: str, voice: Voice) -> Speech:
    """Return what says a text at `_FS`."""
    if name == "espeak":
        return lambda text: _resampled(*speak(text, words_per_minute=_WORDS_PER_MINUTE))
    synthesiser = unit_synthesiser(voice, {"reader": READER, "units": RENDERED}[name])

    def say(text: str) -> NDArray[np.float64]:
        pieces = synthesiser.perform([score_of_text(text, start_s=0.3)], start_s=0.0)
        return _resampled(np.concatenate([piece.sound for piece in pieces]), synthesiser.fs)

    return say


def _resampled(sound: NDArray[np.floating], fs: int) -> NDArray[np.float64]:
    common = np.gcd(fs, _FS)
    return np.asarray(resample_poly(sound.astype(np.float64), _FS // common, fs // common))


def _levelled(sound: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a sound without silence at its ends, at one loudness."""
    loud = np.flatnonzero(np.abs(sound) > 0.01 * np.abs(sound).max(initial=1e-9))
    sound = sound[loud[0] : loud[-1] + 1] if len(loud) else sound
    return np.asarray(np.clip(sound * (_LEVEL / (sound.std() + 1e-9)), -1.0, 1.0))


def _at_rest(voice: Voice, length_s: float) -> Motion:
    """Return a motion in which nothing moves."""
    params = np.zeros((int(np.ceil(length_s * _REST_HZ)), len(voice.layout)), dtype=np.float32)
    return Motion(params, _REST_HZ, 0.0, voice.layout, voice.identity)


def steps(trial: Trial, number: int) -> list[Step]:
    """Return a participant's trials: every pair of voices in every sentence, in random order."""
    found = [
        Step(
            item=entry["name"],
            prompt=PROMPT,
            choices=CHOICES,
            condition=ItemCondition(hand="", display="none", source=entry["source"]),
            motion=entry["motion"],
            sound=entry["sound"],
        )
        for entry in trial.pool
    ]
    return [found[i] for i in trial.rng(number).permutation(len(found))]
