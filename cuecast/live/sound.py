"""The sound of a running programme on its way through the embedder.

PES packets in, PES packets of the same coding out, a few seconds later: decoded onto one line of
samples, marked, and coded again. Where the sound changes its form or its clock jumps, what is
under way is finished and a new run begins; the superframes are numbered through.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.dubbing.dub import LEAD, superframe_source
from cuecast.dubbing.motions import MotionSource
from cuecast.live.frames import FrameCutter, framed
from cuecast.live.packets import TICKS_HZ, Pes, step, write_pes
from cuecast.live.signing import LiveSigning
from cuecast.media.dolby import settings_of
from receiver.media.sound import as_float
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.signal.profile import find_profile
from watermark.link.superframe import SUPERFRAME_S

STRETCH, LOW_STRETCH = 4, 2
"""Superframes graded together, as a rule and for a low delay; half where the mark is rehearsed."""

_JITTER_S = 0.003
"""Time stamps that stray by less are rounding; the sound stays in step with the picture."""

_LONGEST_GAP_S = 5.0
"""A longer hole is not filled with silence: a new run begins after it."""

_CODERS = {"mp2": ("mp2", "mp2"), "aac": ("aac", "aac"), "latm": ("aac_latm", "aac"),
           "ac3": ("ac3", "ac3"), "eac3": ("eac3", "eac3")}  # fmt: skip
"""Decoder and encoder of each kind of sound."""

_FRAMING = {"aac": 7, "latm": 12}
"""Bytes of a frame that are not the encoder's."""

_USUAL_BITS = 64_000
"""Bit/s for one channel where the stream told none yet."""

Samples = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a running programme is marked.

    Attributes
    ----------
    profile : str
        Of the audio carrier.
    key : int
    grade : float
    through : str, optional
        Coder on which the mark is rehearsed.
    low_delay : bool
    seen_s : float
        How much later than the playout a live interpreter sees the programme.
    sign : str
        File of the key that signs, if any.
    on_air_s : float, optional
        When the motion's clock is at zero, seconds since 1970 (UTC); None: as the clock has it.
    delay_s : float
        From in to out.
    """

    profile: str
    key: int
    grade: float
    through: str | None = None
    low_delay: bool = False
    seen_s: float = 0.0
    sign: str = ""
    on_air_s: float | None = None
    delay_s: float = 0.0

    @property
    def stretch(self) -> int:
        """Superframes that the embedder grades together."""
        stretch = LOW_STRETCH if self.low_delay else STRETCH
        return stretch // 2 if self.rehearsed else stretch

    @property
    def embedder_s(self) -> float:
        """Longest time from a sample to its marked one, without the time to compute."""
        return SUPERFRAME_S * self.stretch * (1 + self.rehearsed) + 0.1

    def signing(self) -> LiveSigning | None:
        """Return what signs runs of sound, if they are to be signed."""
        return LiveSigning(self.sign, self.on_air_s, self.delay_s) if self.sign else None

    @property
    def ahead_s(self) -> float:
        """How far ahead of the sound that came in the motion has to be known, at most.

        That of a superframe is coded with the keys of the next one.
        """
        return SUPERFRAME_S * max(0, LEAD + 1 - self.stretch * self.rehearsed)

    @property
    def rehearsed(self) -> bool:
        """Whether superframes are tried on a coder first."""
        return make_rehearsal(find_profile(self.profile), self.key, self.through) is not None


@dataclass(frozen=True, slots=True)
class MarkedPes:
    """A PES packet with marked sound: its time and that of its end in ticks, its bytes."""

    pts: int
    end: int
    data: bytes


@dataclass(frozen=True, slots=True)
class _Form:
    """Rate, arrangement and number of a sound's channels."""

    fs: int
    layout: str
    channels: int


