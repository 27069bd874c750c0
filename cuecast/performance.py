"""Speech and motion of a score from recorded units, passage by passage."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import soundfile

from codec.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.errors import CueError
from codec.motion import Motion
from codec.score import Score
from codec.voice import Voice
from cuecast.files import whole_file
from cuecast.progress import count_bar
from synth.archive import built_in_recordings, read_archive, write_archive
from synth.body.anatomy import IDENTITIES
from synth.concatenation import ConcatenativeSynthesiser, Performance
from synth.gesture import GestureSynthesiser
from synth.recording import Recording
from synth.speaker import Refusal, read_transcripts, record_speaker


def unit_synthesiser(
    voice: Voice, folder: str | None = None, *, rest_gap_s: float = DEFAULT_OPTIONS.rest_gap_s
) -> ConcatenativeSynthesiser:
    """Return the dictionaries of `voice`, or those that `record_folder` wrote.

    The virtual cuer's own recordings are made on first use.

    Raises
    ------
    CueError
        If no cuer of that name can be recorded, or the folder holds another voice's recordings.
    """
    options = CueingOptions(rest_gap_s=rest_gap_s)
    if folder is not None:
        return ConcatenativeSynthesiser(read_archive(folder), voice, options=options)
    _check_cuer(voice)
    with count_bar("recording the voice") as progress:
        recordings = built_in_recordings(voice, identity=voice.name, progress=progress)
    return ConcatenativeSynthesiser(recordings, voice, options=options)


def record_folder(
    source: str, target: str, voice: Voice, *, progress: Callable[[int, int], None]
) -> list[str]:
    """Make recordings of a speaker's sounds, write them, and say what was left out.

    Raises
    ------
    CueError
        If there are no sounds with transcripts, none of them can be used, or `target` exists.
    """
    _check_cuer(voice)
    if Path(target).exists():
        raise CueError(f"{target} exists already")
    cuer = GestureSynthesiser(voice.name, alignment="paper")
    utterances = read_transcripts(Path(source))
    taken: list[Recording] = []
    refused: list[str] = []
    for done, item in enumerate(record_speaker(utterances, cuer, voice), 1):
        if isinstance(item, Refusal):
            refused.append(f"{item.path}: {item.reason}")
        else:
            taken.append(item)
        progress(done, len(utterances))
    if not taken:
        raise CueError(f"{source}: none of {len(utterances)} sounds can be used: {refused[0]}")
    write_archive(target, taken)
    return refused


def _check_cuer(voice: Voice) -> None:
    if voice.name not in IDENTITIES:
        raise CueError(f"voice {voice.name} is no virtual cuer's: nobody can be recorded")


def perform(
    score: Score,
    voice: Voice,
    *,
    rate_hz: float,
    units: str | None = None,
    speech: str | None = None,
    rest_gap_s: float = DEFAULT_OPTIONS.rest_gap_s,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Motion:
    """Return the motion of a score and write its speech, both from time 0 on.

    Parameters
    ----------
    score : Score
        With at least one phone, none before time 0.
    voice : Voice
    rate_hz : float
        Frames per second of the motion.
    units : str, optional
        Folder of recordings; by default the virtual cuer's own.
    speech : str, optional
        Sound file to write, by its suffix WAV or FLAC.
    rest_gap_s : float
        Silence after which the hand rests.
    progress : callable
        Told how many seconds each passage brought.
    """
    synthesiser = unit_synthesiser(voice, units, rest_gap_s=rest_gap_s)
    params = []
    with ExitStack() as stack:
        write = _writer(stack, speech, synthesiser.fs)
        for part in _from_zero(synthesiser.perform(score, rate_hz=rate_hz), rate_hz):
            write(part.sound)
            params.append(part.motion.params)
            progress(part.motion.duration_s)
    return Motion(np.concatenate(params), rate_hz, 0.0, voice.layout, voice.identity, score)


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


def _from_zero(parts: Iterator[Performance], rate_hz: float) -> Iterator[Performance]:
    """Trim what comes before time 0, or hold the first frame and silence from there on."""
    for number, part in enumerate(parts):
        if number:
            yield part
            continue
        frames = round(part.motion.start_s * rate_hz)
        samples = round(part.motion.start_s * part.fs)
        sound, params = part.sound[max(-samples, 0) :], part.motion.params[max(-frames, 0) :]
        sound = np.pad(sound, (max(samples, 0), 0))
        params = np.pad(params, ((max(frames, 0), 0), (0, 0)), mode="edge")
        motion = part.motion
        yield Performance(
            sound, part.fs,
            Motion(params, rate_hz, 0.0, motion.layout, motion.voice, motion.score),
        )  # fmt: skip
