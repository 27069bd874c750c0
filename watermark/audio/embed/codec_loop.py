"""Codec in the loop: each stretch is tried on the broadcaster's own coder before it is marked.

In: the programme some seconds ahead, and the levels that it is to have; out: the level at which
each superframe would bear its message. The coder runs on as one stream, for its rate control has a
long memory: before the programme it hears sound that is hard to code, as one on air for
long. Its superframes carry anything. Source: the copy of the receiver inside the emitter of Baras,
Moreau and Dymarski, IEEE TASLP 14(5), 2006, with the channel between them.
Specification: spec/audio-carrier.md, W20 and W40 leave this to the embedder.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from watermark.audio.embed.design import HostSpectra
from watermark.audio.embed.levels import LEVELS_PER_DOUBLING, nearest_level
from watermark.audio.embed.stereo_design import StereoDesigner
from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.mix import front_of
from watermark.audio.signal.profile import FS, HOP, SUPERFRAME, AudioProfile
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer
from watermark.link.link import L0_CHECK, L1_CHECK

LEARNING_S = 2.0
"""Sound in seconds that the coder's delay is found from."""

LONGEST_DELAY = 8192
"""Greatest delay of a coder in samples."""

RUN_IN_S, RUN_IN_AMPLITUDE, RUN_IN_BURST, RUN_IN_BURST_S = 1.536, 0.1, 4.0, 0.1
"""Noise that coders hear first: its length, its deviation, the factor of every third part, and the
length of a part. A fresh AAC coder of FFmpeg leaves four times the information of one that has run
for 8 s; after 1.5 s of bursts it is as the latter. Its length is a multiple of `WHOLE_FRAMES`."""

WHOLE_FRAMES = 9216
"""Samples in which frames of AAC (1024), MP2 and MP3 (1152) and AC-3 (1536) are whole. Where a
programme was in AAC before, AAC with its frames in the same places leaves least, at 96 kbit/s .4
and at 128 .8 of what it leaves with frames a sample away or more: it rounds back to the values that
the programme was coded with."""

LEAST = 4.0
"""Information below which one measurement does not resolve how little there was, bits."""

MARGIN = 1.9
"""Information that is enough, in units of the message's and its checks' bits: with 1.5 to 1.7 a
superframe in 50 to 150 was lost that had grade left."""

LEAST_ENOUGH = 170.0
"""Information that a short message asks for: its code is short, and its capacity varies more. With
136 bits (robust) a superframe in 200 was lost through AAC 64k, with grade to spare.
"""

REMEMBERED = 64
"""Superframes whose measurements are kept, 41 s: more than lie between rehearsal and air."""