class SoundMarker:
    """Marks the sound of one programme, PES by PES.

    Parameters
    ----------
    motion : MotionSource
        Times count from the first sample.
    voice : Voice
    options : LiveOptions
    tell : callable
        Told what happens, a line each.

    Attributes
    ----------
    heard_s : float
        Up to where on the motion's clock sound came in.
    superframes : int
        Superframes that were written.
    """

    def __init__(
        self, motion: MotionSource, voice: Voice, options: LiveOptions,
        tell: Callable[[str], None] = lambda line: None,
    ) -> None:  # fmt: skip
        self._motion, self._voice, self._options, self._tell = motion, voice, options, tell
        self._signing = options.signing()
        self._kind = ""
        self._cutter: FrameCutter | None = None
        self._decoder: Any = None
        self._run: _SoundRun | None = None
        self._first = 0
        self._lost = False
        self._after: list[Samples] = []
        self._base_s = 0.0
        self._zero: int | None = None
        self._bits, self._length_s, self._frames, self._packets = 0, 0.0, 0, 0
        self._settings: dict[str, str] = {}
        self.damaged = 0

    @property
    def heard_s(self) -> float:
        """Up to where on the motion's clock sound came in."""
        return self._base_s if self._run is None else self._run.end_s

    @property
    def superframes(self) -> int:
        """Superframes of the run, and of those before."""
        return self._first + (0 if self._run is None else self._run.superframes)

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
        for number, part in enumerate(pes.parts):
            if number:
                self._cutter.restart()
                self._lost = True
            for frame, begins in self._cutter.process(part):
                due = None
                if begins and pts is not None:
                    due, pts = pts, None
                self._bits += 8 * (len(frame.data) - _FRAMING.get(kind, 0))
                self._frames += 1
                self._settings = settings_of(frame.data)
                for sound in self._decoded(frame.data):
                    yield from self._place(sound, due)
                    due = None

    def mark(self, samples: NDArray[np.float64]) -> Iterator[MarkedPes]:
        """Mark plain sound of 48 kHz and two channels as if it had come in as MPEG audio."""
        form = _Form(48_000, "stereo", 2)
        run = _SoundRun(
            "mp2", form, 0, 0.0, 0, self._motion, self._voice, self._options, None, 1, {},
            lambda: 192_000,
        )  # fmt: skip
        yield from run.process(samples.astype(np.float32))
        yield from run.flush()

    def flush(self) -> Iterator[MarkedPes]:
        """Yield what is under way; what comes then is a new run."""
        if self._run is not None:
            yield from self._run.flush()
        self.abandon()

    def abandon(self) -> None:
        """Give up what is under way; what comes then is a new run."""
        run, self._run = self._run, None
        if run is not None:
            self._first += run.superframes
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

        What comes after a loss waits for the next time stamp, before which it lies.
        """
        samples, fs, run = as_float(sound), sound.sample_rate, self._run
        self._length_s += len(samples) / fs
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

    def _jumps(self, run: "_SoundRun", due: int) -> bool:
        return bool(abs(run.late(due)) > _LONGEST_GAP_S * run.fs)

    def _between(self, run: "_SoundRun", due: int) -> Samples:
        """Return what lies between the line's end and a time stamp: silence, then what waited."""
        waited = np.concatenate([np.zeros((0, run.channels), np.float32), *self._after])
        self._lost, self._after = False, []
        late = run.late(due)
        if abs(late) <= _JITTER_S * run.fs:
            return waited[:0]
        silence = np.zeros((max(0, late - len(waited)), run.channels), np.float32)
        return np.concatenate([silence, waited])[: max(0, late)]

    def _new_run(self, sound: Any, stamp: int) -> "_SoundRun":
        per_packet = max(1, round(self._frames / max(1, self._packets)))
        form = _Form(sound.sample_rate, sound.layout.name, sound.layout.nb_channels)
        return _SoundRun(
            self._kind, form, stamp, self._base_s, self._first, self._motion, self._voice,
            self._options, self._signing, per_packet, self._settings,
            lambda: round(self._bits / max(self._length_s, 1e-3)),
        )  # fmt: skip


class _SoundRun:
    """Sound of one form on an unbroken line: marked and coded again."""

    def __init__(
        self, kind: str, form: "_Form", stamp: int, start_s: float, first: int,
        motion: MotionSource, voice: Voice, options: LiveOptions, signing: LiveSigning | None,
        per_packet: int, settings: dict[str, str], bit_rate: Callable[[], int],
    ) -> None:  # fmt: skip
        self.fs, self.layout, self.channels = form.fs, form.layout, form.channels
        self.start_s = start_s
        self._kind, self._zero, self._taken = kind, stamp, 0
        profile = find_profile(options.profile)
        grid_s = start_s - first * SUPERFRAME_S
        source = superframe_source(
            Shifted(motion, grid_s), voice, profile.l0_bytes, profile.l1_bytes, first=first,
            signing=signing.run(start_s, first) if signing else None,
        )  # fmt: skip
        self._embedder = AudioEmbedder(
            self.fs, self.channels, source, profile=profile.name, key=options.key,
            grade=options.grade, stretch=options.stretch,
            rehearsal=make_rehearsal(profile, options.key, options.through),
        )  # fmt: skip
        self._bit_rate, self._per_packet, self._settings = bit_rate, per_packet, settings
        self._coder: _Coder | None = None
        self._waiting: list[tuple[int, bytes]] = []

    @property
    def superframes(self) -> int:
        """Superframes that were written."""
        return self._embedder.report().superframes

    @property
    def end_s(self) -> float:
        """Up to where on the motion's clock sound came in."""
        return self.start_s + self._taken / self.fs

    @property
    def stamp(self) -> int:
        """Time stamp of the next sample."""
        return self._zero + self._taken * TICKS_HZ // self.fs

    def late(self, due: int) -> int:
        """Return how many samples a time stamp lies after the line's end."""
        return step(due, self.stamp) * self.fs // TICKS_HZ

    def process(self, samples: Samples) -> Iterator[MarkedPes]:
        self._taken += len(samples)
        yield from self._code(self._embedder.process(samples))

    def flush(self) -> Iterator[MarkedPes]:
        yield from self._code(self._embedder.flush())
        if self._coder is not None:
            self._waiting += self._coder.flush()
        yield from self._packets(1)

    def _code(self, marked: Samples) -> Iterator[MarkedPes]:
        if not len(marked):
            return
        if self._coder is None:
            self._coder = _Coder(self._kind, self.fs, self.layout, self._bit_rate(), self._settings)
        self._waiting += self._coder.process(marked)
        yield from self._packets(self._per_packet)

    def _packets(self, count: int) -> Iterator[MarkedPes]:
        """Yield packets of so many frames, and keep the rest."""
        while self._waiting and len(self._waiting) >= count:
            frames, self._waiting = self._waiting[:count], self._waiting[count:]
            begin = self._zero + frames[0][0] * TICKS_HZ // self.fs
            assert self._coder is not None
            end = begin + len(frames) * self._coder.frame_size * TICKS_HZ // self.fs
            data = b"".join(framed(self._kind, f, self.fs, self.channels) for _, f in frames)
            stream_id = 0xBD if self._kind in ("ac3", "eac3") else 0xC0
            yield MarkedPes(begin, end, write_pes(stream_id, begin, data))


