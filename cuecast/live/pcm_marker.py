"""Plain samples on their way through the embedder, in the process that marks."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from cuecast.dubbing.coder_stream import make_rehearsal
from cuecast.dubbing.motions import MotionSource
from cuecast.dubbing.payloads import superframe_source
from cuecast.live.options import LiveOptions
from cuecast.live.pcm import MarkedPcm, PcmForm
from cuecast.live.sound_run import Shifted
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.signal.profile import find_profile
from watermark.link.superframe import SUPERFRAME_S


class PcmMarker:
    """Marks a line of samples; after a gap in their numbers it begins anew.

    Parameters
    ----------
    motion : MotionSource
        Times count from sample 0.
    voice : Voice
    options : LiveOptions
    form : PcmForm
    """

    def __init__(
        self, motion: MotionSource, voice: Voice, options: LiveOptions, form: PcmForm
    ) -> None:
        self._motion, self._voice, self._options, self._form = motion, voice, options, form
        self._signing = options.signing()
        self._embedder: AudioEmbedder | None = None
        self._next = self._given = self._first = 0

    @property
    def heard_s(self) -> float:
        """Up to where on the motion's clock samples came in."""
        return self._next / self._form.fs

    @property
    def superframes(self) -> int:
        """Superframes that were written."""
        return self._first + (self._embedder.report().superframes if self._embedder else 0)

    def process(self, first: int, data: bytes) -> Iterator[MarkedPcm]:
        """Take samples, and the number of the first; yield those that are marked."""
        if first != self._next or self._embedder is None:
            self._begin(first)
        assert self._embedder is not None
        samples = self._form.floats(data)
        self._next += len(samples)
        yield from self._told(self._embedder.process(samples))

    def flush(self) -> Iterator[MarkedPcm]:
        """Yield the samples under way."""
        if self._embedder is not None:
            yield from self._told(self._embedder.flush())

    def _begin(self, first: int) -> None:
        self._first, self._next, self._given = self.superframes, first, first
        profile = find_profile(self._options.profile)
        begins_s = first / self._form.fs
        grid_s = begins_s - self._first * SUPERFRAME_S
        source = superframe_source(
            Shifted(self._motion, grid_s),
            self._voice,
            profile.l0_bytes,
            profile.l1_bytes,
            first=self._first,
            signing=self._signing.run(begins_s, self._first) if self._signing else None,
        )
        self._embedder = AudioEmbedder(
            self._form.fs,
            self._form.channels,
            source,
            profile=profile.name,
            key=self._options.key,
            grade=self._options.grade,
            stretch=self._options.stretch,
            rehearsal=make_rehearsal(profile, self._options.key, self._options.through),
        )

    def _told(self, marked: NDArray[np.float32]) -> Iterator[MarkedPcm]:
        if len(marked):
            yield MarkedPcm(self._given, self._form.bytes(marked))
            self._given += len(marked)
