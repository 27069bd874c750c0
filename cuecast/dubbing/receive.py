"""Reception of a programme in a file or a pipe, as by a set-top box."""

import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, BinaryIO

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from receiver.media.programme import open_programme
from receiver.reception.assemble import Assembler
from receiver.reception.authenticity import Trust
from receiver.reception.events import Event, Unreadable
from receiver.reception.reception import ProgrammeReceiver


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
        Packets that could not be decoded.
    fault : str
        Damage of the file as a whole, or nothing.
    foreign : str
        Parts of another voice or version among those received, or nothing.
    other_sounds : int
        Sounds of the programme that were not listened to.

    Examples
    --------
    >>> reception = Reception({"tune_in_s": None, "keys": []}, None, damaged=0, fault="")
    >>> len(reception.summary["keys"]), reception.motion is None
    (0, True)
    """

    summary: dict[str, Any]
    motion: Motion | None
    damaged: int
    fault: str
    foreign: str = ""
    other_sounds: int = 0


def receive(
    source: str | os.PathLike[str] | BinaryIO,
    voice: Voice,
    *,
    start_s: float = 0.0,
    key: int = 0,
    track: int = 0,
    keep_motion: bool = True,
    listen: bool = True,
    look: bool = True,
    trust: Trust | None = None,
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
    listen, look : bool
        Whether to use the sound, and the picture.
    trust : Trust, optional
        Whose cues these should be.
    progress : callable
        Called with the seconds that each piece of the programme brought.

    Returns
    -------
    Reception

    Raises
    ------
    CueError
        If the programme is malformed, or its sound of a kind that cannot carry a cuer.

    Examples
    --------
    >>> from codec import load_voice
    >>> receive("missing.ts", load_voice("claire"))
    Traceback (most recent call last):
    codec.errors.CueError: missing.ts: No such file or directory
    """
    began = time.perf_counter()
    gathered = _Gathered(voice, keep_motion)
    with open_programme(source, track=track) as programme:
        reception = ProgrammeReceiver(
            programme,
            voice,
            key=key,
            start_s=start_s,
            listen=listen,
            look=look,
            trust=trust,
            draw=keep_motion,
        )
        until_s = start_s
        for reached in reception.progress():
            gathered.take(reached.events)
            progress(max(0.0, reached.until_s - until_s))
            until_s = max(until_s, reached.until_s)
        fault = programme.fault
        others = max(0, programme.sounds - 1) if listen else 0
    summary = reception.receiver.summary()
    elapsed_s = time.perf_counter() - began
    summary["realtime_factor"] = round(summary["duration_s"] / elapsed_s, 2)
    motion = gathered.motion() if summary["superframes"]["received"] else None
    if not summary["superframes"]["received"]:
        fault = fault or gathered.unreadable
        return Reception(summary, motion, reception.damaged, fault, other_sounds=others)
    return Reception(summary, motion, reception.damaged, fault, gathered.unreadable, others)


class _Gathered:
    """Collects what of the events outlasts them."""

    def __init__(self, voice: Voice, keep_motion: bool) -> None:
        self._assembler = Assembler(voice) if keep_motion else None
        self.unreadable = ""

    def take(self, events: Iterable[Event]) -> None:
        for event in events:
            if isinstance(event, Unreadable):
                self.unreadable = self.unreadable or event.message
            if self._assembler is not None:
                self._assembler.add(event)

    def motion(self) -> Motion | None:
        return None if self._assembler is None else self._assembler.motion()
