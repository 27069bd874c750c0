"""The receiver: sound in blocks of any size goes in, the cuer's motion and keys come out.

`Receiver` joins the audio carrier (`watermark.receive.AudioReceiver`) and the timeline
(`receiver.tracking.Tracker`). The events do not depend on how the samples are cut into blocks;
memory does not grow, apart from the list of keys when asked for.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.score import Key
from codec.voice import Voice, load_voice
from receiver.events import SUPERFRAME_S, Event, KeysFound, State
from receiver.tracking import Tracker
from watermark.receive import AudioReceiver
from watermark.received import ReceivedSuperframe


class Receiver:
    """Everything that a set-top box finds in a sound.

    Parameters
    ----------
    fs : int
        Sampling rate in Hz: 32000, 44100 or 48000.
    channels : int
        1, 2 or 6.
    voice : Voice, optional
        The built-in one if left out.
    key : int
        Key of the watermark.
    start_s : float
        Time of the first sample on the programme's clock.
    keep_keys : bool
        Keep the keys for `summary`: some kilobytes a minute.

    Raises
    ------
    CueError
        If the carrier does not exist at this rate or number of channels.
    """

    def __init__(
        self, fs: int, channels: int, *, voice: Voice | None = None, key: int = 0,
        start_s: float = 0.0, keep_keys: bool = True,
    ) -> None:  # fmt: skip
        self.voice = load_voice() if voice is None else voice
        self._carrier = AudioReceiver(fs, channels, key=key)
        self._tracker = Tracker(self.voice)
        self.fs, self.channels = fs, channels
        self._start_s = start_s
        self._samples = 0
        self._first_s: float | None = None
        self._keys: list[Key] | None = [] if keep_keys else None

    @property
    def state(self) -> State:
        """The state of reception."""
        return self._tracker.state

    @property
    def now_s(self) -> float:
        """Time on the programme's clock up to which sound came in."""
        return self._start_s + self._samples / self.fs

    @property
    def ber_estimate(self) -> float | None:
        """Share of wrong bits on the carrier before error correction; None before the first."""
        return self._carrier.ber_estimate

    def process(self, block: NDArray[np.float32]) -> list[Event]:
        """Take samples, shape (n, channels).

        Returns
        -------
        list of Event
            What the samples completed, in order of reception.
        """
        self._samples += len(block)
        events = self._take(self._carrier.process(block))
        return events + self._kept(list(self._tracker.advance(self.now_s)))

    def flush(self) -> list[Event]:
        """Return what the last samples still complete; the sound has ended."""
        events = self._take(self._carrier.flush())
        return events + self._kept(list(self._tracker.finish()))

    def _take(self, superframes: list[ReceivedSuperframe]) -> list[Event]:
        events: list[Event] = []
        for received in superframes:
            on_air_s = self._start_s + received.position_s
            events += self._tracker.take(received.l0, received.l1, on_air_s)
            if self._first_s is None and self._tracker.received:
                self._first_s = on_air_s + SUPERFRAME_S
        return self._kept(events)

    def _kept(self, events: list[Event]) -> list[Event]:
        if self._keys is not None:
            for event in events:
                if isinstance(event, KeysFound) and event.final:
                    self._keys += event.keys
        return events

    def summary(self) -> dict[str, Any]:
        """Return the fields of ``cuecast receive --json`` (``realtime_factor`` is the caller's).

        ``tune_in_s`` counts from the first sample to the end of the first superframe that
        arrived, or to the moment at which the carrier was found, whichever is later.
        """
        tracker, first_s = self._tracker, self._first_s
        tune_in_s = None
        if first_s is not None:
            tune_in_s = max(first_s - self._start_s, self._carrier.first_lock_s or 0.0)
        return {
            "duration_s": self._samples / self.fs,
            "tune_in_s": tune_in_s,
            "superframes": {"received": tracker.received, "lost": tracker.lost},
            "layers": {
                "L0": {"received": tracker.received},
                "L1": {"received": tracker.received_l1},
            },
            "keys": [key.as_dict() for key in self._keys or []],
            "carriers": {
                "audio": {
                    "locked": self._carrier.first_lock_s is not None,
                    "ber_estimate": self._carrier.ber_estimate,
                }
            },
            "voice": self.voice.identity if tracker.received else None,
        }
