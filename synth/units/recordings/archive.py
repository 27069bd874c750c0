"""Recordings on disk, and the built-in ones, made once into the user's cache.

An archive is a folder: ``sounds.bin`` holds the sounds, each packed by itself, in a row,
``labels.npz`` everything else. A sound is unpacked when a unit of it is said: reading an archive
takes the labels alone. It is written under a temporary name and moved when complete.
"""

import hashlib
import io
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
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
from synth.units.recordings.recording import PackedSound, UnitRecording
from synth.units.speech.marks import PitchMarks
from synth.units.speech.pitch import PitchTrack

READER, RENDERED = "margot", "espeak"
"""Names of the built-in speakers: one who read for LibriVox, and the voice of espeak-ng."""

READER_ASSET = Path(__file__).parents[2] / "assets" / READER

FORMAT = "cuecast-recordings-2"

_MAX_LABEL_BYTES = 1 << 30
"""Bytes of labels, unpacked, at most: a bound against hostile files."""

_STEPS = 16
"""Steps of a motion parameter within its standard deviation."""

_LSP_STEPS = 255 / np.pi
"""Steps of a line spectrum pair in a radian."""

_OPUS_KBIT_S = (6.0, 256.0)
"""Bit rates for one channel that libsndfile's levels of compression, 1 to 0, stand for."""

_GESTURE_FIELDS = ("shape", "placement", "leave", "reach")

Progress = Callable[[int, int], None]
"""Called with the number done and the number to do."""


def write_archive(
    folder: str | os.PathLike[str],
    recordings: Sequence[UnitRecording],
    *,
    kbit_s: float | None = None,
) -> None:
    """Write recordings of one sample rate and one voice into a new folder.

    Parameters
    ----------
    folder : path-like
    recordings : sequence of UnitRecording
    kbit_s : float, optional
        Bit rate of the sounds in Opus, 6 to 256; by default they are kept exactly, in FLAC.

    Raises
    ------
    CueError
        If there is no recording, the folder exists already, or Opus has not their sample rate.
    """
    target = Path(folder)
    if not recordings:
        raise CueError("no recording to write")
    if target.exists():
        raise CueError(f"{target} exists already")
    target.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}."))
    try:
        packed = [_packed(recording, kbit_s) for recording in recordings]
        (work / "sounds.bin").write_bytes(b"".join(packed))
        arrays = _labels(recordings) | {"bytes": np.array([len(data) for data in packed])}
        write_arrays(work / "labels.npz", arrays)
        work.chmod(0o755)
        work.rename(target)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def _packed(recording: UnitRecording, kbit_s: float | None) -> bytes:
    if isinstance(recording.source, PackedSound):
        return recording.source.data
    stream = io.BytesIO()
    how: dict[str, Any] = {"format": "FLAC", "subtype": "PCM_16"}
    if kbit_s is not None:
        low, high = _OPUS_KBIT_S
        level = float(np.clip((high - kbit_s) / (high - low), 0.0, 1.0))
        how = {"format": "OGG", "subtype": "OPUS", "compression_level": level}
    try:
        with soundfile.SoundFile(stream, "w", recording.fs, 1, **how) as file:
            file.write(recording.sound)
    except soundfile.SoundFileError as error:
        raise CueError(f"sound of {recording.fs} Hz cannot be packed: {error}") from error
    return stream.getvalue()


