"""Reception of a programme in a file or a pipe: what a set-top box finds in it."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from codec.motion import Motion
from codec.voice import Voice
from cuecast.media.programme import Programme, open_programme
from cuecast.media.sound import SoundDecoder, sound_blocks
from receiver.assemble import Assembler
from receiver.engine import Receiver
from receiver.events import Event
from watermark.mix import RATES
from watermark.quality.resample import Resampler

_CONVERTED_RATE = 48_000

Samples = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Reception:
    """What `receive` found.

    Attributes
    ----------
    summary : dict
        Under the names of the command line's JSON.
    motion : Motion or None
        None if nothing was found, or not wanted.
    damaged : int
        Packets of sound that could not be decoded.
    fault : str
        What is wrong with the file as a whole, or nothing.
    """

    summary: dict[str, Any]
    motion: Motion | None
    damaged: int
    fault: str


def receive(
    source: str | os.PathLike[str] | BinaryIO,
    voice: Voice,
    *,
    start_s: float = 0.0,
    key: int = 0,
    track: int = 0,
    keep_motion: bool = True,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Reception:
    """Receive a programme to its end.

    Parameters
    ----------
    source : path or binary file
        The programme.
    voice : Voice
        That of the receiver.
    start_s : float
        Second of the programme at which the receiver is switched on.
    key : int
        Key of the watermark.
    track : int
        Which of the programme's sounds, from 0.
    keep_motion : bool
        Whether to assemble the motion; memory grows with it.
    progress : callable
        Told how many seconds of sound each block brought.

    Raises
    ------
    CueError
        If the programme is malformed, or its sound of a kind that cannot carry a cuer.
    """
    began = time.perf_counter()
    assembler = Assembler(voice) if keep_motion else None
    with open_programme(source, track=track) as programme:
        decoder = SoundDecoder(programme, strict=False)
        tuner = _Tuner(programme, voice, key)
        for position_s, block in _from(sound_blocks(decoder, programme), decoder, start_s):
            for event in tuner.process(position_s, block):
                if assembler is not None:
                    assembler.add(event)
            progress(len(block) / decoder.format.fs)
        for event in tuner.flush():
            if assembler is not None:
                assembler.add(event)
        fault = programme.fault
    summary = tuner.summary()
    elapsed_s = time.perf_counter() - began
    summary["realtime_factor"] = round(summary["duration_s"] / elapsed_s, 2)
    found = summary["superframes"]["received"] > 0
    motion = assembler.motion() if assembler is not None and found else None
    return Reception(summary, motion, decoder.damaged, fault)


class _Tuner:
    """A receiver that starts with the first block, at a rate that the carrier is defined for."""

    def __init__(self, programme: Programme, voice: Voice, key: int) -> None:
        sound = programme.format
        self._name = programme.name
        self._rate = sound.fs if sound.fs in RATES else _CONVERTED_RATE
        if sound.fs < min(RATES):
            raise CueError(
                f"{self._name}: sound of {sound.fs} Hz cannot carry a cuer, at least "
                f"{min(RATES)} Hz can"
            )
        self._channels, self._voice, self._key = sound.channels, voice, key
        self._converter = Resampler(sound.fs, self._rate, sound.channels)
        self._receiver: Receiver | None = None

    def process(self, position_s: float, block: Samples) -> list[Event]:
        if self._receiver is None:
            try:
                self._receiver = Receiver(
                    self._rate, self._channels, voice=self._voice, key=self._key,
                    start_s=position_s,
                )  # fmt: skip
            except CueError as error:
                raise CueError(f"{self._name}: {error}") from error
        return self._receiver.process(
            self._converter.process(block.astype(np.float64)).astype(np.float32)
        )

    def flush(self) -> list[Event]:
        if self._receiver is None:
            raise CueError(f"{self._name}: no sound to receive")
        rest = self._receiver.process(self._converter.flush().astype(np.float32))
        return rest + self._receiver.flush()

    def summary(self) -> dict[str, Any]:
        assert self._receiver is not None
        return self._receiver.summary()


def _from(
    blocks: Iterator[Samples], decoder: SoundDecoder, start_s: float
) -> Iterator[tuple[float, Samples]]:
    """Yield blocks with the time of their first sample, what comes before `start_s` cut off."""
    fs = decoder.format.fs
    for block in blocks:
        end_s = (decoder.start_s or 0.0) + decoder.samples / fs
        early = max(0, round((start_s - end_s) * fs) + len(block))
        if early < len(block):
            yield end_s - (len(block) - early) / fs, block[early:]
