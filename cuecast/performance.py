"""Speech and motion of a score from recorded units, passage by passage."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import soundfile

from codec.errors import CueError
from codec.motion import Motion
from codec.score import Score
from codec.voice import Voice
from cuecast.files import whole_file
from cuecast.progress import count_bar
from synth.archive import built_in_recordings
from synth.body.anatomy import IDENTITIES
from synth.concatenation import ConcatenativeSynthesiser, Performance


def unit_synthesiser(voice: Voice) -> ConcatenativeSynthesiser:
    """Return the dictionaries of `voice`, making its recordings on first use.

    Raises
    ------
    CueError
        If no cuer of that name can be recorded.
    """
    if voice.name not in IDENTITIES:
        raise CueError(f"voice {voice.name} has no recordings to take units from")
    with count_bar("recording the voice") as progress:
        recordings = built_in_recordings(voice, identity=voice.name, progress=progress)
    return ConcatenativeSynthesiser(recordings, voice)


def perform(
    score: Score,
    voice: Voice,
    *,
    rate_hz: float,
    speech: str | None = None,
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
    speech : str, optional
        Sound file to write, by its suffix WAV or FLAC.
    progress : callable
        Told how many seconds each passage brought.
    """
    synthesiser = unit_synthesiser(voice)
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
