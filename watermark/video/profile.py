"""Constants of the video carrier, gathered in one frozen value per profile.

Specification: spec/video-carrier.md, sections 1 and 2.
"""

from dataclasses import dataclass

from codec.errors import CueError
from watermark.audio.signal.profile import STANDARD
from watermark.link.superframe import SUPERFRAME_S, find_named

ROWS, COLUMNS = 45, 80
"""Cells of the picture, whatever its size."""

TEMPLATES = 2
"""Templates of each cell: left against right and top against bottom."""

POSITIONS = TEMPLATES * ROWS * COLUMNS
"""Values that one superframe modulates, pilots included."""

PILOTS = 320
"""Cells of known sign in a picture."""

DATA = POSITIONS - PILOTS

STEPS = (2.0, 2.8, 4.0)
"""Fine steps in luma of 8 bits among which an embedder chooses for each superframe."""

COARSE = 3
"""Step of a textured cell in fine steps: odd, so that a coarse lattice lies within the fine one of
the same bit."""

TEXTURE = 2.0
"""Least texture in luma of 8 bits of a cell with the coarse step."""

PILOT_STEP = 2.8
"""Fine step of the pilots, whatever that of the data."""

PILOT_SPREADS = (1, 3, 5)
"""Steps of pilots in fine ones: in flat cells, in textured ones, in strongly textured ones. Where
the picture moves or its place is not known exactly, only wide lattices are read."""

STRONG_TEXTURE = 5.0
"""Least texture in luma of 8 bits for the pilots' widest step."""

COMMON, COMMON_OF = 3, 5
"""The first ones of as many pilots in a row have bits that are the same in all modes."""

TEXTURE_EVERY = 4
"""Frames between those whose texture is measured."""

FADE = 0.25
"""Part of a superframe during which one pattern gives way to the next, half of it on each side."""

NUMBERS = 8
"""Profiles that pilots can distinguish; those of the next wider step add as many to the number."""

MIN_WIDTH, MIN_HEIGHT = 4 * COLUMNS, 4 * ROWS
"""Least picture in pixels: four by four to a cell."""


@dataclass(frozen=True, slots=True)
class VideoProfile:
    """One way to trade rate against robustness.

    Attributes
    ----------
    name : str
        Name in the receiver's reports.
    number : int
        Number that the pilots announce.
    l0_bytes, l1_bytes : int
        Payload of the two protection classes per superframe.
    l0_coded : int
        Coded bits of the first class. Its mother code is that of the audio carrier's `standard`, so
        that the ratios of both can be added.

    Examples
    --------
    >>> PROFILES["standard"].net_bps, PROFILES["standard"].l1_coded > 0
    (2000.0, True)
    """

    name: str
    number: int
    l0_bytes: int
    l1_bytes: int
    l0_coded: int

    def __post_init__(self) -> None:
        if not self.l0_mother <= self.l0_coded <= DATA:
            raise CueError(f"{self.l0_coded} coded bits of L0: must be {self.l0_mother}..{DATA}")

    @property
    def uneven(self) -> bool:
        """True: coders leave much of the mark in some cells and nothing in others."""
        return True

    @property
    def l0_mother(self) -> int:
        """Bits of the mother code of the first class."""
        return STANDARD.l0_mother

    @property
    def l1_coded(self) -> int:
        """Coded bits of the second class."""
        return DATA - self.l0_coded

    @property
    def net_bps(self) -> float:
        """Payload of both classes in bit/s."""
        return 8 * (self.l0_bytes + self.l1_bytes) / SUPERFRAME_S

    @property
    def gross_bps(self) -> float:
        """Modulated values per second, pilots included."""
        return POSITIONS / SUPERFRAME_S


PROFILES: dict[str, VideoProfile] = {
    profile.name: profile
    for profile in (
        VideoProfile("robust", 0, 20, 28, 3328),
        VideoProfile("standard", 1, 20, 140, 2560),
        VideoProfile("high", 2, 20, 300, 1280),
        VideoProfile("twin", 3, 20, 7, 4864),
    )
}
"""Profiles by name; a profile's number is its place.

`twin` carries the very superframes of the audio carrier's `standard`, to be combined with them.
"""

LONE = VideoProfile("lone", 4, 20, 0, DATA)
"""L0 in all values, which a single superframe of any profile may have instead of its own: where
little arrives, L0 does at 4 dB more noise than in `standard`. Nobody chooses it for a programme.
"""


def find_profile(name: str) -> VideoProfile:
    """Return the profile called `name`.

    Raises
    ------
    CueError
        If there is none.

    Examples
    --------
    >>> find_profile("standard").net_bps
    2000.0
    """
    return find_named(PROFILES, name, "video profile")
