"""The receiver of a playout's own output: PES packets in, time stamps of superframes out."""

from collections.abc import Iterator
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from cuecast.dubbing.coder_stream import FS as CODER_FS
from cuecast.dubbing.coder_stream import CoderStream
from cuecast.live.frames import FrameCutter
from cuecast.live.packets import PERIOD, TICKS_HZ, Pes, step
from cuecast.live.sound_run import CODERS
from receiver.media.sound import as_float
from watermark.audio.receiver import AudioReceiver

_JITTER_S = 0.05
"""Time stamps that stray by more begin the reception anew: there the sound has a joint or a gap."""

Samples = NDArray[np.float32]


class OwnReceiver:
    """Receives sound that went out, PES by PES.

    Parameters
    ----------
    key : int
        Of the watermark.
    through : str, optional
        Coder of the broadcast that the sound passes first, such as ``aac:64k``.
    """

    def __init__(self, key: int, through: str | None = None) -> None:
        self._key, self._through = key, through
        self._kind = ""
        self._decoder: Any = None
        self._cutter: FrameCutter | None = None
        self._form: tuple[int, int] | None = None
        self._receiver: AudioReceiver | None = None
        self._channel: CoderStream | None = None
        self._zero = self._taken = 0

    def process(self, kind: str, pes: Pes) -> Iterator[int]:
        """Take a PES packet; yield the time stamp at which each received superframe begins."""
        if kind != self._kind:
            self._kind, self._receiver = kind, None
            self._decoder = av.CodecContext.create(CODERS[kind][0], "r")
            self._cutter = FrameCutter(kind)
        assert self._cutter is not None
        due = pes.pts
        for number, part in enumerate(pes.parts):
            if number:
                self._cutter.restart()
            for frame, _ in self._cutter.process(part):
                try:
                    sounds = list(self._decoder.decode(av.Packet(frame.data)))
                except (av.FFmpegError, ValueError):
                    continue
                for sound in sounds:
                    yield from self._hear(as_float(sound), sound.sample_rate, due)
                    due = None

    def _hear(self, samples: Samples, fs: int, due: int | None) -> Iterator[int]:
        form = fs, samples.shape[1]
        if due is not None:
            here = self._zero + self._taken * TICKS_HZ // fs
            stray = abs(step(due, here % PERIOD)) > _JITTER_S * TICKS_HZ
            if self._receiver is None or stray or form != self._form:
                self._begin(form, due)
        if self._receiver is None or form != self._form:
            return
        self._taken += len(samples)
        if self._channel is not None:
            samples = self._channel.process(samples)
        for found in self._receiver.process(samples):
            if found.l0 is not None:
                yield (self._zero + round(found.position_s * TICKS_HZ)) % PERIOD

    def _begin(self, form: tuple[int, int], due: int) -> None:
        self._form, self._zero, self._taken = form, due, 0
        coded = self._through not in (None, "none") and form[0] == CODER_FS and form[1] <= 2
        self._channel = CoderStream(str(self._through).partition(",")[0]) if coded else None
        self._receiver = AudioReceiver(form[0], 2 if coded else form[1], key=self._key, guess=False)
