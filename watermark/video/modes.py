"""The possible modes of a superframe, and the one that its pilots show.

A mode is a profile, either as it usually is or as in the first superframe of a programme, which
some profiles write with a wider step. Specification: spec/video-carrier.md, sections 1 and 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.link.link import Link
from watermark.video.demodulate import pilot_waves
from watermark.video.layout import VideoLayout, make_layout
from watermark.video.profile import PILOTS, PROFILES, VideoProfile

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Mode:
    """One way of writing a superframe.

    Attributes
    ----------
    profile : VideoProfile
        Sizes and codes.
    link : Link
        The profile's.
    layout : VideoLayout
        Its pilots give the mode.
    step : float
        Step of the fine lattice in luma of 8 bits.
    """

    profile: VideoProfile
    link: Link
    layout: VideoLayout
    step: float


def make_modes(profile: VideoProfile, key: int, strength: float) -> tuple[Mode, ...]:
    """Modes of a profile: the usual one, and that of the first superframe if it is another one.

    Examples
    --------
    >>> [mode.step for mode in make_modes(PROFILES["standard"], 0, 2.0)]
    [4.7]
    """
    link = Link(profile)
    usual = Mode(profile, link, make_layout(profile, key), strength * profile.step)
    if not profile.opening_step:
        return (usual,)
    layout = make_layout(profile, key, opening=True)
    return usual, Mode(profile, link, layout, strength * profile.opening_step)


class PilotWatch:
    """Tells how well pilots agree with every mode of every profile.

    Parameters
    ----------
    key : int
        Secret seed.
    strength : float
        As the embedder's.

    Attributes
    ----------
    modes : tuple of Mode
    positions : ndarray of int64, shape (PILOTS,)
        Where the pilots are, in all modes.

    Examples
    --------
    >>> watch = PilotWatch()
    >>> mode = watch.modes[0]
    >>> exact = mode.step * (mode.layout.dither[watch.positions] + mode.layout.pilot_bits / 2)
    >>> agreement = watch.agreement(exact, np.zeros(PILOTS))
    >>> int(agreement.argmax()), round(float(agreement[0]), 6)
    (0, 1.0)
    """

    def __init__(self, key: int = 0, strength: float = 1.0) -> None:
        self.modes = tuple(
            mode for profile in PROFILES.values() for mode in make_modes(profile, key, strength)
        )
        layout = self.modes[0].layout
        self.positions = layout.pilots
        self._dither = layout.dither[layout.pilots]
        # Modes of the same lattices share the waves, which cost most.
        kinds = [(mode.step, mode.profile.textured) for mode in self.modes]
        lattices = sorted(set(kinds))
        self._steps = np.array([[step] for step, _ in lattices])
        self._textured = np.array([[float(textured)] for _, textured in lattices])
        self._lattice = [lattices.index(kind) for kind in kinds]
        self._signs = np.stack([1.0 - 2.0 * mode.layout.pilot_bits for mode in self.modes])

    def agreement(self, mean: FloatArray, coarse: FloatArray) -> FloatArray:
        """Agreement with each mode, 0 (noise) to 1, shape (modes,).

        Parameters
        ----------
        mean : ndarray of float64, shape (PILOTS,)
            Mean amplitudes of the pilots in luma of 8 bits.
        coarse : ndarray of float64, shape (PILOTS,)
            Probability of the coarse step in profiles that have one.
        """
        waves = pilot_waves(mean / self._steps - self._dither, self._textured * coarse)
        return np.asarray(np.abs((self._signs * waves[self._lattice]).sum(axis=1)) / PILOTS)
