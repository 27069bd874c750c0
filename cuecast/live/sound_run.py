"""Sound of one form on an unbroken line: marked, coded again, and put into PES packets."""

import math
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
from cuecast.dubbing.coder_stream import FRAME_SHIFT, Breath, make_line_rehearsal, make_rehearsal
from cuecast.dubbing.coder_stream import FS as CODER_FS
from cuecast.dubbing.motions import MotionSource
from cuecast.dubbing.payloads import superframe_source
from cuecast.live.frames import framed
from cuecast.live.options import LiveOptions, MarkedPes, RunClock
from cuecast.live.packets import TICKS_HZ, step, write_pes
from cuecast.live.signing import LiveSigning
from cuecast.media.encode import usual_rate
from watermark.audio.embed.codec_loop import CodecLoop
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.signal.profile import AudioProfile, find_profile
from watermark.link.superframe import SUPERFRAME_S

_USUAL_BITS = 64_000
"""Bit/s for one channel where the stream stated none yet."""

_LONGEST_PACKET_S = 0.2
"""Most sound in a packet: its first frame waits for its last one."""

CODERS = {
    "mp2": ("mp2", "mp2"),
    "aac": ("aac", "aac"),
    "latm": ("aac_latm", "aac"),
    "ac3": ("ac3", "ac3"),
    "eac3": ("eac3", "eac3"),
}
"""Decoder and encoder of each kind of sound."""

Samples = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class SoundForm:
    """Rate, arrangement and number of a sound's channels."""

    fs: int
    layout: str
    channels: int


class SoundRun:
    """Sound of one form on an unbroken line: marked and coded again."""

    def __init__(
        self, kind: str, form: SoundForm, stamp: int, start_s: float, first: int,
        motion: MotionSource, voice: Voice, options: LiveOptions, signing: LiveSigning | None,
        packing: Callable[[], float], settings: dict[str, str], bit_rate: Callable[[], int],
        *, joint: int = 0, rehearsed: bool = True,
    ) -> None:  # fmt: skip
        self.fs, self.layout, self.channels = form.fs, form.layout, form.channels
        self.start_s = start_s
        self._kind, self._zero, self._taken = kind, stamp, 0
        self._motion, self._voice, self._options, self._signing = motion, voice, options, signing
        self._written, self._begun, self._first = 0, 0, first
        self._grid_s = start_s + joint / form.fs - first * SUPERFRAME_S
        self._joint, self.rehearsed = joint, rehearsed
        self._ready: list[Samples] = []
        self._bit_rate, self._packing, self._settings = bit_rate, packing, settings
        self._embedder = self._new_embedder(first)
        self._coder: _Coder | None = None
        self._waiting: list[tuple[int, bytes]] = []

    @property
    def superframes(self) -> int:
        """Superframes that were written."""
        return self._written + self._embedder.report().superframes

    @property
    def next_number(self) -> int:
        """Number of the next superframe that a later run can begin with."""
        return max(self._first, math.ceil((self.end_s - self._grid_s) / SUPERFRAME_S - 1e-6))

    @property
    def clock(self) -> RunClock:
        """Clock of this run."""
        return RunClock(self._zero, self.start_s, self._grid_s)

    def begin_again(self, rehearsed: bool) -> float:
        """Finish pending sound, and mark on from the next superframe with or without rehearsal.

        Return the seconds up to there, which stay unmarked.
        """
        self._ready.append(self._embedder.flush())
        self._written += self._embedder.report().superframes
        first, self.rehearsed = self.next_number, rehearsed
        begins = round((self._grid_s + first * SUPERFRAME_S - self.start_s) * self.fs)
        self._joint = begins - self._taken
        self._embedder = self._new_embedder(first)
        return self._joint / self.fs

    def _new_embedder(self, first: int) -> AudioEmbedder:
        """Return an embedder whose first superframe has a number of this run's grid."""
        options, profile = self._options, find_profile(self._options.profile)
        begins_s = self._grid_s + first * SUPERFRAME_S
        source = superframe_source(
            Shifted(self._motion, self._grid_s),
            self._voice,
            profile.l0_bytes,
            profile.l1_bytes,
            first=first,
            signing=self._signing.run(begins_s, first) if self._signing else None,
        )
        rehearsal = self._new_rehearsal(profile) if self.rehearsed else None
        return AudioEmbedder(
            self.fs,
            self.channels,
            source,
            profile=profile.name,
            key=options.key,
            grade=options.grade,
            stretch=options.stretch,
            rehearsal=rehearsal,
        )

    def _new_rehearsal(self, profile: AudioProfile) -> CodecLoop | None:
        """Return the rehearsal on the broadcaster's coder, if it is known, or on this run's own."""
        options = self._options
        skipped = round(self._joint * CODER_FS / self.fs) + FRAME_SHIFT
        if options.through is not None:
            return make_rehearsal(profile, options.key, options.through, skipped)
        encoder = CODERS[self._kind][1]

        def bit_rate() -> int:
            return usual_rate(encoder, self._bit_rate() or _USUAL_BITS * self.channels)

        return make_line_rehearsal(profile, options.key, encoder, self.channels, bit_rate, skipped)

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
        """Take samples (n, channels); yield the packets that are finished."""
        self._taken += len(samples)
        plain, samples = samples[: self._joint], samples[self._joint :]
        self._joint -= len(plain)
        self._ready.append(plain)
        if len(samples):
            self._ready.append(self._embedder.process(samples))
        yield from self.drain()

    def drain(self) -> Iterator[MarkedPes]:
        """Yield the packets that are ready."""
        ready, self._ready = self._ready, []
        for samples in ready:
            yield from self._code(samples)

    def flush(self) -> Iterator[MarkedPes]:
        """Yield the rest."""
        yield from self._code(self._embedder.flush())
        if self._coder is not None:
            self._waiting += self._coder.flush()
            yield from self._packets(least=1)

    def _code(self, marked: Samples) -> Iterator[MarkedPes]:
        if not len(marked):
            return
        if self._coder is None:
            self._coder = _Coder(self._kind, self.fs, self.layout, self._bit_rate(), self._settings)
        self._waiting += self._coder.process(marked)
        yield from self._packets()

    def _packets(self, least: int = 0) -> Iterator[MarkedPes]:
        """Yield packets of as many frames as those that came in; keep less than `least` of them."""
        assert self._coder is not None
        longest = int(_LONGEST_PACKET_S * self.fs) // self._coder.frame_size
        count = max(1, min(round(self._packing()), longest))
        while len(self._waiting) >= (least or count):
            frames, self._waiting = self._waiting[:count], self._waiting[count:]
            begin = self._zero + frames[0][0] * TICKS_HZ // self.fs
            end = begin + len(frames) * self._coder.frame_size * TICKS_HZ // self.fs
            data = b"".join(framed(self._kind, f, self.fs, self.channels) for _, f in frames)
            stream_id = 0xBD if self._kind in ("ac3", "eac3") else 0xC0
            yield MarkedPes(begin, end, write_pes(stream_id, begin, data))