def _labels(recordings: Sequence[UnitRecording]) -> dict[str, NDArray[Any]]:
    first = recordings[0].motion
    scores = json.dumps([r.score.to_json() for r in recordings]).encode()
    params = np.concatenate([r.motion.params for r in recordings]).astype(np.float64)
    middle, step = params.mean(axis=0), np.maximum(params.std(axis=0), 1e-6) / _STEPS
    # Parameters in steps of a fraction of their deviation, as differences: small integers compress
    # well.
    whole = np.rint((params - middle) / step).astype(np.int32)
    middles = np.concatenate([r.middles for r in recordings])
    arrays: dict[str, NDArray[Any]] = {
        "format": np.array(FORMAT),
        "voice": np.array(first.voice),
        "layout": np.array(first.layout, dtype=np.str_),
        "rate_hz": np.array(first.rate_hz),
        "hop_s": np.array(recordings[0].track.hop_s),
        "fs": np.array(recordings[0].fs),
        "scores": np.frombuffer(scores, dtype=np.uint8),
        "start_s": np.array([r.motion.start_s for r in recordings]),
        "samples": np.array([r.samples for r in recordings]),
        "frames": np.array([len(r.motion.params) for r in recordings]),
        "middle": middle,
        "step": step,
        "changes": np.ascontiguousarray(np.diff(whole.T, axis=1, prepend=0), dtype=np.int16),
        "pitches": np.array([len(r.track.f0) for r in recordings]),
        "f0": np.concatenate([r.track.f0 for r in recordings]).astype(np.float16),
        "marks": np.array([len(r.marks.sample) for r in recordings]),
        "mark_steps": np.concatenate(
            [np.diff(r.marks.sample, prepend=0) for r in recordings]
        ).astype(np.int32),
        "voiced": np.packbits(np.concatenate([r.marks.voiced for r in recordings])),
        "phones": np.array([len(r.score.phones) for r in recordings]),
        "pairs": np.rint(middles[:, :-1] * _LSP_STEPS).astype(np.uint8),
        "level_db": middles[:, -1].astype(np.float16),
        "fits": np.concatenate([r.fits for r in recordings]).astype(np.float16),
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
        return _recordings(arrays, (path / "sounds.bin").read_bytes())
    except (KeyError, ValueError, TypeError, IndexError, OSError) as error:
        raise CueError(f"{path}: damaged recordings: {error}") from error


def _recordings(arrays: dict[str, NDArray[Any]], packed: bytes) -> list[UnitRecording]:
    scores = json.loads(arrays["scores"].tobytes())
    layout, voice = tuple(map(str, arrays["layout"])), str(arrays["voice"])
    rate_hz, hop_s, fs = float(arrays["rate_hz"]), float(arrays["hop_s"]), int(arrays["fs"])

    def pieces(lengths: str, values: NDArray[Any]) -> list[NDArray[Any]]:
        bounds = np.cumsum(arrays[lengths])
        if len(bounds) != len(scores) or bounds[-1] != len(values):
            raise ValueError(f"{lengths} do not add up to {len(values)}")
        return np.split(values, bounds[:-1])

    whole = np.cumsum(arrays["changes"], axis=1, dtype=np.int32).T
    values = (whole * arrays["step"] + arrays["middle"]).astype(np.float32)
    sounds = pieces("bytes", np.frombuffer(packed, dtype=np.uint8))
    params = pieces("frames", values)
    f0 = pieces("pitches", arrays["f0"].astype(np.float64))
    marks = pieces("marks", arrays["mark_steps"].astype(np.int64))
    voiced = np.unpackbits(arrays["voiced"], count=len(arrays["mark_steps"])).astype(np.bool_)
    voiced_marks = pieces("marks", voiced)
    spectra = np.column_stack([arrays["pairs"] / _LSP_STEPS, arrays["level_db"]])
    middles = pieces("phones", spectra.astype(np.float32))
    # Folders from before labels were judged count as certain.
    fits = pieces("phones", arrays.get("fits", np.zeros(len(spectra))).astype(np.float32))
    gestures = [pieces("gestures", arrays[name]) for name in _GESTURE_FIELDS]
    return [
        UnitRecording(
            PackedSound(sounds[i].tobytes(), int(arrays["samples"][i])),
            fs,
            Score.from_json(text),
            Gestures(*(line[i] for line in gestures)),
            Motion(params[i], rate_hz, float(arrays["start_s"][i]), layout, voice),
            PitchTrack(f0[i], hop_s),
            PitchMarks(np.cumsum(marks[i]), voiced_marks[i], fs),
            middles[i],
            fits[i],
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

    def make() -> Iterator[UnitRecording]:
        chosen, _ = choose_sentences(texts)
        cuer = GestureSynthesiser(identity, alignment=alignment)
        for done, recording in enumerate(record(chosen, cuer, voice), 1):
            yield recording
            if progress is not None:
                progress(done, len(chosen))

    return _kept((folder or cache_folder()) / name, make)


def reader_recordings(
    voice: Voice,
    *,
    identity: str = "claire",
    folder: Path | None = None,
    progress: Progress | None = None,
) -> list[UnitRecording]:
    """Return the recordings of the built-in reader, cued by a virtual cuer.

    Those of the usual cuer come with the package; another one's are made once into the cache.

    Parameters
    ----------
    voice, identity, folder, progress
        As for `built_in_recordings`.

    Raises
    ------
    CueError
        If the asset is damaged.
    """
    from synth.motion.rules.gesture import GestureSynthesiser

    spoken = read_archive(READER_ASSET)
    if spoken[0].motion.voice == voice.identity:
        return spoken
    digest = hashlib.sha256((READER_ASSET / "labels.npz").read_bytes()).hexdigest()
    moves = FLOWING.as_array().tolist()
    key = json.dumps([FORMAT, voice.identity, identity, moves, digest])

    def make() -> Iterator[UnitRecording]:
        cuer = GestureSynthesiser(identity, alignment="paper")
        for done, recording in enumerate(spoken, 1):
            still = recording.motion
            motion = cuer.motion(recording.score, still.start_s, len(still.params), voice)
            yield replace(recording, gestures=cuer.gestures(recording.score), motion=motion)
            if progress is not None:
                progress(done, len(spoken))

    name = f"recordings-{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    return _kept((folder or cache_folder()) / name, make)


def _kept(archive: Path, make: Callable[[], Iterator[UnitRecording]]) -> list[UnitRecording]:
    """Return the recordings of an archive, which is made if it is missing or damaged."""
    if archive.exists():
        try:
            return read_archive(archive)
        except CueError:
            shutil.rmtree(archive)
    recordings = list(make())
    write_archive(archive, recordings)
    return recordings
