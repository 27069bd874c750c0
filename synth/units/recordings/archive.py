"""Recordings on disk, and the built-in ones, made once into the user's cache.

An archive is a folder: ``sound.flac`` holds all sounds in a row, ``labels.npz`` everything else.
It is written under a temporary name and moved when complete.
"""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.movement import FLOWING
from codec.cuer.voice import Voice
from codec.cues.score import Score
from codec.errors import CueError
from codec.files.npz import read_arrays, write_arrays
from synth.motion.rules.movement import Gestures
from synth.units.recordings.recording import UnitRecording
from synth.units.speech.marks import PitchMarks
from synth.units.speech.pitch import PitchTrack

FORMAT = "cuecast-recordings-1"

_MAX_LABEL_BYTES = 1 << 30
"""Bytes of labels, unpacked, at most: a bound against hostile files."""

_GESTURE_FIELDS = ("shape", "placement", "leave", "reach")

Progress = Callable[[int, int], None]
"""Called with what is done and what there is to do."""


def write_archive(folder: str | os.PathLike[str], recordings: Sequence[UnitRecording]) -> None:
    """Write recordings of one sample rate and one voice into a new folder.

    Raises
    ------
    CueError
        If there is no recording or the folder exists already.
    """
    target = Path(folder)
    if not recordings:
        raise CueError("no recording to write")
    if target.exists():
        raise CueError(f"{target} exists already")
    target.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}."))
    try:
        with soundfile.SoundFile(
            work / "sound.flac", "w", samplerate=recordings[0].fs, channels=1, subtype="PCM_16"
        ) as file:
            for recording in recordings:
                file.write(recording.sound)
        write_arrays(work / "labels.npz", _labels(recordings))
        work.chmod(0o755)
        work.rename(target)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def _labels(recordings: Sequence[UnitRecording]) -> dict[str, NDArray[Any]]:
    first = recordings[0].motion
    scores = json.dumps([r.score.to_json() for r in recordings]).encode()
    arrays: dict[str, NDArray[Any]] = {
        "format": np.array(FORMAT),
        "voice": np.array(first.voice),
        "layout": np.array(first.layout, dtype=np.str_),
        "rate_hz": np.array(first.rate_hz),
        "hop_s": np.array(recordings[0].track.hop_s),
        "scores": np.frombuffer(scores, dtype=np.uint8),
        "start_s": np.array([r.motion.start_s for r in recordings]),
        "samples": np.array([len(r.sound) for r in recordings]),
        "frames": np.array([len(r.motion.params) for r in recordings]),
        "params": np.concatenate([r.motion.params for r in recordings]),
        "pitches": np.array([len(r.track.f0) for r in recordings]),
        "f0": np.concatenate([r.track.f0 for r in recordings]).astype(np.float32),
        "marks": np.array([len(r.marks.sample) for r in recordings]),
        "mark": np.concatenate([r.marks.sample for r in recordings]).astype(np.int32),
        "voiced": np.concatenate([r.marks.voiced for r in recordings]),
        "gestures": np.array([len(r.gestures.reach) for r in recordings]),
    }
    for name in _GESTURE_FIELDS:
        arrays[name] = np.concatenate([getattr(r.gestures, name) for r in recordings])
    return arrays


def read_archive(folder: str | os.PathLike[str]) -> list[UnitRecording]:
    """Read what `write_archive` wrote.

    Raises
    ------
    CueError
        If the folder is missing, incomplete or damaged.
    """
    path = Path(folder)
    arrays = read_arrays(path / "labels.npz", max_bytes=_MAX_LABEL_BYTES)
    try:
        if str(arrays["format"]) != FORMAT:
            raise CueError(f"{path}: format {arrays['format']} is not {FORMAT}")
        sound, fs = soundfile.read(path / "sound.flac", dtype="float32")
        return _recordings(arrays, sound, fs)
    except (KeyError, ValueError, TypeError, IndexError, soundfile.SoundFileError) as error:
        raise CueError(f"{path}: damaged recordings: {error}") from error


def _recordings(
    arrays: dict[str, NDArray[Any]], sound: NDArray[np.float32], fs: int
) -> list[UnitRecording]:
    scores = json.loads(arrays["scores"].tobytes())
    layout, voice = tuple(map(str, arrays["layout"])), str(arrays["voice"])
    rate_hz, hop_s = float(arrays["rate_hz"]), float(arrays["hop_s"])

    def pieces(lengths: str, values: NDArray[Any]) -> list[NDArray[Any]]:
        bounds = np.cumsum(arrays[lengths])
        if len(bounds) != len(scores) or bounds[-1] != len(values):
            raise ValueError(f"{lengths} do not add up to {len(values)}")
        return np.split(values, bounds[:-1])

    sounds, params = pieces("samples", sound), pieces("frames", arrays["params"])
    f0 = pieces("pitches", arrays["f0"].astype(np.float64))
    mark = pieces("marks", arrays["mark"].astype(np.int64))
    voiced = pieces("marks", arrays["voiced"])
    gestures = [pieces("gestures", arrays[name]) for name in _GESTURE_FIELDS]
    return [
        UnitRecording(
            sounds[i],
            fs,
            Score.from_json(text),
            Gestures(*(line[i] for line in gestures)),
            Motion(params[i], rate_hz, float(arrays["start_s"][i]), layout, voice),
            PitchTrack(f0[i], hop_s),
            PitchMarks(mark[i], voiced[i], fs),
        )
        for i, text in enumerate(scores)
    ]


def cache_folder() -> Path:
    """Return the folder for what can be made again: ``$XDG_CACHE_HOME/cuecast``."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "cuecast"


def built_in_recordings(
    voice: Voice,
    *,
    sentences: Sequence[str] | None = None,
    identity: str = "claire",
    alignment: str = "paper",
    folder: Path | None = None,
    progress: Progress | None = None,
) -> list[UnitRecording]:
    """Return recordings of the virtual cuer, from the cache or made now.

    Parameters
    ----------
    voice : Voice
        What her motion is expressed in.
    sentences : sequence of str, optional
        What she may say, by default the project's own list; of a list longer than the paper's
        corpus, a choice is said that covers French as the whole does.
    identity : str
        One of `synth.motion.body.anatomy.IDENTITIES`.
    alignment : str
        One of `synth.motion.rules.movement.ALIGNMENTS`.
    folder : Path, optional
        Where archives are kept; by default `cache_folder`.
    progress : callable, optional
        Called after every sentence.

    Notes
    -----
    The archive's name is a hash of everything that it depends on: another voice, text or cuer
    makes another archive.
    """
    from synth.language.text.sentences import read_sentences
    from synth.motion.rules.gesture import GestureSynthesiser
    from synth.units.recordings.rendered import RATES, record
    from synth.units.recordings.sentences import choose_sentences

    texts = read_sentences() if sentences is None else list(sentences)
    moves = FLOWING.as_array().tolist()
    key = json.dumps([FORMAT, voice.identity, identity, alignment, RATES, moves, texts])
    name = f"recordings-{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    archive = (folder or cache_folder()) / name
    if archive.exists():
        try:
            return read_archive(archive)
        except CueError:
            shutil.rmtree(archive)
    cuer = GestureSynthesiser(identity, alignment=alignment)
    texts, _ = choose_sentences(texts)
    recordings: list[UnitRecording] = []
    for done, recording in enumerate(record(texts, cuer, voice), 1):
        recordings.append(recording)
        if progress is not None:
            progress(done, len(texts))
    write_archive(archive, recordings)
    return recordings
