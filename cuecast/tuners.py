"""Tuners: the carriers of a programme in, the receiver's events out.

`SoundTuner` hears only; `JointTuner` joins what was seen in the picture with what is heard: for
each superframe the carrier counts that brought more of it.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from codec.score import Key
from codec.voice import Voice
from cuecast.media.programme import Programme
from cuecast.pictures import FoundInPicture, moved, richest
from receiver.engine import Receiver
from receiver.events import SUPERFRAME_S, Event, KeysFound
from receiver.tracking import Tracker
from watermark.mix import RATES
from watermark.quality.resample import Resampler
from watermark.receive import AudioReceiver
from watermark.received import ReceivedSuperframe

_CONVERTED_RATE = 48_000

Samples = NDArray[np.float32]


class Hearing:
    """The sound of a programme at a rate for which the carrier is defined.

    Raises
    ------
    CueError
        If the sound is of a kind that cannot carry a cuer.
    """

    def __init__(self, programme: Programme) -> None:
        sound = programme.format
        if sound.fs < min(RATES):
            raise CueError(
                f"{programme.name}: sound of {sound.fs} Hz cannot carry a cuer, at least "
                f"{min(RATES)} Hz can"
            )
        self.name = programme.name
        self.rate = sound.fs if sound.fs in RATES else _CONVERTED_RATE
        self.channels = sound.channels
        self._resampler = Resampler(sound.fs, self.rate, sound.channels)

    def process(self, block: Samples) -> Samples:
        """Take samples at the programme's rate, (n, channels); give them at `rate`."""
        return self._resampler.process(block.astype(np.float64)).astype(np.float32)

    def flush(self) -> Samples:
        """Give the rest."""
        return self._resampler.flush().astype(np.float32)


class SoundTuner:
    """A receiver that starts with the first block."""

    def __init__(self, hearing: Hearing, voice: Voice, key: int) -> None:
        self._hearing, self._voice, self._key = hearing, voice, key
        self._receiver: Receiver | None = None

    def process(self, position_s: float, block: Samples) -> list[Event]:
        """Take samples of the programme from `position_s` on."""
        hearing = self._hearing
        if self._receiver is None:
            try:
                self._receiver = Receiver(
                    hearing.rate, hearing.channels, voice=self._voice, key=self._key,
                    start_s=position_s,
                )  # fmt: skip
            except CueError as error:
                raise CueError(f"{hearing.name}: {error}") from error
        return self._receiver.process(hearing.process(block))

    def flush(self) -> list[Event]:
        """Return what the last samples still complete."""
        if self._receiver is None:
            raise CueError(f"{self._hearing.name}: no sound to receive")
        return self._receiver.process(self._hearing.flush()) + self._receiver.flush()

    def summary(self) -> dict[str, Any]:
        """Return the fields of ``cuecast receive --json``."""
        assert self._receiver is not None
        return self._receiver.summary()


class JointTuner:
    """Joins superframes of the picture and of the sound.

    Parameters
    ----------
    pictures : dict of str to FoundInPicture
        By carrier; at least one.
    hearing : Hearing or None
        The sound, if there is one.
    voice : Voice
    key : int
        Key of the sound's mark.
    start_s : float
        Second at which the receiver is switched on.
    """

    def __init__(
        self, pictures: dict[str, FoundInPicture], hearing: Hearing | None, voice: Voice,
        key: int, start_s: float,
    ) -> None:  # fmt: skip
        self._pictures, self._hearing, self._voice = pictures, hearing, voice
        self._carrier = None
        if hearing is not None:
            self._carrier = AudioReceiver(hearing.rate, hearing.channels, key=key)
        self._start_s = start_s
        self._sound_start_s: float | None = None
        self._end_s = start_s
        self._heard: list[ReceivedSuperframe] = []
        self._tracker = Tracker(voice)
        self._keys: list[Key] = []
        self._first_s: float | None = None

    def process(self, position_s: float, block: Samples) -> list[Event]:
        """Take samples of the programme from `position_s` on; events come with `flush`."""
        assert self._hearing is not None
        if self._sound_start_s is None:
            self._sound_start_s = position_s
        self._end_s = position_s + len(block) / self._hearing.rate
        self._hear(self._hearing.process(block))
        return []

    def flush(self) -> list[Event]:
        """Return the events of the whole programme."""
        if self._hearing is not None and self._carrier is not None:
            self._hear(self._hearing.flush())
            self._take(self._carrier.flush())
        seen = [s for found in self._pictures.values() for s in found.superframes]
        events: list[Event] = []
        for superframe in richest([*seen, *self._heard]):
            if self._first_s is None:
                self._first_s = superframe.position_s
            self._end_s = max(self._end_s, superframe.position_s + SUPERFRAME_S)
            events += self._tracker.take(superframe.l0, superframe.l1, superframe.position_s)
        events += self._tracker.finish()
        for event in events:
            if isinstance(event, KeysFound) and event.final:
                self._keys += event.keys
        return events

    def _hear(self, block: Samples) -> None:
        assert self._carrier is not None
        self._take(self._carrier.process(block))

    def _take(self, superframes: Iterable[ReceivedSuperframe]) -> None:
        start_s = self._sound_start_s or 0.0
        self._heard += [moved(s, start_s) for s in superframes if s.l0]

    def summary(self) -> dict[str, Any]:
        """Return the fields of ``cuecast receive --json``."""
        tracker = self._tracker
        carriers: dict[str, dict[str, Any]] = {
            name: {"locked": True, "ber_estimate": found.ber_estimate}
            for name, found in self._pictures.items()
        }
        if self._carrier is not None:
            carriers["audio"] = {
                "locked": self._carrier.first_lock_s is not None,
                "ber_estimate": self._carrier.ber_estimate,
            }
        tune_in_s = None
        if self._first_s is not None:
            tune_in_s = round(self._first_s + SUPERFRAME_S - self._start_s, 3)
        return {
            "duration_s": round(self._end_s - self._start_s, 3),
            "tune_in_s": tune_in_s,
            "superframes": {"received": tracker.received, "lost": tracker.lost},
            "layers": {
                "L0": {"received": tracker.received},
                "L1": {"received": tracker.received_l1},
            },
            "keys": [key.as_dict() for key in self._keys],
            "carriers": carriers,
            "voice": self._voice.identity if tracker.received else None,
        }
