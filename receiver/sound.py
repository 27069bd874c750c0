"""The sound of a programme as float32 blocks with times, from any start.

Times are on the clock of a player that shows the file: zero is the container's start time, so
that block, picture and cuer agree.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import av
import numpy as np
from av.audio.resampler import AudioResampler
from av.container import InputContainer
from numpy.typing import NDArray

from codec.errors import CueError

NATIVE_RATES = (32000, 44100, 48000)
"""Sampling rates the audio carrier is defined at; others are converted to 48 kHz."""

_BLOCK_S = 0.5


@dataclass(slots=True)
class Sound:
    """An open sound; see `open_sound`."""

    container: InputContainer
    fs: int
    channels: int
    start_s: float

    def blocks(self) -> Iterator[tuple[float, NDArray[np.float32]]]:
        """Yield (time of the first sample in seconds, samples (n, channels)).

        Samples before `start_s` are left out; a jump of the file's timestamps shows as a jump of
        the times.
        """
        resampler = AudioResampler(format="fltp", layout=None, rate=self.fs)
        origin_s = (self.container.start_time or 0) / av.time_base
        waiting: list[NDArray[np.float32]] = []
        first_s, held = 0.0, 0
        for time_s, samples in self._frames(resampler, origin_s):
            due_s = first_s + held / self.fs
            if waiting and (abs(time_s - due_s) > 0.02 or held >= _BLOCK_S * self.fs):
                yield first_s, np.concatenate(waiting)
                waiting, held = [], 0
            if not waiting:
                first_s = time_s
            waiting.append(samples)
            held += len(samples)
        if waiting:
            yield first_s, np.concatenate(waiting)

    def _frames(
        self, resampler: AudioResampler, origin_s: float
    ) -> Iterator[tuple[float, NDArray[np.float32]]]:
        due_s = 0.0
        for frame in self._decoded():
            time_s = due_s if frame.time is None else frame.time - origin_s
            for part in resampler.resample(frame):
                samples = np.ascontiguousarray(part.to_ndarray().T, dtype=np.float32)
                early = round((self.start_s - time_s) * self.fs)
                if early < len(samples):
                    skipped = max(0, early)
                    yield time_s + skipped / self.fs, samples[skipped:]
                time_s += len(samples) / self.fs
            due_s = time_s

    def _decoded(self) -> Iterator[av.AudioFrame]:
        """Decode on past damaged packets: a television does not stop at one."""
        for packet in self.container.demux(audio=0):
            try:
                yield from packet.decode()
            except av.error.InvalidDataError:
                continue


@contextmanager
def open_sound(path: str | os.PathLike[str], *, start_s: float = 0.0) -> Iterator[Sound]:
    """Open the first sound track of a file at `start_s` on the programme's clock.

    Raises
    ------
    CueError
        If the file cannot be read or has no sound.
    """
    try:
        container = av.open(os.fspath(path), metadata_errors="ignore")
    except (av.error.FFmpegError, OSError) as error:
        raise CueError(f"{path}: cannot be read as media: {error}") from error
    with container:
        if not container.streams.audio:
            raise CueError(f"{path}: has no sound")
        stream = container.streams.audio[0]
        rate = stream.codec_context.sample_rate
        channels = stream.codec_context.channels
        if start_s > 0:
            origin = container.start_time or 0
            container.seek(origin + int(start_s * av.time_base), backward=True)
        yield Sound(container, rate if rate in NATIVE_RATES else 48000, channels, start_s)
