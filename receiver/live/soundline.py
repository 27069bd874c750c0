"""The sound of a broadcast: packets in, blocks without holes on one steady clock out.

Damaged packets cost what they hold. A frame of another form (sampling rate, channels) among many
is damage, too. When the other form stays, a new decoder is asked first: damage can make one take
a sound for parametric stereo at twice the rate from then on. If that one agrees, the programme
has changed, and a new run of blocks begins.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import av
import numpy as np
from av.audio.resampler import AudioResampler
from numpy.typing import NDArray

from receiver.live.continuity import SteadyClock
from receiver.television.metrics import Metrics
from watermark.audio.signal.mix import RATES

CODECS = ("aac", "mp2float", "ac3", "eac3", "aac_latm")
"""Sounds of broadcasting: a programme can go on in another one at the same address."""

_MUTE_PACKETS = 40
"""Packets without sound after which another decoder is tried."""

_CHANNELS = (1, 2, 6)
"""Numbers of channels that can carry a cuer."""

_HOLE_S = 0.005
"""Seconds of missing sound that are filled with silence."""

_OVERLAP_S = 0.03
"""Seconds of sound that comes twice before it is cut."""

_FRAMES_OF_DOUBT = 5
"""Frames of another form at which a change is suspected."""

_FRAMES_OF_CHANGE = 10
"""Frames of another form at which it is believed."""


@dataclass(frozen=True, slots=True)
class SoundBlock:
    """Decoded sound.

    Attributes
    ----------
    samples : ndarray of float32, shape (n, channels)
        Holes before it are filled with silence.
    time_s : float
        Of its first sample, on the steady clock.
    fs : int
        Hz.
    fresh : bool
        Whether it begins a new run: the first, or one of another form.
    """

    samples: NDArray[np.float32]
    time_s: float
    fs: int
    fresh: bool


class SoundLine:
    """Decodes the sound of one broadcast through all its connections.

    Parameters
    ----------
    clock : SteadyClock
        Shared with the picture.
    metrics : Metrics
    now_s : float
        Time on the clock up to which another line of this broadcast brought sound.
    """

    def __init__(self, clock: SteadyClock, metrics: Metrics, *, now_s: float = 0.0) -> None:
        self._clock, self._metrics = clock, metrics
        self._decoder: Any = None
        self._announced: Any = None
        self._resampler: AudioResampler | None = None
        self._form = (0, 0)
        self._others = 0
        self._mute = 0
        self._next_s = now_s

    @property
    def now_s(self) -> float:
        """Time up to which sound came out."""
        return self._next_s

    def connect(self, stream: Any) -> None:
        """Expect the packets of a new audio stream, perhaps of another form."""
        self._announced = stream.codec_context
        self._renew(self._announced.name)
        self._resampler = None
        self._others = _FRAMES_OF_CHANGE
        self._mute = 0

    def _renew(self, codec: str) -> None:
        """Begin with a new decoder."""
        like = self._announced
        self._decoder = av.CodecContext.create(codec, "r")
        if codec != like.name:
            return
        if like.sample_rate and like.layout.nb_channels:
            self._decoder.sample_rate, self._decoder.layout = like.sample_rate, like.layout
        if like.extradata:
            self._decoder.extradata = like.extradata

    def _try_another(self) -> None:
        """After many packets without a sound: expect the next of the known codecs."""
        known = self._decoder.name
        at = CODECS.index(known) if known in CODECS else -1
        self._renew(CODECS[(at + 1) % len(CODECS)])

    def take(self, packet: Any) -> Iterator[SoundBlock]:
        """Decode a packet."""
        self._mute += 1
        if self._mute % _MUTE_PACKETS == 0:
            self._try_another()
        try:
            frames = self._decoder.decode(packet)
        except (av.error.FFmpegError, ValueError):
            self._metrics.add("damaged_packets_total")
            return
        for frame in frames:
            if frame.time is not None and frame.samples and self._admit(frame):
                self._mute = 0
                yield from self._resampled(frame)

    def _admit(self, frame: Any) -> bool:
        """Return whether a frame is of the form of this run, or begins the next one."""
        rate, channels = frame.sample_rate, frame.layout.nb_channels
        form = (rate if rate in RATES else 48000, channels)
        if channels not in _CHANNELS or rate < 8000:
            return False
        if form == self._form and self._resampler is not None:
            self._others = 0
            return True
        self._others += 1
        if form != self._form and self._others == _FRAMES_OF_DOUBT:
            self._renew(self._decoder.name)
        if form != self._form and self._others < _FRAMES_OF_CHANGE:
            self._metrics.add("damaged_packets_total")
            return False
        self._others = 0
        self._resampler = AudioResampler(format="fltp", layout=None, rate=form[0])
        return True

    def _resampled(self, frame: Any) -> Iterator[SoundBlock]:
        assert self._resampler is not None
        place = self._clock.place("sound", frame.time, frame.samples / frame.sample_rate)
        if place.spliced:
            self._metrics.add("splices_total")
        try:
            parts = self._resampler.resample(frame)
        except (av.error.FFmpegError, ValueError):  # the decoder changed the kind of its numbers
            self._resampler = None
            return
        for part in parts:
            block = np.ascontiguousarray(part.to_ndarray().T, dtype=np.float32)
            yield from self._joined(block, place.time_s, int(part.sample_rate))

    def _joined(self, block: NDArray[np.float32], time_s: float, fs: int) -> Iterator[SoundBlock]:
        """Fill holes and cut overlaps, so that samples can be counted."""
        form = (fs, block.shape[1])
        fresh = form != self._form
        if fresh:
            self._form = form
            self._next_s = max(time_s, self._next_s)
        missing = round((time_s - self._next_s) * fs)
        if missing > _HOLE_S * fs:
            self._metrics.add("holes_total")
            block = np.concatenate([np.zeros((missing, block.shape[1]), np.float32), block])
        elif missing < -_OVERLAP_S * fs:
            block = block[-missing:]
        if len(block):
            start_s = self._next_s
            self._next_s += len(block) / fs
            yield SoundBlock(block, start_s, fs, fresh)