class CodecStream(Protocol):
    """A coder and its decoder as one stream, 48 kHz.

    Examples
    --------
    >>> class Wire:
    ...     def process(self, sound):
    ...         return sound
    >>> coder: CodecStream = Wire()
    >>> coder.process(np.zeros((480, 2), np.float32)).shape
    (480, 2)
    """

    def process(self, sound: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take samples, shape (n, 1 or 2); return samples decoded by now, shape (m, channels)."""


@dataclass(frozen=True, slots=True)
class _Sent:
    number: int
    apart: bool
    start: int
    payload: tuple[bytes, bytes]
    level: float


@dataclass(frozen=True, slots=True)
class _Measured:
    """A superframe after the coder that left least of it.

    Attributes
    ----------
    doublings : float
        Logarithm to base 2 of the information that was left, in bits.
    level : float
        At which it was sent.
    coder : str
        Name of that coder.
    """

    doublings: float
    level: float
    coder: str


class _Ear:
    """One coder with its decoded output."""

    def __init__(self, through: CodecStream, name: str) -> None:
        self._through, self.name = through, name
        self.heard = StereoBuffer()
        self.delay: int | None = None
        self.waiting: deque[_Sent] = deque()

    def take(self, marked: NDArray[np.float64], sent: SampleBuffer) -> None:
        """Send marked sound."""
        heard = self._through.process(marked.astype(np.float32))
        left, right = heard[:, 0].astype(np.float64), heard[:, -1].astype(np.float64)
        self.heard.append_pair((left + right) / 2, (left - right) / 2)
        if self.delay is None and self.heard.end >= LEARNING_S * FS + LONGEST_DELAY:
            self.delay = self._find_delay(sent)
        self.heard.forget(self.heard.end - 8 * SUPERFRAME)

    def arrived(self) -> Iterator[_Sent]:
        """Yield the superframes that are whole."""
        while self.delay is not None and self.waiting:
            if self.waiting[0].start + self.delay + SUPERFRAME + 2 * HOP > self.heard.end:
                return
            yield self.waiting.popleft()

    def _find_delay(self, sent: SampleBuffer) -> int:
        """Find the delay of the decoded sound in samples, by correlation."""
        count = int(LEARNING_S * FS)
        size = 1 << (count + LONGEST_DELAY).bit_length()
        original = np.fft.rfft(sent.read(0.0, 1.0, count), size)
        heard = np.fft.rfft(self.heard.read(0.0, 1.0, count + LONGEST_DELAY), size)
        likeness = np.fft.irfft(heard * original.conj(), size)
        return int(likeness[:LONGEST_DELAY].argmax())


class CodecLoop:
    """Sends superframes through a coder and compares the result with the intended ones.

    Parameters
    ----------
    profile : AudioProfile
        Of the embedder.
    key : int
        Seed of the layout.
    *through : CodecStream
        The coders; the one that leaves least of a superframe counts.
    names : sequence of str
        Names of the coders, for reports.
    skipped : int
        Samples of the programme before the first that is sent.

    Attributes
    ----------
    count : int
        Superframes that were sent.

    Examples
    --------
    >>> from watermark import PROFILES
    >>> class Wire:
    ...     def process(self, sound):
    ...         return sound
    >>> loop = CodecLoop(PROFILES["audio"]["standard"], 0, Wire(), names=("wire",))
    >>> loop.count, loop.enough(0)
    (0, None)
    """

    def __init__(
        self,
        profile: AudioProfile,
        key: int,
        *through: CodecStream,
        names: Sequence[str] = (),
        skipped: int = 0,
    ) -> None:
        named = [*names, *[""] * (len(through) - len(names))]
        self._run_in = round(RUN_IN_S * FS) + skipped % WHOLE_FRAMES
        self._ears = [_Ear(coder, name) for coder, name in zip(through, named, strict=True)]
        self._designer = StereoDesigner(profile, key)
        self._demodulator = Demodulator(profile, key)
        self._masker = make_masker()
        self._before, self._tail = np.zeros((2, HOP)), np.zeros((2, HOP))
        self._sent = SampleBuffer()
        self._measured: dict[int, _Measured] = {}
        self._bits = profile.message_bits + L0_CHECK + (L1_CHECK if profile.l1_bytes else 0)
        self._enough = float(np.log2(max(MARGIN * self._bits, LEAST_ENOUGH)))
        self.count = 0

    def enough(self, number: int) -> float | None:
        """Level at which a superframe bears its message with `MARGIN`, None if unknown."""
        if (measured := self._measured.get(number)) is None:
            return None
        missing = self._enough - measured.doublings
        return measured.level + LEVELS_PER_DOUBLING * missing

    def margin(self, number: int, level: float) -> tuple[float, str] | None:
        """Information of a superframe at a level, and the coder that leaves least of it.

        The information is in units of the bits of the message and its checks; None if unknown.
        """
        if (measured := self._measured.get(number)) is None:
            return None
        doublings = measured.doublings + (level - measured.level) / LEVELS_PER_DOUBLING
        return float(2**doublings / self._bits), measured.coder

    def send(
        self,
        mid: NDArray[np.float64],
        side: NDArray[np.float64],
        levels: list[float],
        *,
        apart: bool = False,
        clean: Sequence[HostSpectra] | None = None,
    ) -> None:
        """Try the next superframes, and learn from the output so far.

        Parameters
        ----------
        mid, side : ndarray of float64, shape (superframes * SUPERFRAME + HOP,)
            The programme; `side` is silence where there is none.
        levels : list of float
            Level of each superframe, see `MarkDesigner.design`.
        apart : bool
            Whether cells stand in left and right, too: the side is marked.
        clean : sequence of HostSpectra, optional
            Those of each superframe, if known.
        """
        if self.count == 0:
            run_in = _run_in(2 if side.any() else 1, self._run_in)
            self._sent.append(run_in.mean(axis=1))
            self._listen(run_in)
        # Where the side is not marked, the mark is that of mono.
        sound = np.stack([mid, side if apart else np.zeros_like(side)])
        marked = sound.copy()
        marked[:, :HOP] += self._tail
        for i, level in enumerate(levels):
            span = slice(i * SUPERFRAME, (i + 1) * SUPERFRAME + HOP)
            payload = self._anything()
            # Just after an apart one, a superframe of the mid alone still has the side's end.
            known = apart or not self._before[1].any()
            made = self._designer.design(
                self._before,
                marked[:, span],
                payload,
                level,
                rounds=1,
                clean=clean[i] if clean is not None and known else None,
            )
            marked[:, span] += made.mark
            self._before = marked[:, (i + 1) * SUPERFRAME - HOP : (i + 1) * SUPERFRAME]
            if made.carries:
                start = self._sent.end + i * SUPERFRAME
                for ear in self._ears:
                    ear.waiting.append(_Sent(self.count, apart, start, payload, level))
            self.count += 1
        self._tail = (marked - sound)[:, -HOP:]
        self._sent.append(marked[0, :-HOP])
        beside = marked[1] if apart else side
        self._listen(front_of(marked[0], beside, 2 if beside.any() else 1)[:-HOP])

    def end(self) -> None:
        """Let the coder say the rest."""
        self._listen(np.zeros((2 * LONGEST_DELAY, 1)))

    def _anything(self) -> tuple[bytes, bytes]:
        rng, profile = np.random.default_rng(self.count), self._demodulator.profile
        return rng.bytes(profile.l0_bytes), rng.bytes(profile.l1_bytes)

    def _listen(self, marked: NDArray[np.float64]) -> None:
        """Send marked sound, and learn from the output."""
        for ear in self._ears:
            ear.take(marked, self._sent)
            for sent in ear.arrived():
                self._learn(sent, ear)
        for number in sorted(self._measured)[:-REMEMBERED]:
            del self._measured[number]
        self._sent.forget(self._sent.end - 8 * SUPERFRAME)

    def _learn(self, sent: _Sent, ear: _Ear) -> None:
        """Compare a superframe with the intended one."""
        demodulator = self._demodulator
        cells = demodulator.layout.cells
        places = demodulator.places if sent.apart else None
        view = read_view(ear.heard, sent.start + (ear.delay or 0), 1.0, self._masker, places)
        soft = view.soft(cells, demodulator.profile.step(nearest_level(sent.level)))
        bits = demodulator.link.encode(*sent.payload)
        agreement = soft * demodulator.layout.spread(1.0 - 2.0 * bits)
        known = np.maximum((agreement != 0).sum(axis=0), 1)
        # Of n cells without information the squared mean is 1 / 2n on average.
        resultant = np.maximum((agreement.sum(axis=0) / known) ** 2 - 0.5 / known, 0.0)
        information = float((known * resultant).sum() / np.log(2))
        doublings = float(np.log2(max(information, LEAST)))
        # What counts is the coder that leaves least.
        least = self._measured.get(sent.number)
        if least is None or doublings < least.doublings:
            self._measured[sent.number] = _Measured(doublings, sent.level, ear.name)


def _run_in(channels: int, count: int) -> NDArray[np.float64]:
    """Noise with bursts, shape (count, channels)."""
    part = round(RUN_IN_BURST_S * FS)
    bursts = np.where(np.arange(count) // part % 3 == 0, RUN_IN_BURST, 1.0)
    noise = np.random.default_rng(0).normal(0.0, RUN_IN_AMPLITUDE, (count, channels))
    return np.asarray(np.clip(noise * bursts[:, np.newaxis], -1.0, 1.0))
