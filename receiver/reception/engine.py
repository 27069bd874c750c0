"""The receiver: sound in blocks of any size and pictures in, the cuer's motion and keys out.

`Receiver` joins the audio carrier (`watermark.audio.receiver.AudioReceiver`), those of the picture
(`receiver.reception.picture_search`) and the timeline
(`receiver.reception.tracking.TimelineTracker`). What arrived in several carriers is joined by
`watermark.link.combine.Combiner`; any of them may begin or end at any time. The events do not
depend on how the samples are cut into blocks; memory does not grow, apart from the list of keys
when asked for.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Key
from codec.superframe.payload import unnest
from receiver.reception.authenticity import Gate, Passed, Trust
from receiver.reception.events import SUPERFRAME_S, Event, KeysFound, State
from receiver.reception.picture_search import AGAIN_S, TRIAL_S, Found, PictureCarriers
from receiver.reception.tracking import TimelineTracker
from watermark.audio.follow.stretched_place import MAX_MISSES
from watermark.audio.receiver import AudioReceiver
from watermark.link.combine import Combiner

_COMPANY_S = 5.0
"""So long after its last superframe a carrier still counts as company for the other."""

_PATIENCE = 40
"""Superframes in a row that may fail in a carrier that has company."""


class Receiver:
    """Everything that a set-top box finds in a programme.

    Parameters
    ----------
    fs : int
        Sampling rate of the sound in Hz: 32000, 44100 or 48000; 0 if there is none yet.
    channels : int
        1, 2 or 6; 0 if there is no sound yet.
    voice : Voice, optional
        The built-in one if left out.
    key : int
        Key of the watermark.
    start_s : float
        Time on the programme's clock at which the receiver was switched on.
    keep_keys : bool
        Keep the keys for `summary`: some kilobytes a minute.
    trust : Trust, optional
        Whose cues these should be.
    guess : bool
        Whether injuries of a sound without a mark, and crops of a picture, are searched for.
    calm : bool
        Whether the hand is held up where it is too fast to be read: for display.
    draw : bool
        Whether to give the motion, and not keys and states alone.

    Attributes
    ----------
    witness : callable or None
        Shown every superframe of every carrier as it was found, for measurements.

    Raises
    ------
    CueError
        If the carrier does not exist at this rate or number of channels.

    Examples
    --------
    >>> import numpy as np
    >>> from codec import load_voice
    >>> receiver = Receiver(48_000, 2, voice=load_voice("claire"))
    >>> receiver.process(np.zeros((48_000, 2), dtype=np.float32))
    []
    >>> receiver.flush()
    []
    """

    def __init__(
        self, fs: int = 0, channels: int = 0, *, voice: Voice | None = None, key: int = 0,
        start_s: float = 0.0, keep_keys: bool = True, trust: Trust | None = None,
        guess: bool = True, calm: bool = False, draw: bool = True,
    ) -> None:  # fmt: skip
        self._guess = guess
        self.voice = load_voice() if voice is None else voice
        self._carrier: AudioReceiver | None = None
        self._pictures: PictureCarriers | None = None
        self._combiner = Combiner()
        self.witness: Callable[[Found], None] | None = None
        self._tracker = TimelineTracker(self.voice, calm=calm, draw=draw)
        self._gate = None if trust is None else Gate(trust)
        self.fs, self.channels = fs, channels
        self._key, self._start_s = key, start_s
        self._sound_s, self._samples = start_s, 0
        self._tuned_in_s: float | None = None
        self._seen: dict[str, float | None] = {}
        self._brought: dict[str, float] = {}
        self._keys: list[Key] | None = [] if keep_keys else None
        if fs:
            self.open_sound(fs, channels, start_s=start_s)

    @property
    def state(self) -> State:
        """The state of reception."""
        return self._tracker.state

    @property
    def now_s(self) -> float:
        """Time on the programme's clock up to which sound came in; without sound, pictures."""
        if self._carrier is None and self._pictures is not None:
            return self._pictures.now_s
        return self._sound_s + self._samples / (self.fs or 1)

    @property
    def ber_estimate(self) -> float | None:
        """Share of wrong bits in the sound before error correction; None before the first."""
        return None if self._carrier is None else self._carrier.ber_estimate

    @property
    def looking(self) -> bool:
        """Whether pictures are worth decoding: a carrier was found in them, or may yet be."""
        return self._pictures is not None and not self._pictures.hopeless

    @property
    def recovered(self) -> int:
        """Superframes that neither sound nor picture had alone."""
        return self._combiner.recovered

    def open_sound(self, fs: int, channels: int, *, start_s: float) -> None:
        """Listen to a sound of this format.

        Parameters
        ----------
        fs : int
            Samples per second.
        channels : int
        start_s : float
            When its first sample is due on the programme's clock, seconds.

        Raises
        ------
        CueError
            If the carrier does not exist at this rate or number of channels.
        """
        self._carrier = AudioReceiver(fs, channels, key=self._key, guess=self._guess)
        self.fs, self.channels = fs, channels
        self._sound_s, self._samples = start_s, 0

    def process(self, block: NDArray[np.float32]) -> list[Event]:
        """Take samples.

        Parameters
        ----------
        block : ndarray of float32, shape (n, channels)
            Of full scale 1; any n.

        Returns
        -------
        list of Event
            Events that the samples completed, in order of reception.
        """
        assert self._carrier is not None, "a receiver without sound"
        self._samples += len(block)
        return self._take(self._heard(self._carrier.process(block)))

    def open_picture(
        self,
        width: int,
        height: int,
        fps: Fraction | float,
        *,
        depth: int = 8,
        start_s: float = 0.0,
    ) -> None:
        """Look at pictures of this format; what went before has ended.

        Parameters
        ----------
        width, height : int
            Pixels.
        fps : Fraction or float
            Pictures per second.
        depth : int
            Bits of a sample.
        start_s : float
            When the first one is due on the programme's clock, seconds.
        """
        self._remember()
        in_vain = self._pictures is not None and self._pictures.first_lock_s is None
        self._pictures = PictureCarriers(
            width,
            height,
            fps,
            depth=depth,
            key=self._key,
            start_s=start_s,
            trial_s=AGAIN_S if in_vain else TRIAL_S,
            guess=self._guess,
        )

    def see(self, luma: NDArray[Any]) -> list[Event]:
        """Take the next picture.

        Parameters
        ----------
        luma : ndarray of uint8 or uint16, shape (height, width)

        Returns
        -------
        list of Event
            As of `process`.
        """
        assert self._pictures is not None, "no picture was opened"
        return self._take(self._pictures.process(luma))

    def flush(self) -> list[Event]:
        """Return the events of the last samples; the programme has ended.

        Returns
        -------
        list of Event
        """
        events: list[Event] = []
        if self._carrier is not None:
            events += self._take(self._heard(self._carrier.flush()))
        if self._pictures is not None:
            events += self._take(self._pictures.flush())
        if self._gate is not None:
            events += self._draw(self._gate.finish())
        return events + self._kept(self._tracker.finish())

    def _heard(self, superframes: Iterable[Any]) -> list[Found]:
        assert self._carrier is not None
        profile = self._carrier.profile
        return [
            Found("audio", replace(s, position_s=self._sound_s + s.position_s), profile)
            for s in superframes
        ]

    def _take(self, found: Iterable[Found]) -> list[Event]:
        events: list[Event] = []
        for item in found:
            if self.witness is not None:
                self.witness(item)
            if item.superframe.l0 is not None:
                self._encourage(item)
            for joined in self._combiner.add(item.carrier, item.superframe, item.profile):
                events += self._admit(joined.l0, joined.l1, joined.position_s)
                if self._tuned_in_s is None and self._tracker.received:
                    self._tuned_in_s = max(joined.position_s + SUPERFRAME_S, self._locked_s())
        now_s = self.now_s if self._gate is None else self._gate.settled_s(self.now_s)
        return self._kept([*events, *self._tracker.advance(now_s)])

    def _admit(self, l0: bytes | None, l1: bytes | None, on_air_s: float) -> list[Event]:
        """Give a superframe to the timeline, by the gate if there is one."""
        if self._gate is None:
            return self._draw([Passed(l0, l1, on_air_s)])
        passed, events = self._gate.take(l0, l1, on_air_s)
        return [*events, *self._draw(passed)]

    def _draw(self, passed: Iterable[Passed]) -> list[Event]:
        events: list[Event] = []
        for superframe in passed:
            l0, l1 = unnest(superframe.l0, superframe.l1)
            events += self._tracker.take(l0, l1, superframe.on_air_s)
        return events

    def _encourage(self, found: Found) -> None:
        """Let a carrier that fails stay locked while another one brings superframes.

        Both are on the same grid, and what fails in one may help the other.
        """
        self._brought[found.carrier] = found.superframe.position_s
        for name in ("audio", "video"):
            others = (at_s for carrier, at_s in self._brought.items() if carrier != name)
            alone = max(others, default=-math.inf) < found.superframe.position_s - _COMPANY_S
            patience = MAX_MISSES if alone else _PATIENCE
            if name == "video" and self._pictures is not None:
                self._pictures.wait(patience)
            elif name == "audio" and self._carrier is not None:
                self._carrier.patience = patience

    def _locked_s(self) -> float:
        """Time at which the first carrier was found."""
        times = [] if self._pictures is None else [self._pictures.first_lock_s]
        if self._carrier is not None and self._carrier.first_lock_s is not None:
            times.append(self._sound_s + self._carrier.first_lock_s)
        return min((time for time in times if time is not None), default=0.0)

    def _remember(self) -> None:
        if self._pictures is not None:
            self._seen |= self._pictures.ber_estimates

    def _kept(self, events: Iterable[Event]) -> list[Event]:
        told = list(events)
        if self._keys is not None:
            for event in told:
                if isinstance(event, KeysFound) and event.final:
                    self._keys += event.keys
        return told

    def summary(self) -> dict[str, Any]:
        """Return the fields of ``cuecast receive --json`` (``realtime_factor`` is the caller's).

        ``tune_in_s`` counts from the start to the end of the first superframe that arrived, or to
        the moment at which its carrier was found, whichever is later.

        Returns
        -------
        dict
        """
        tracker = self._tracker
        self._remember()
        tuned_in_s = self._tuned_in_s
        if tuned_in_s is not None:
            tuned_in_s = round(tuned_in_s - self._start_s, 6)
        carriers: dict[str, dict[str, Any]] = {
            name: {"locked": True, "ber_estimate": ber} for name, ber in self._seen.items()
        }
        if self._carrier is not None:
            carriers["audio"] = {
                "locked": self._carrier.first_lock_s is not None,
                "ber_estimate": self._carrier.ber_estimate,
            }
        return {
            "duration_s": round(self.now_s - self._start_s, 6),
            "tune_in_s": tuned_in_s,
            "superframes": {"received": tracker.received, "lost": tracker.lost},
            "layers": {
                "L0": {"received": tracker.received},
                "L1": {"received": tracker.received_l1},
            },
            "recovered_together": self._combiner.recovered,
            "keys": [key.as_dict() for key in self._keys or []],
            "carriers": carriers,
            "voice": self.voice.identity if tracker.received else None,
            "authenticity": None if self._gate is None else self._gate.summary(),
        }
