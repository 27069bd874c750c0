"""The sound of a running programme on its way through the embedder.

PES packets in, PES packets of the same coding out, a few seconds later: decoded onto one line of
samples, marked, and coded again. Where the sound changes its form or its clock jumps, the sound
under way is finished and a new run begins; the superframes are numbered through.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from cuecast.dubbing.motions import MotionSource
from cuecast.live.frames import FrameCutter
from cuecast.live.options import LiveOptions, MarkedPes, RunClock
from cuecast.live.packets import TICKS_HZ, Pes, step
from cuecast.live.sound_run import CODERS, SoundForm, SoundRun
from cuecast.media.dolby import settings_of
from receiver.media.rates import RateMeter
from receiver.media.sound import as_float
from watermark.link.superframe import SUPERFRAME_S

_JITTER_S = 0.003
"""Time stamps that stray by less are rounding; the sound stays in step with the picture."""

_LONGEST_GAP_S = 5.0
"""A longer hole is not filled with silence: a new run begins after it."""

_FRAMING = {"aac": 7, "latm": 12}
"""Bytes of a frame that are not the encoder's."""

_UNREAD = 20
"""Packets without one frame of the sound that the tables promise, until that is told."""

Samples = NDArray[np.float32]


class SoundMarker:
    """Marks the sound of one programme, PES by PES.

    Parameters
    ----------
    motion : MotionSource
        Times count from the first sample.
    voice : Voice
    options : LiveOptions
    tell : callable
        Called with events, a line each.

    Attributes
    ----------
    heard_s : float
        Up to where on the motion's clock sound came in.
    superframes : int
        Superframes that were written.
    rehearsed : bool
        Whether marks are tried on a coder first, where the options ask for it.
    joint_s : float
        Sound that was coded again without a mark, up to a superframe's beginning.
    """

    def __init__(
        self,
        motion: MotionSource,
        voice: Voice,
        options: LiveOptions,
        tell: Callable[[str], None] = lambda line: None,
    ) -> None:
        self._motion, self._voice, self._options, self._tell = motion, voice, options, tell
        self._signing = options.signing()
        self._kind = ""
        self._cutter: FrameCutter | None = None
        self._decoder: Any = None
        self._run: SoundRun | None = None
        self._first = 0
        self._lost = False
        self._after: list[Samples] = []
        self._base_s = 0.0
        self._zero: int | None = None
        self._meter, self._unplaced = RateMeter(), 0
        self._frames = self._packets = 0
        self._settings: dict[str, str] = {}
        self._resumed: tuple[RunClock, int | None] | None = None
        self._passed_to: int | None = None
        self._written, self._joint = 0, 0.0
        self.rehearsed = True
        self.joint_s = 0.0
        self.damaged = 0

    @property
    def heard_s(self) -> float:
        """Up to where on the motion's clock sound came in."""
        return self._base_s if self._run is None else self._run.end_s

    @property
    def superframes(self) -> int:
        """Superframes of the run, and of those before."""
        return self._written + (0 if self._run is None else self._run.superframes)

    @property
    def clock(self) -> RunClock | None:
        """Clock of the sound under way, None before there is one."""
        return None if self._run is None else self._run.clock

    def resume(self, clock: RunClock, until: int | None) -> None:
        """Go on with sound that another process marked, up to a time stamp if that is known."""
        self._resumed, self._passed_to = (clock, until), None

    def time_s(self, pts: int) -> float | None:
        """Return the time of a time stamp on the motion's clock, None before there is a sound."""
        if self._zero is None or self._run is None:
            return None
        return self._run.start_s + step(pts, self._zero) / TICKS_HZ

    def process(self, kind: str, pes: Pes) -> Iterator[MarkedPes]:
        """Take a PES packet of sound of a kind; yield those that are finished.

        Raises
        ------
        CueError
            If sound of this form cannot be marked.
        """
        if kind != self._kind:
            yield from self.flush()
            self._kind = kind
            self._decoder, self._cutter = _decoder(kind), FrameCutter(kind)
        assert self._cutter is not None
        pts = pes.pts
        self._packets += 1
        if self._packets == _UNREAD and not self._frames:
            self._tell(f"sound: no frames of {kind}; it passes as it is")
        for number, part in enumerate(pes.parts):
            if number:
                self._cutter.restart()
                self._lost = True
            for frame, begins in self._cutter.process(part):
                due = None
                if begins and pts is not None:
                    due, pts = pts, None
                self._unplaced += 8 * (len(frame.data) - _FRAMING.get(kind, 0))
                self._frames += 1
                self._settings = settings_of(frame.data)
                for sound in self._decoded(frame.data):
                    yield from self._place(sound, due)
                    due = None

    def mark(self, samples: NDArray[np.float64]) -> Iterator[MarkedPes]:
        """Mark plain sound of 48 kHz and two channels as if it had come in as MPEG audio."""
        form = SoundForm(48_000, "stereo", 2)
        run = SoundRun(
            "mp2", form, 0, 0.0, 0, self._motion, self._voice, self._options, None, lambda: 1, {},
            lambda: 192_000,
        )  # fmt: skip
        yield from run.process(samples.astype(np.float32))
        yield from run.flush()

    def flush(self) -> Iterator[MarkedPes]:
        """Yield the pending sound; then a new run begins."""
        if self._run is not None:
            yield from self._run.flush()
        self.abandon()

    def abandon(self) -> None:
        """Give up the pending sound; then a new run begins."""
        run, self._run = self._run, None
        if run is not None:
            self._first = run.next_number
            self._written += run.superframes
            self._base_s = run.end_s
        self._zero, self._lost, self._after = None, False, []

    def _decoded(self, data: bytes) -> list[Any]:
        try:
            return list(self._decoder.decode(av.Packet(data)))
        except (av.FFmpegError, ValueError):
            self.damaged += 1
            self._lost = True
            return []

    def _place(self, sound: Any, due: int | None) -> Iterator[MarkedPes]:
        """Put decoded sound on the line; begin a new run where it changes or jumps.

        Sound after a loss waits for the next time stamp, whose place is behind it.
        """
        samples, fs, run = as_float(sound), sound.sample_rate, self._run
        self._meter.add(self._unplaced, len(samples) / fs)
        self._unplaced = 0
        if self._resumed is not None:
            samples, due = self._wait_for_resumption(samples, fs, due)
            if due is None:
                return
        if run is not None and run.rehearsed != self.rehearsed:
            self.joint_s += run.begin_again(self.rehearsed)
            yield from run.drain()
        changed = run is not None and (fs, sound.layout.name) != (run.fs, run.layout)
        if self._lost and due is None and not changed:
            self._after.append(samples)
            return
        if run is not None and (changed or (due is not None and self._jumps(run, due))):
            self._tell(
                f"sound: {fs} Hz, {sound.layout.name}: " + ("new form" if changed else "jump")
            )
            yield from self.flush()
            run = None
        if run is None:
            if due is not None:
                run = self._run = self._new_run(sound, due)
                self._zero, self._lost, self._after = due, False, []
                yield from run.process(samples)
            return
        if due is not None:
            yield from run.process(self._between(run, due))
            cut = -run.late(due)
            samples = samples[cut:] if cut > _JITTER_S * fs else samples
        yield from run.process(samples)

    def _wait_for_resumption(
        self, samples: Samples, fs: int, due: int | None
    ) -> tuple[Samples, int | None]:
        """Pass over sound that another process marked; return the rest and its time stamp."""
        assert self._resumed is not None
        clock, until = self._resumed
        here = self._passed_to if due is None else due
        if here is None:
            return samples, None
        self._passed_to = here + len(samples) * TICKS_HZ // fs
        late = 0 if until is None else step(until, here) * fs // TICKS_HZ
        if len(samples) <= late < _LONGEST_GAP_S * fs:
            return samples, None
        cut = late if 0 < late < len(samples) else 0
        here += cut * TICKS_HZ // fs
        time_s = clock.at(here)
        self._resumed = None
        self._base_s = time_s if time_s > 0 else clock.time_s
        number = math.ceil((self._base_s - clock.grid_s) / SUPERFRAME_S - 1e-4)
        self._first, self._joint = number, clock.grid_s + number * SUPERFRAME_S - self._base_s
        self.joint_s += max(0.0, self._joint)
        return samples[cut:], here

    def _jumps(self, run: "SoundRun", due: int) -> bool:
        return bool(abs(run.late(due)) > _LONGEST_GAP_S * run.fs)

    def _between(self, run: "SoundRun", due: int) -> Samples:
        """Return what lies between the line's end and a time stamp: silence, then what waited."""
        waited = np.concatenate([np.zeros((0, run.channels), np.float32), *self._after])
        self._lost, self._after = False, []
        late = run.late(due)
        if abs(late) <= _JITTER_S * run.fs:
            return waited[:0]
        silence = np.zeros((max(0, late - len(waited)), run.channels), np.float32)
        return np.concatenate([silence, waited])[: max(0, late)]

    def _new_run(self, sound: Any, stamp: int) -> Any:
        form = SoundForm(sound.sample_rate, sound.layout.name, sound.layout.nb_channels)
        joint, self._joint = round(max(0.0, self._joint) * form.fs), 0.0
        return SoundRun(
            self._kind, form, stamp, self._base_s, self._first, self._motion, self._voice,
            self._options, self._signing, lambda: self._frames / self._packets, self._settings,
            lambda: self._meter.rate(form.channels),
            joint=joint, rehearsed=self.rehearsed,
        )  # fmt: skip


def _decoder(kind: str) -> Any:
    return av.CodecContext.create(CODERS[kind][0], "r")
