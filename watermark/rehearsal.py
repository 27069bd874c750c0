"""The broadcaster's own coder inside the embedder: what was marked is sent through it and read.

In: marked stretches and what they carry; out: by how many levels superframes fell short of, or
exceeded, what the others bear: the next performance can make good for it. The coder runs on as one
stream, for its rate control has a long memory. Source: the copy of the receiver inside the emitter
of Baras, Moreau and Dymarski, IEEE TASLP 14(5), 2006, with the channel between them.
Specification: none.
"""

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from watermark.align import read_view
from watermark.demodulate import Demodulator
from watermark.masking import make_masker
from watermark.profile import FS, HOP, SUPERFRAME, Profile
from watermark.tape import Tape

LEARNING_S = 2.0
"""Sound from which the coder's delay is found."""

LONGEST_DELAY = 8192
"""Samples by which a coder may be late."""

LEVELS_PER_DOUBLING = 2.0
"""Levels that double a superframe's information, about."""

TRUST = 0.7
"""Part of a measured shortage that the next performance makes good: coders are capricious."""

LIMITS = (-3.0, 5.0)
"""Levels that experience may add to a need."""

LEAST = 4.0
"""Information below which one measurement does not tell how little there was, bits."""


class Through(Protocol):
    """A coder and its decoder as one stream, 48 kHz."""

    def process(self, sound: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take samples, shape (n, 1 or 2); return what is decoded by now, shape (m, channels)."""


@dataclass(frozen=True, slots=True)
class _Sent:
    number: int
    start: int
    payload: tuple[bytes, bytes]
    level: int


class Rehearsal:
    """Sends marked sound through a coder and compares what comes back with what was meant.

    Parameters
    ----------
    profile : Profile
        Of the embedder.
    key : int
        Seed of the layout.
    through : Through
        The coder.
    """

    def __init__(self, profile: Profile, key: int, through: Through) -> None:
        self._through = through
        self._demodulator = Demodulator(profile, key)
        self._masker = make_masker()
        self._sent, self._heard = Tape(), Tape()
        self._delay: int | None = None
        self._waiting: deque[_Sent] = deque()
        self._count = 0
        self._doublings: dict[int, float] = {}

    def shortages(self) -> dict[int, float]:
        """Levels by which superframes should stand higher, by number; their median is 0."""
        if not self._doublings:
            return {}
        usual = float(np.median(list(self._doublings.values())))
        return {
            number: float(np.clip(TRUST * LEVELS_PER_DOUBLING * (usual - held), *LIMITS))
            for number, held in self._doublings.items()
        }

    def send(
        self,
        marked: NDArray[np.float64],
        payloads: list[tuple[bytes, bytes]],
        levels: list[int | None],
    ) -> None:
        """Take the next stretch, shape (superframes * SUPERFRAME, 1 or 2), and learn from it.

        Parameters
        ----------
        marked : ndarray of float64
            Front of the programme with its mark.
        payloads : list of (bytes, bytes)
            What its superframes carry.
        levels : list of int or None
            At which level; None where nothing was written.
        """
        for i, (payload, level) in enumerate(zip(payloads, levels, strict=True)):
            if level is not None:
                start = self._sent.end + i * SUPERFRAME
                self._waiting.append(_Sent(self._count + i, start, payload, level))
        self._count += len(payloads)
        self._sent.append(marked.mean(axis=1))
        self._heard.append(self._through.process(marked.astype(np.float32)).mean(axis=1))
        if self._delay is None and self._heard.end >= LEARNING_S * FS + LONGEST_DELAY:
            self._delay = self._find_delay()
        if self._delay is None:
            return
        while self._waiting and self._arrived(self._waiting[0], self._delay):
            self._learn(self._waiting.popleft(), self._delay)
        for tape in (self._sent, self._heard):
            tape.forget(tape.end - 8 * SUPERFRAME)

    def _arrived(self, sent: _Sent, delay: int) -> bool:
        return sent.start + delay + SUPERFRAME + 2 * HOP <= self._heard.end

    def _find_delay(self) -> int:
        """Find the samples by which the decoded sound is late, by correlation."""
        count = int(LEARNING_S * FS)
        size = 1 << (count + LONGEST_DELAY).bit_length()
        sent = np.fft.rfft(self._sent.read(0.0, 1.0, count), size)
        heard = np.fft.rfft(self._heard.read(0.0, 1.0, count + LONGEST_DELAY), size)
        likeness = np.fft.irfft(heard * sent.conj(), size)
        return int(likeness[:LONGEST_DELAY].argmax())

    def _learn(self, sent: _Sent, delay: int) -> None:
        """Compare a superframe with what was meant."""
        demodulator = self._demodulator
        cells = demodulator.layout.cells
        view = read_view(self._heard, sent.start + delay, 1.0, self._masker)
        soft = view.soft(cells, demodulator.profile.step(sent.level))
        bits = demodulator.link.encode(*sent.payload)
        agreement = soft * demodulator.layout.spread(1.0 - 2.0 * bits)
        known = np.maximum((agreement != 0).sum(axis=0), 1)
        # Of n cells without information the squared mean is 1 / 2n on average.
        resultant = np.maximum((agreement.sum(axis=0) / known) ** 2 - 0.5 / known, 0.0)
        information = float((known * resultant).sum() / np.log(2))
        self._doublings[sent.number] = float(np.log2(max(information, LEAST)))
