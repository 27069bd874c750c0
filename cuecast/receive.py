"""Reception of a programme in a file or a pipe: what a set-top box finds in it."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from codec.motion import Motion
from codec.voice import Voice
from cuecast.media.programme import has_stream, open_programme
from cuecast.media.sound import SoundDecoder, sound_blocks
from cuecast.pictures import search_picture
from cuecast.tuners import Hearing, JointTuner, SoundTuner
from receiver.assemble import Assembler
from receiver.events import Event, Unreadable

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
    look: bool = True,
    progress: Callable[[float], None] = lambda seconds: None,
) -> Reception:
    """Receive a programme to its end.

    Parameters
    ----------
    source : path or binary file
        The programme. In a pipe only the sound is received.
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
    look : bool
        Whether to search the picture too.
    progress : callable
        Told how many seconds of sound each block brought.

    Raises
    ------
    CueError
        If the programme is malformed, or its sound of a kind that cannot carry a cuer.
    """
    began = time.perf_counter()
    pictures = {}
    if look and isinstance(source, (str, os.PathLike)) and has_stream(source, "video"):
        pictures = search_picture(source, key=key, start_s=start_s)
    gathered = _Gathered(voice, keep_motion)
    damaged, fault = 0, ""
    tuner: SoundTuner | JointTuner
    if pictures and not has_stream(str(source), "audio"):
        tuner = JointTuner(pictures, None, voice, key, start_s)
    else:
        with open_programme(source, track=track) as programme:
            decoder = SoundDecoder(programme, strict=False)
            hearing = Hearing(programme)
            tuner = SoundTuner(hearing, voice, key)
            if pictures:
                tuner = JointTuner(pictures, hearing, voice, key, start_s)
            for position_s, block in _from(sound_blocks(decoder, programme), decoder, start_s):
                gathered.take(tuner.process(position_s, block))
                progress(len(block) / decoder.format.fs)
            damaged, fault = decoder.damaged, programme.fault
    gathered.take(tuner.flush())
    summary = tuner.summary()
    elapsed_s = time.perf_counter() - began
    summary["realtime_factor"] = round(summary["duration_s"] / elapsed_s, 2)
    motion = gathered.motion() if summary["superframes"]["received"] else None
    return Reception(summary, motion, damaged, fault or gathered.unreadable)


class _Gathered:
    """Collects what of the events outlasts them."""

    def __init__(self, voice: Voice, keep_motion: bool) -> None:
        self._assembler = Assembler(voice) if keep_motion else None
        self.unreadable = ""

    def take(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, Unreadable):
                self.unreadable = self.unreadable or event.message
            if self._assembler is not None:
                self._assembler.add(event)

    def motion(self) -> Motion | None:
        return None if self._assembler is None else self._assembler.motion()


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
