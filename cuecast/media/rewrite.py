"""A programme written again with another sound; everything else is copied packet by packet.

Pictures, other sounds and subtitles pass untouched, with their times, languages and roles; only
the one sound is decoded, changed by a stage and encoded again.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from av.container import OutputContainer
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.media.copying import Copies, copy_labels, damaged_frames, wave_options
from cuecast.media.dolby import TELLING, first_settings
from cuecast.media.encode import SoundEncoder, SoundTarget, choose_target, encoder_of, usual_codec
from cuecast.media.output import open_output
from receiver.media.programme import Programme, SoundFormat, open_programme
from receiver.media.rates import measured_bit_rate
from receiver.media.sound import SoundDecoder


class Stage(Protocol):
    """What changes the sound: its samples come out later, changed, none of them left out."""

    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take and give samples of shape (n, channels)."""

    def flush(self) -> NDArray[np.float32]:
        """Give the samples that were held back."""


class Unchanged:
    """The stage that changes nothing: for another codec or container alone."""

    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the input unchanged."""
        return block

    def flush(self) -> NDArray[np.float32]:
        """Give nothing."""
        return np.zeros((0, 1), np.float32)


@dataclass(frozen=True, slots=True)
class Rewritten:
    """What `rewrite_sound` did.

    Sound parameters, length, start, clipped samples, streams left out, and what of the sound's
    coding is another than the programme's.
    """

    sound: SoundFormat
    duration_s: float
    start_s: float
    clipped: int
    left_out: tuple[str, ...]
    changed: tuple[str, ...]


def rewrite_sound(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    stage: Callable[[SoundFormat, float, SoundTarget], Stage],
    *,
    track: int = 0,
    codec: str | None = None,
    bit_rate: int | None = None,
    alone: bool = False,
    mend: bool = False,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Rewritten:
    """Copy the programme `source` to `target` with its sound passed through a stage.

    Parameters
    ----------
    source, target : path
        The suffix of `target` names the container.
    stage : callable
        Called once with the sound's format, the time of its first sample on the programme's clock
        and the coding of the output; gives the stage.
    track : int
        Which of the programme's sounds, from 0.
    codec, bit_rate : optional
        Sound codec and bits per second of the output; by default those of the programme, as far
        as the container usually holds them.
    alone : bool
        Write the sound only.
    mend : bool
        Whether damaged frames of the sound become silence.
    progress : callable
        Called with the seconds of sound that each block brought.

    Raises
    ------
    CueError
        If the programme is malformed or truncated, its sound damaged and not to be mended, or the
        output cannot be written. No output is left behind then.
    """
    if _same_file(source, target):
        raise CueError(f"{target}: the output would overwrite the programme")
    suffix = Path(target).suffix
    with ExitStack() as opened:
        programme = opened.enter_context(open_programme(source, track=track))
        options = wave_options(programme.container) if suffix.lower() == ".wav" else {}
        container = opened.enter_context(open_output(target, options))
        wanted = codec or usual_codec(programme.format, suffix)
        writer = _SoundWriter(programme, container, source, wanted, bit_rate, alone, mend)
        return writer.run(stage, progress)


class _SoundWriter:
    """The loop of `rewrite_sound`: packets of `programme` in, packets of `container` out."""

    def __init__(
        self,
        programme: Programme,
        container: OutputContainer,
        source: str | os.PathLike[str],
        codec: str,
        bit_rate: int | None,
        alone: bool,
        mend: bool,
    ) -> None:
        self._programme = programme
        self._container = container
        self._decoder = SoundDecoder(programme, strict=not mend)
        sound = self._decoder.format
        track = list(programme.container.streams.audio).index(programme.sound)
        if not sound.bit_rate or _is_guessed(programme):
            sound = replace(sound, bit_rate=measured_bit_rate(source, track=track))
        self._target = target = choose_target(sound, codec=codec, bit_rate=bit_rate)
        self._copies = Copies(programme.container, container)
        for stream in programme.container.streams:
            if stream is programme.sound:
                told = first_settings(source, track) if target.encoder in TELLING else {}
                self._encoder = SoundEncoder(container, sound, target, told)
                copy_labels(stream, self._encoder.stream)
            elif not alone:
                self._copies.add(stream)
        self._encoder.open()
        kept = encoder_of(sound.codec) == target.encoder
        self._changed: tuple[str, ...] = (
            () if kept else (f"sound: {sound.codec} is now {target.encoder}",)
        )

    def run(
        self,
        make_stage: Callable[[SoundFormat, float, SoundTarget], Stage],
        progress: Callable[[float], None],
    ) -> Rewritten:
        """Copy, change, encode to the end."""
        stage: Stage | None = None
        for packet in self._packets():
            if packet is None or packet.stream is self._programme.sound:
                block = self._decoded(packet)
                if stage is None and len(block):
                    start_s = self._decoder.start_s or 0.0
                    stage = make_stage(self._decoder.format, start_s, self._target)
                if stage is not None and len(block):
                    self._write_sound(stage.process(block))
                    progress(len(block) / self._decoder.format.fs)
            else:
                self._copies.write(packet)
        if stage is None:
            raise CueError(f"{self._programme.name}: its sound is empty")
        self._write_sound(stage.flush())
        for packet in self._encoder.flush():
            self._container.mux(packet)
        if self._programme.fault:
            raise CueError(self._programme.fault)
        decoder = self._decoder
        return Rewritten(
            decoder.format,
            decoder.samples / decoder.format.fs,
            decoder.start_s or 0.0,
            self._encoder.clipped,
            tuple(self._copies.left_out + damaged_frames("sound", decoder.damaged)),
            self._changed,
        )

    def _decoded(self, packet: Any) -> NDArray[np.float32]:
        """Return the samples of a packet of the sound, or of the end."""
        try:
            return self._decoder.process(packet)
        except CueError as error:
            if not self._decoder.samples:
                raise
            raise CueError(f"{error}: silence in its place with --mend") from error

    def _packets(self) -> Iterator[Any]:
        """Yield the programme's packets, then None for the end of the sound."""
        yield from self._programme.packets()
        yield None

    def _write_sound(self, block: NDArray[np.float32]) -> None:
        start_s = self._decoder.container_start_s - float(self._copies.shift_s)
        for packet in self._encoder.process(block, start_s):
            self._container.mux(packet)


def _is_guessed(programme: Programme) -> bool:
    """Whether a stated bit rate is that of the first frame, which is often silence."""
    framed = programme.container.format.name in ("mpegts", "mpeg", "aac")
    return framed and programme.format.codec.startswith(("aac", "mp3"))


def _same_file(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> bool:
    try:
        return Path(source).samefile(target)
    except OSError:
        return False
