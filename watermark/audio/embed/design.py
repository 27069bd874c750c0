"""Design of one superframe's mark, with a copy of the receiver inside.

In: the programme's mid, payloads and a level; out: the mark's samples. Masking thresholds are
derived again from the marked sound until they agree with those that the mark was made with (Baras,
Moreau and Dymarski, IEEE TASLP 14(5), 2006). Single precision, as in the receiver.
Specification: spec/audio-carrier.md, W18 to W28.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from watermark.audio.embed.levels import nearest_level, share_of
from watermark.audio.follow.align import thresholds_of
from watermark.audio.signal.channel_choice import MID
from watermark.audio.signal.dither import mark_change
from watermark.audio.signal.layout import make_layout, make_pilots
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.mdct import analyse, frames_of, synthesise
from watermark.audio.signal.profile import HOP, PILOT_SLOTS, AudioProfile
from watermark.audio.signal.required_level import coder_noise, needed_level
from watermark.link.link import Link

ITERATIONS = 2
"""Rounds of deriving the mask. A third one brings 0.7 % of the information of sound that no coder
has touched, and nothing that five clips showed through AAC at 128 kbit/s."""

ATTACK_BLOCK, ATTACK_BEFORE, ATTACK = 120, 8, 16.0
"""Samples of a block, blocks before it, and by how much its power must exceed theirs, to be an
attack: 2.5 ms against 20 ms, 12 dB, of the sound's differences. A block before it is covered by it,
more is heard: such a frame is left unmarked."""

ATTACK_LEAST = 1e-8
"""Power of differences below which nothing is an attack."""

CARRYING = 0.15
"""A superframe with a smaller share of living cells cannot carry and is left as it is: with 0.35
sparse speech lost superframes that arrive with a quarter of their cells, with 0.1 nearly all that
are written more are lost."""

HostSpectra = tuple[NDArray[np.complex64], NDArray[np.complex64]]
"""Spectra of mid and side of a superframe without any mark, and of the frame before: each of shape
(65, HOP), without frames where the side is silence."""


@dataclass(frozen=True, slots=True)
class MarkedSuperframe:
    """Mark of one superframe: samples, shape (1 or 2, SUPERFRAME + HOP), and whether it is one."""

    mark: NDArray[np.floating[Any]]
    carries: bool


class MarkDesigner:
    """Designs the mark of one superframe after another, at the mark's own rate."""

    def __init__(self, profile: AudioProfile, key: int) -> None:
        self._profile = profile
        self._layout = make_layout(profile, key)
        self._pilots = make_pilots(key)
        # Nothing is written above.
        self._end = max(self._layout.cells.last_bin, self._pilots.cells.last_bin)
        self._alpha = np.linspace(*profile.alphas, profile.groups, dtype=np.float32)
        self._pilot_alpha = np.full(PILOT_SLOTS, self._alpha.mean())
        self._announced = self._pilots.expected(profile.number).astype(np.float32)
        self._masker = make_masker()
        self._bands = int(np.searchsorted(self._masker.edges, self._end))
        self._widths = np.diff(np.minimum(self._masker.edges[: self._bands + 1], self._end))
        self._link = Link(profile)

    def design(
        self,
        before: NDArray[np.float64],
        host: NDArray[np.float64],
        payload: tuple[bytes, bytes],
        level: float,
        *,
        rounds: int = ITERATIONS,
        leaning: int | None = MID,
        clean: HostSpectra | None = None,
    ) -> MarkedSuperframe:
        """Design a mark.

        Parameters
        ----------
        before : ndarray of float64, shape (1, HOP)
            Finished samples just before the superframe.
        host : ndarray of float64, shape (1, SUPERFRAME + HOP)
            The programme's mid with the tail of the mark before.
        payload : tuple of (bytes, bytes)
            L0 and L1.
        level : float
            Index into `LEVELS`, up to `HIGHEST_LEVEL` of `levels`; what lies between two of them or
            above has the step of the nearest one and a part of the quantisation error that makes up
            for it.
        rounds : int
            How often the mask is derived.
        leaning : int, optional
            Place towards which pilots lean in two channels; with None, all cells stand in the mid.
        clean : HostSpectra, optional
            Those of the programme, if known.
        """
        sound = np.concatenate([before[0], host[0]])
        wanted, announced = self._wanted(sound, payload)
        mark = np.zeros(host.shape, dtype=np.float32)
        spectra = self._spectra(sound, None if clean is None else clean[0])
        coefficients = np.ascontiguousarray(spectra[1:, : self._end].real)
        for left in reversed(range(rounds)):
            unit = self._units(spectra, spectra[:0])[0]
            change, living = self._change(coefficients, unit, wanted, announced, level)
            if living < CARRYING:
                return MarkedSuperframe(np.zeros(host.shape), carries=False)
            mark[0] = synthesise(change, HOP)
            if left:
                sound[HOP:] = host[0] + mark[0]
                spectra = self._spectra(sound)
        return MarkedSuperframe(mark, carries=True)

    def spectra_of(self, mid: NDArray[np.float64], side: NDArray[np.float64]) -> HostSpectra:
        """Analyse a superframe's sound, shapes (HOP + SUPERFRAME + HOP,), for `design`, `need`."""
        seen = self._spectra(mid)
        return seen, self._spectra(side) if side.any() else seen[:0]

    def _spectra(
        self, sound: NDArray[np.float64], clean: NDArray[np.complex64] | None = None
    ) -> NDArray[np.complex64]:
        """Spectra of the frames of samples, shape (65, HOP).

        The mark before reaches into the first two frames; the others are `clean` where given.
        """
        if clean is not None and clean.size:
            first = analyse(frames_of(sound[: 3 * HOP].astype(np.float32), HOP), HOP)
            return np.concatenate([first, clean[2:]])
        frames: NDArray[np.complex64] = analyse(frames_of(sound.astype(np.float32), HOP), HOP)
        return frames

    def _units(
        self, mid: NDArray[np.complex64], side: NDArray[np.complex64]
    ) -> NDArray[np.float32]:
        """Mask's units of mid, left and right, or of the mid without a side, (3, 64, bins)."""
        thresholds = thresholds_of(mid, side, self._masker)
        units = self._masker.units(thresholds[:, 1:], thresholds[:, :-1])[..., : self._bands]
        return np.repeat(units.astype(np.float32), self._widths, axis=2)

    def need(self, clean: HostSpectra) -> float:
        """Level that the superframe needs in a coder short of bits, see `coder_demand`."""
        unit = self._units(clean[0], clean[0][:0])[0]
        coded = [_powers(spectra[1:]) for spectra in clean if spectra.size]
        noise = coder_noise(coded, self._masker, self._profile.coder_bits)
        return needed_level(noise, unit, self._masker, self._layout.cells, self._profile)

    def _wanted(
        self, sound: NDArray[np.float64], payload: tuple[bytes, bytes]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Soft values that data cells and pilots are to have, 0 where nothing is written."""
        open_frames = ~pre_echoing(sound)[:, np.newaxis]
        data = self._layout.spread(1.0 - 2.0 * self._link.encode(*payload))
        return (open_frames * data).astype(np.float32), open_frames * self._announced

    def _change(
        self,
        coefficients: NDArray[np.float32],
        unit: NDArray[np.float32],
        wanted: NDArray[np.float32],
        announced: NDArray[np.float32],
        level: float,
    ) -> tuple[NDArray[np.float32], float]:
        """Change of the coefficients, and the share of the data cells that can carry."""
        nearest, share = nearest_level(level), share_of(level)
        data, living = mark_change(
            coefficients,
            unit,
            self._layout.cells,
            wanted,
            step=self._profile.step(nearest),
            alpha=self._alpha * share,
        )
        pilots, _ = mark_change(
            coefficients,
            unit,
            self._pilots.cells,
            announced,
            step=self._profile.pilot_step(nearest),
            alpha=self._pilot_alpha * share,
        )
        return data + pilots, living


def _powers(spectra: NDArray[np.complex64]) -> NDArray[np.float32]:
    """Return the expected power of the MDCT coefficients."""
    return np.asarray((spectra.real**2 + spectra.imag**2) / 2)


def pre_echoing(sound: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which frames would spread their mark over the stillness before an attack.

    The mask of a frame follows its loudest part, its mark has the whole frame's length.

    Parameters
    ----------
    sound : ndarray of float64, shape (n * HOP,)
        The frames, and `HOP` samples before them.

    Returns
    -------
    ndarray of bool, shape (n - 2,)
        For each frame.
    """
    power = np.diff(sound, prepend=sound[0]) ** 2
    power = power.reshape(-1, ATTACK_BLOCK).mean(axis=1)
    around = np.concatenate([np.full(ATTACK_BEFORE, np.inf), power])
    before = np.maximum.reduce([around[i : i + power.size] for i in range(ATTACK_BEFORE)])
    attacks = np.flatnonzero(power > ATTACK * np.maximum(before, ATTACK_LEAST)) * ATTACK_BLOCK
    start = HOP * np.arange(1, sound.size // HOP - 1)[:, np.newaxis]
    quiet = (attacks - start >= ATTACK_BLOCK) & (attacks - start < 2 * HOP)
    return np.asarray(quiet.any(axis=1))