class _Coder:
    """Encoder of one run; frames come out with the number of their first sample."""

    def __init__(
        self, kind: str, fs: int, layout: str, bit_rate: int, settings: dict[str, str]
    ) -> None:
        name = _CODERS[kind][1]
        coder: Any = av.CodecContext.create(name, "w")
        coder.sample_rate, coder.layout = fs, layout
        offered = [form.name for form in coder.codec.audio_formats]
        coder.format = "fltp" if "fltp" in offered else "s16"
        coder.bit_rate = _usual_rate(name, bit_rate or _USUAL_BITS)
        coder.options = settings
        try:
            coder.open(strict=False)
        except (av.FFmpegError, ValueError) as error:
            raise CueError(f"{name} cannot encode {layout} sound at {fs} Hz: {error}") from error
        self._coder, self._layout, self._fs = coder, layout, fs
        self.frame_size: int = coder.frame_size
        self._held = np.zeros((0, coder.layout.nb_channels), np.float32)
        self._count = 0

    def process(self, samples: Samples) -> list[tuple[int, bytes]]:
        self._held = np.concatenate([self._held, samples])
        out: list[tuple[int, bytes]] = []
        while len(self._held) >= self.frame_size:
            out += self._encode(self._held[: self.frame_size])
            self._held = self._held[self.frame_size :]
        return out

    def flush(self) -> list[tuple[int, bytes]]:
        out = self._encode(self._held) if len(self._held) else []
        try:
            return out + [(p.pts, bytes(p)) for p in self._coder.encode(None)]
        except (av.FFmpegError, ValueError):
            return out

    def _encode(self, samples: Samples) -> list[tuple[int, bytes]]:
        if self._coder.format.name == "fltp":
            plain: NDArray[Any] = np.ascontiguousarray(samples.T)
        else:
            plain = np.clip(np.rint(samples * 32768), -32768, 32767).astype(np.int16).reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(plain, self._coder.format.name, self._layout)
        frame.sample_rate, frame.pts = self._fs, self._count
        frame.time_base = Fraction(1, self._fs)
        self._count += len(samples)
        return [(packet.pts, bytes(packet)) for packet in self._coder.encode(frame)]


class Shifted:
    """A motion whose time 0 is another time of its source."""

    def __init__(self, motion: MotionSource, offset_s: float) -> None:
        self._motion, self._offset_s = motion, offset_s
        self._moved: tuple[Score | None, Score | None] = None, None

    @property
    def score(self) -> Score:
        """That of the source, on the source's own clock."""
        return self._motion.score

    @property
    def rate_hz(self) -> float:
        """Frames per second."""
        return self._motion.rate_hz

    @property
    def filmed(self) -> bool:
        """Whether a camera saw the cuer."""
        return self._motion.filmed

    def window(self, start_s: float, frames: int) -> Motion:
        """Return the motion from `start_s` on."""
        found = self._motion.window(start_s + self._offset_s, frames)
        if found.score is not self._moved[0]:
            self._moved = found.score, _moved(found.score, -self._offset_s)
        return replace(found, start_s=start_s, score=self._moved[1])


def _moved(score: Score | None, by_s: float) -> Score | None:
    if score is None or not by_s:
        return score
    moved = [
        [replace(one, start=one.start + by_s, end=one.end + by_s) for one in line]
        for line in (score.phones, score.keys)
    ]
    return Score(tuple(moved[0]), tuple(moved[1]))  # type: ignore[arg-type]


def _decoder(kind: str) -> Any:
    return av.CodecContext.create(_CODERS[kind][0], "r")


def _usual_rate(name: str, bit_rate: int) -> int:
    """Return a bit rate that the encoder knows, the nearest to what the programme had."""
    if name == "aac":
        return bit_rate
    steps = {
        "mp2": (32, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384),
        "ac3": (32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384, 448, 512, 576,
                640),
        "eac3": (32, 48, 64, 96, 128, 160, 192, 224, 256, 320, 384, 448, 512, 640, 768, 1024),
    }[name]  # fmt: skip
    return min((1000 * k for k in steps), key=lambda rate: abs(rate - bit_rate))
