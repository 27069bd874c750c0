"""The possible modes of a superframe, and the one that its pilots show.

A mode is a profile with one of the steps. Specification: spec/video-carrier.md, sections 1 and 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.link.link import Link
from watermark.video.lattices import pilot_waves
from watermark.video.layout import VideoLayout, make_layout
from watermark.video.profile import LONE, PILOT_STEP, PILOTS, PROFILES, STEPS, VideoProfile

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
    step, pilot_step : float
        Step of the fine lattice in luma of 8 bits, of data and of pilots.
    """

    profile: VideoProfile
    link: Link
    layout: VideoLayout
    step: float
    pilot_step: float


def make_modes(profile: VideoProfile, key: int, strength: float) -> tuple[Mode, ...]:
    """Modes of a profile, one for each of `STEPS`.

    Examples
    --------
    >>> [mode.step for mode in make_modes(PROFILES["standard"], 0, 2.0)]
    [4.0, 5.6, 8.0]
    """
    link = Link(profile)
    return tuple(
        Mode(profile, link, make_layout(profile, key, rung), strength * step, strength * PILOT_STEP)
        for rung, step in enumerate(STEPS)
    )


class PilotWatch:
    """Tells how well pilots agree with every mode of every profile, `LONE` included.

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
    >>> exact = mode.layout.dither[watch.positions] + mode.layout.pilot_bits / 2
    >>> agreement = watch.agreement(mode.pilot_step * exact, np.zeros(PILOTS))
    >>> int(agreement.argmax()), round(float(agreement[0]), 6)
    (0, 1.0)
    """

    def __init__(self, key: int = 0, strength: float = 1.0) -> None:
        self.modes = tuple(
            mode
            for profile in (*PROFILES.values(), LONE)
            for mode in make_modes(profile, key, strength)
        )
        layout = self.modes[0].layout
        self.positions = layout.pilots
        self._dither = layout.dither[layout.pilots]
        self._step = self.modes[0].pilot_step
        self._signs = np.stack([1.0 - 2.0 * mode.layout.pilot_bits for mode in self.modes])

    def agreement(self, mean: FloatArray, texture: FloatArray) -> FloatArray:
        """Agreement with each mode, 0 (noise) to 1, shape (modes,).

        Parameters
        ----------
        mean : ndarray of float64, shape (PILOTS,)
            Mean amplitudes of the pilots in luma of 8 bits.
        texture : ndarray of float64, shape (PILOTS,)
            Textures of their cells in luma of 8 bits.
        """
        return np.abs(self.signed_agreement(mean, texture))

    def signed_agreement(self, mean: FloatArray, texture: FloatArray) -> FloatArray:
        """Agreement with each mode as in `agreement`, below 0 for odd superframes."""
        waves = pilot_waves(mean / self._step - self._dither, texture)
        return np.asarray(self._signs @ waves / PILOTS)
