"""Speech and motion of a score from recorded units, passage by passage."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import soundfile

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.errors import CueError
from codec.files.whole import whole_file
from cuecast.command.progress import count_bar
from synth.motion.body.anatomy import IDENTITIES
from synth.motion.rules.gesture import GestureSynthesiser
from synth.units.concatenation.concatenation import ConcatenativeSynthesiser
from synth.units.recordings.archive import (
    READER,
    RENDERED,
    built_in_recordings,
    read_archive,
    reader_recordings,
    write_archive,
)
from synth.units.recordings.recording import UnitRecording
from synth.units.recordings.speaker import Refusal, read_transcripts, record_speaker


def unit_synthesiser(
    voice: Voice,
    units: str | None = None,
    *,
    alignment: str = "paper",
    options: CueingOptions = DEFAULT_OPTIONS,
    seed: int = 0,
) -> ConcatenativeSynthesiser:
    """Return the dictionaries of a speaker and of the cuer `voice`.

    Parameters
    ----------
    voice : Voice
    units : str, optional
        A built-in speaker (`synth.units.recordings.archive.READER`, the default, or
        `synth.units.recordings.archive.RENDERED`), or a folder that `record_folder` wrote.
    alignment, options, seed
        As for `ConcatenativeSynthesiser`.

    Raises
    ------
    CueError
        If no cuer of that name can be recorded, or the folder holds another voice's recordings.
    """
    if units not in (None, READER, RENDERED):
        recordings = read_archive(str(units))
    else:
        _check_cuer(voice)
        with count_bar("recording the voice") as progress:
            built_in = built_in_recordings if units == RENDERED else reader_recordings
            recordings = built_in(voice, identity=voice.name, progress=progress)
    return ConcatenativeSynthesiser(
        recordings, voice, alignment=alignment, options=options, seed=seed
    )


def record_folder(
    source: str,
    target: str,
    voice: Voice,
    *,
    kbit_s: float | None = None,
    without: frozenset[str] = frozenset(),
    progress: Callable[[int, int], None],
) -> list[str]:
    """Make recordings of a speaker's sounds, write them, and report skipped ones.

    Sounds whose text is empty, or whose names are in `without`, are passed over.

    Raises
    ------
    CueError
        If there are no sounds with transcripts, none of them can be used, or `target` exists.
    """
    _check_cuer(voice)
    if Path(target).exists():
        raise CueError(f"{target} exists already")
    cuer = GestureSynthesiser(voice.name, alignment="paper")
    found = read_transcripts(Path(source))
    utterances = [one for one in found if one.path.stem not in without and one.text]
    taken: list[UnitRecording] = []
    refused: list[str] = []
    for done, item in enumerate(record_speaker(utterances, cuer, voice), 1):
        if isinstance(item, Refusal):
            refused.append(f"{item.path.name}: {item.reason}")
        else:
            taken += item
        progress(done, len(utterances))
    if not taken:
        raise CueError(f"{source}: none of {len(utterances)} sounds can be used: {refused[0]}")
    write_archive(target, taken, kbit_s=kbit_s)
    return refused


def _check_cuer(voice: Voice) -> None:
    if voice.name not in IDENTITIES:
        raise CueError(f"voice {voice.name} is no virtual cuer's: nobody can be recorded")


def perform(
    pieces: Iterable[Score],
    synthesiser: ConcatenativeSynthesiser,
    *,
    rate_hz: float,
    speech: str | None = None,
) -> Iterator[Motion]:
    """Yield the motion of a score part by part and write its speech, both from time 0 on.

    Parameters
    ----------
    pieces : iterable of Score
        In order of time.
    synthesiser : ConcatenativeSynthesiser
    rate_hz : float
        Frames per second of the motion.
    speech : str, optional
        Sound file to write, by its suffix WAV or FLAC; it appears when everything is said.
    """
    with ExitStack() as stack:
        write = _writer(stack, speech, synthesiser.fs)
        for part in synthesiser.perform(pieces, rate_hz=rate_hz, start_s=0.0):
            write(part.sound)
            yield part.motion


def _writer(
    stack: ExitStack, path: str | None, fs: int
) -> Callable[[np.ndarray[tuple[int], np.dtype[np.float32]]], None]:
    """Return the function that appends to the sound file `path`, if there is one."""
    if path is None:
        return lambda sound: None
    temporary = stack.enter_context(whole_file(path))
    try:
        file = stack.enter_context(soundfile.SoundFile(temporary, "w", fs, 1, "PCM_16"))
    except (TypeError, ValueError, soundfile.SoundFileError) as error:
        raise CueError(f"{path}: cannot write this kind of sound file") from error
    return lambda sound: file.write(np.clip(sound, -1.0, 1.0))
