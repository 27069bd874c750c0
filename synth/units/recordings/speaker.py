"""Recordings of a real speaker: sounds and their texts, aligned, checked, and cued.

In: a folder of sounds with transcripts. Out: recordings like the built-in ones, with the
speaker's sound and the virtual cuer's motion in step with it.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray
from scipy.signal import resample_poly

from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.phonology import VOWELS
from codec.cues.score import Phone, Score
from codec.errors import CueError
from synth.language.text.pronounce import phonemise
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.alignment.align import SpokenPassage, align_passages
from synth.planning.alignment.sound import mono
from synth.planning.prosody.duration import predict_durations
from synth.units.recordings.recording import UnitRecording

FS = 22_050
"""Rate at which the speaker's sound is kept, Hz."""

SUFFIXES = (".wav", ".flac", ".ogg", ".mp3")

_BATCH_S = 180.0
"""Seconds of speech that are aligned at once: enough for the models to adapt to the speaker."""

_LONGEST_S = 60.0
"""Longest recording in seconds that is taken: longer ones are not single sentences."""

_TAIL_S = 1.0
"""Seconds of silence that a recording may have at either end."""

_LEVEL = 0.08
"""Root mean square of the speech after levelling, full scale 1: -22 dB."""

_LEAST_VOICED = 0.5
"""Share of its vowels that must be voiced for a recording to count as speech."""

_LEAST_EXPECTED, _MOST_EXPECTED = 0.35, 2.5
"""Bounds of a recording's length over that which its text would usually take."""


@dataclass(frozen=True, slots=True)
class SpokenFile:
    """A sound file and its text."""

    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """A recording that was not taken, and why."""

    path: Path
    reason: str


def read_transcripts(folder: Path) -> list[SpokenFile]:
    """Return the utterances of a folder.

    A table ``*.tsv`` with the columns ``path`` (from the folder) and ``text`` names them; without
    one, every sound that has a text file of its name beside it counts.

    Raises
    ------
    CueError
        If there is no utterance, or a table lacks its columns.
    """
    found: list[SpokenFile] = []
    for table in sorted(folder.glob("*.tsv")):
        with table.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE)
            if not {"path", "text"} <= set(rows.fieldnames or ()):
                raise CueError(f"{table}: no columns 'path' and 'text'")
            found += [SpokenFile(folder / row["path"], row["text"] or "") for row in rows]
    if not found:
        for sound in sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES):
            text = sound.with_suffix(".txt")
            if text.exists():
                found.append(SpokenFile(sound, text.read_text("utf-8").strip()))
    if not found:
        raise CueError(f"{folder}: no sounds with transcripts")
    return found


def record_speaker(
    utterances: Sequence[SpokenFile],
    cuer: GestureSynthesiser,
    voice: Voice,
    *,
    options: CueingOptions = DEFAULT_OPTIONS,
) -> Iterator[UnitRecording | Refusal]:
    """Yield a recording, or the reason why there is none, for each utterance.

    Parameters
    ----------
    utterances : sequence of SpokenFile
        Of one speaker. Some minutes of them are aligned together.
    cuer : GestureSynthesiser
        Who cues to the speaker's voice.
    voice : Voice
        What her motion is expressed in.
    options : CueingOptions
    """
    batch: list[tuple[SpokenFile, NDArray[np.float64]]] = []
    length_s = 0.0
    for utterance in utterances:
        try:
            sound = _read(utterance.path)
        except CueError as error:
            yield Refusal(utterance.path, str(error))
            continue
        batch.append((utterance, sound))
        length_s += len(sound) / FS
        if length_s >= _BATCH_S:
            yield from _recorded(batch, cuer, voice, options)
            batch, length_s = [], 0.0
    yield from _recorded(batch, cuer, voice, options)


def _read(path: Path) -> NDArray[np.float64]:
    """Return one channel of a sound at `FS`."""
    try:
        with soundfile.SoundFile(path) as file:
            if file.frames > _LONGEST_S * file.samplerate:
                raise CueError(f"longer than {_LONGEST_S:.0f} s")
            sound, fs = file.read(always_2d=True).mean(axis=1), file.samplerate
    except (OSError, soundfile.SoundFileError) as error:
        raise CueError("not a readable sound") from error
    common = np.gcd(fs, FS)
    return np.asarray(resample_poly(sound, FS // common, fs // common), dtype=np.float64)


def _recorded(
    batch: Sequence[tuple[SpokenFile, NDArray[np.float64]]],
    cuer: GestureSynthesiser,
    voice: Voice,
    options: CueingOptions,
) -> Iterator[UnitRecording | Refusal]:
    passages, kept = [], []
    for utterance, sound in batch:
        words = tuple(phonemise(utterance.text))
        reason = _unsuitable([s for word in words for s in word.phones], len(sound) / FS)
        if reason:
            yield Refusal(utterance.path, reason)
            continue
        passages.append(SpokenPassage(words, mono(sound, FS)))
        kept.append((utterance, sound))
    for (utterance, sound), found in zip(kept, align_passages(passages), strict=True):
        recording = _cued(sound, found.phones, cuer, voice, options)
        share = voiced_share(recording)
        if share < _LEAST_VOICED:
            yield Refusal(utterance.path, f"only {share:.0%} of the vowels are voiced")
        else:
            yield recording


def _unsuitable(symbols: Sequence[str], length_s: float) -> str:
    """Return why a sound of this length cannot hold these phones; empty if it can."""
    if not symbols:
        return "its text has no phone"
    expected_s = float(predict_durations(symbols).sum())
    if length_s < _LEAST_EXPECTED * expected_s:
        return f"{length_s:.1f} s are too short for its text"
    if length_s > _MOST_EXPECTED * expected_s + 2 * _TAIL_S:
        return f"{length_s:.1f} s are too long for its text"
    return ""


def _cued(
    sound: NDArray[np.float64],
    phones: tuple[Phone, ...],
    cuer: GestureSynthesiser,
    voice: Voice,
    options: CueingOptions,
) -> UnitRecording:
    score = Score(phones, tuple(cue(phones, options)))
    first, last = round(phones[0].start * FS), round(phones[-1].end * FS)
    level = float(np.sqrt(np.mean(sound[first:last] ** 2))) + 1e-12
    levelled = np.clip(sound * (_LEVEL / level), -1.0, 1.0).astype(np.float32)
    n_frames = round((len(sound) / FS + 2 * _TAIL_S) * cuer.rate_hz)
    motion = cuer.motion(score, -_TAIL_S, n_frames, voice)
    return UnitRecording.analysed(
        levelled, FS, score=score, gestures=cuer.gestures(score), motion=motion
    )


def voiced_share(recording: UnitRecording) -> float:
    """Return the part of the vowels' time that has a pitch, 0..1.

    Where the text differs from the speech, vowels fall on silence and noise.
    """
    track = recording.track
    times = np.arange(len(track.f0)) * track.hop_s
    vowels = [p for p in recording.score.phones if p.symbol in VOWELS]
    if not vowels:
        return 1.0
    inside = np.zeros(len(times), dtype=np.bool_)
    for phone in vowels:
        inside |= (times >= phone.start) & (times < phone.end)
    return float((track.f0[inside] > 0).mean()) if inside.any() else 0.0