class _Coder:
    """Encoder of one run; frames come out with the number of their first sample.

    The first sample is coded once more, and the last is not: with frames in the same places a coder
    rounds back to the values that came in, see `FRAME_SHIFT`.
    """

    def __init__(
        self, kind: str, fs: int, layout: str, bit_rate: int, settings: dict[str, str]
    ) -> None:
        name = CODERS[kind][1]
        coder: Any = av.CodecContext.create(name, "w")
        coder.sample_rate, coder.layout = fs, layout
        offered = [form.name for form in coder.codec.audio_formats]
        coder.format = "fltp" if "fltp" in offered else "s16"
        coder.bit_rate = usual_rate(name, bit_rate or _USUAL_BITS * coder.layout.nb_channels)
        coder.options = settings
        try:
            coder.open(strict=False)
        except (av.FFmpegError, ValueError) as error:
            raise CueError(f"{name} cannot encode {layout} sound at {fs} Hz: {error}") from error
        self._coder, self._layout, self._fs = coder, layout, fs
        self.frame_size: int = coder.frame_size
        self._held = np.zeros((0, coder.layout.nb_channels), np.float32)
        self._breath = Breath(coder.layout.nb_channels) if name == "aac" else None
        self._count = 0

    def process(self, samples: Samples) -> list[tuple[int, bytes]]:
        if not self._count and not len(self._held):
            samples = np.concatenate([np.repeat(samples[:1], FRAME_SHIFT, axis=0), samples])
        if self._breath is not None:
            samples = self._breath.on(samples)
        self._held = np.concatenate([self._held, samples])
        out: list[tuple[int, bytes]] = []
        while len(self._held) >= self.frame_size:
            out += self._encode(self._held[: self.frame_size])
            self._held = self._held[self.frame_size :]
        return out

    def flush(self) -> list[tuple[int, bytes]]:
        rest = self._held[: len(self._held) - FRAME_SHIFT]
        out = self._encode(rest) if len(rest) else []
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

    @property
    def whole(self) -> bool:
        """Whether all of it is known beforehand."""
        return self._motion.whole

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
