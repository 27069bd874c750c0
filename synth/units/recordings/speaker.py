"""Recordings of a real speaker: sounds and their texts, aligned, checked, and cued.

In: a folder of sounds with transcripts. Out: recordings of a sentence or some breath groups, with
the speaker's sound and the virtual cuer's motion in step with it.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
from synth.planning.alignment.align import SpokenPassage
from synth.planning.alignment.sound import mono
from synth.planning.prosody.duration import predict_durations
from synth.units.recordings.fits import label_fits
from synth.units.recordings.groups import BreathGroup, breath_groups, joined_groups
from synth.units.recordings.recording import UnitRecording

FS = 24_000
"""Rate at which the speaker's sound is kept, Hz: one that Opus has."""

SUFFIXES = (".wav", ".flac", ".ogg", ".mp3")

_LONGEST_S = 240.0
"""Longest recording in seconds that is taken: the search for its words takes 1 GB of memory."""

_TAIL_S = 1.0
"""Seconds of silence that a recording may have at either end."""

_REST_S = 0.5
"""Seconds before and after a recording: the hand comes up and goes to rest."""

_LEVEL = 0.08
"""Root mean square of the speech after levelling, full scale 1: -22 dB."""

_LEAST_VOICED = 0.5
"""Share of its vowels that must be voiced for a recording to count as speech."""

_LEAST_EXPECTED, _MOST_EXPECTED = 0.35, 4.0
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
) -> Iterator[list[UnitRecording] | Refusal]:
    """Yield the recordings, or the reason why there is none, for each utterance.

    Parameters
    ----------
    utterances : sequence of SpokenFile
        Of one speaker: sentences, or whole readings, which are cut at their pauses.
    cuer : GestureSynthesiser
        Who cues to the speaker's voice.
    voice : Voice
        What her motion is expressed in.
    options : CueingOptions
    """
    for utterance in utterances:
        try:
            yield _recorded(utterance, cuer, voice, options)
        except CueError as error:
            yield Refusal(utterance.path, str(error))


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
    utterance: SpokenFile, cuer: GestureSynthesiser, voice: Voice, options: CueingOptions
) -> list[UnitRecording]:
    """Return what can be used of an utterance.

    Raises
    ------
    CueError
        If it cannot be read, or nothing of it can be used.
    """
    sound = _read(utterance.path)
    words = tuple(phonemise(utterance.text))
    _check_length([s for word in words for s in word.phones], len(sound) / FS)
    groups = breath_groups(SpokenPassage(words, mono(sound, FS)))
    if not groups:
        raise CueError("its text does not fit its sound")
    spoken = np.concatenate([_cut(sound, g.phones[0].start, g.phones[-1].end) for g in groups])
    levelled = np.clip(sound * (_LEVEL / (spoken.std() + 1e-12)), -1.0, 1.0).astype(np.float32)
    made = [_cued(levelled, group, cuer, voice, options) for group in joined_groups(groups)]
    share = float(np.mean([voiced_share(recording) for recording in made]))
    if share < _LEAST_VOICED:
        raise CueError(f"only {share:.0%} of the vowels are voiced")
    return made


def _cut(sound: NDArray[Any], from_s: float, to_s: float) -> NDArray[Any]:
    return sound[round(from_s * FS) : round(to_s * FS)]


def _check_length(symbols: Sequence[str], length_s: float) -> None:
    """Check that a sound of this length can hold these phones.

    Raises
    ------
    CueError
        If it cannot.
    """
    if not symbols:
        raise CueError("its text has no phone")
    expected_s = float(predict_durations(symbols).sum())
    if length_s < _LEAST_EXPECTED * expected_s:
        raise CueError(f"{length_s:.1f} s are too short for its text")
    if length_s > _MOST_EXPECTED * expected_s + 2 * _TAIL_S:
        raise CueError(f"{length_s:.1f} s are too long for its text")


def _cued(
    sound: NDArray[np.float32],
    group: BreathGroup,
    cuer: GestureSynthesiser,
    voice: Voice,
    options: CueingOptions,
) -> UnitRecording:
    phones = tuple(
        Phone(p.symbol, p.start - group.start_s, p.end - group.start_s) for p in group.phones
    )
    score = Score(phones, tuple(cue(phones, options)))
    part = _cut(sound, group.start_s, group.end_s)
    n_frames = round((len(part) / FS + 2 * _REST_S) * cuer.rate_hz)
    motion = cuer.motion(score, -_REST_S, n_frames, voice)
    return UnitRecording.analysed(
        part,
        FS,
        score=score,
        gestures=cuer.gestures(score),
        motion=motion,
        fits=label_fits(part, FS, phones),
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
