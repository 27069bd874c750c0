"""Constants of the audio carrier, gathered in one frozen value per profile.

Implements spec/audio-carrier.md sections 1, 2 and 8. A profile says where the mark lies (frames,
bins, cells), how it is written and how many bytes of each class a superframe carries. Embedder and
receiver are handed the same profile; nothing is module state.
"""

from dataclasses import dataclass

from codec.errors import CueError
from watermark.link.polar import longest_mother
from watermark.link.superframe import SUPERFRAME_S, find_named

FS = 48_000
"""Rate in Hz at which the mark is defined; other rates are converted to it."""

HOP = 480
"""Samples between frames of the lapped transform: 10 ms."""

FRAMES_PER_SUPERFRAME = 64
"""Frames of one superframe: 0.64 s."""

SUPERFRAME = FRAMES_PER_SUPERFRAME * HOP
"""Samples of one superframe at `FS`."""

assert SUPERFRAME == SUPERFRAME_S * FS


SLOT_FRAMES = 8
"""Frames of one slot: 0.08 s, the unit that a channel may lose."""

USUAL_GRADE = -0.42
"""Default grade to aim at: the loop's errors leave clips above -0.5."""

HARD_LINE_GRADE = -1.0
"""The same for coders that spoil the sound more than that themselves."""

FIRST_PILOT_BIN = 6
"""Lowest bin of the pilots: 300 Hz; a bin is 50 Hz wide."""

PILOT_SLOTS = 6
"""Lowest stretches of `PILOT_BINS` bins; the pilots take two of them in each frame."""

PILOT_BINS = 8
"""Bins of a pilot cell, in all profiles."""

PILOTS_PER_FRAME = 2
"""Pilot cells of each frame: the first is alike in all profiles, the second announces one."""

LEVELS = tuple(2.0 * 2 ** (level / 4) for level in range(2, 14))
"""Quantiser steps in units of the mask's amplitude, 1.5 dB apart; the embedder chooses one
for each superframe. The receiver finds out; a change of gain looks like a change of level."""

TIER_LEVELS = 4
"""Levels that share one step of the pilots."""

PILOT_STEPS = tuple(2.0 * 2 ** ((4 * tier + 3.5) / 4) for tier in range(4))
"""Quantiser steps of pilots; which of them goes with a level is the profile's affair."""


@dataclass(frozen=True, slots=True)
class AudioProfile:
    """One way to trade rate against robustness.

    Attributes
    ----------
    name : str
        Name in the receiver's reports.
    number : int
        Number that the pilots announce.
    l0_bytes, l1_bytes : int
        Payload of the two protection classes per superframe; L1 may be absent.
    l0_coded : int
        Coded bits of the first class; the second class takes all other data cells.
    cell_bins : int
        Bins of a data cell, the spreading: 2, 4 or 8.
    first_bin, last_bin : int
        The lowest cell begins at the first. No cell reaches beyond this bin.
    alphas : tuple of float
        Part of the quantisation error that the embedder removes in the lowest and in the highest
        cell, 0 to 1 (Costa's parameter); linear between them, and their mean in the pilots.
    strength : float
        Factor of `LEVELS` for data cells: long cells need wider steps for the same loudness.
    lowest_tier : int
        Place in `PILOT_STEPS` of the pilots' step at the lowest levels.
    coder_bits : float
        Bits per frame of 10 ms of the coder that the embedder has in mind.
    side_period : int
        In stereo, one block of `side_period` stands in left, one in right: enough for a message.
    grade : float
        Default grade to aim at; with a codec in the loop, that of passages that need it.

    Examples
    --------
    >>> STANDARD.l0_bytes, STANDARD.l1_bytes
    (20, 7)
    """

    name: str
    number: int
    l0_bytes: int
    l1_bytes: int
    l0_coded: int
    cell_bins: int
    first_bin: int
    last_bin: int
    alphas: tuple[float, float]
    strength: float
    lowest_tier: int
    coder_bits: float
    side_period: int = 4
    grade: float = USUAL_GRADE

    def __post_init__(self) -> None:
        if PILOT_BINS % self.cell_bins:
            raise CueError(f"cells of {self.cell_bins} bins do not divide {PILOT_BINS}")
        if (FIRST_PILOT_BIN - self.first_bin) % self.cell_bins:
            raise CueError(f"cells from bin {self.first_bin} on lie across pilots")
        if not 0 < self.l0_coded <= self.data_cells:
            raise CueError(f"{self.l0_coded} coded bits of L0, limit {self.data_cells}")
        if (self.l1_bytes > 0) != (self.l1_coded > 0):
            raise CueError(f"{self.l1_bytes} bytes of L1 in {self.l1_coded} coded bits")

    def step(self, level: float) -> float:
        """Quantiser step of data cells at a level; a receiver may ask between and beyond them."""
        return self.strength * 2.0 * 2 ** ((level + 2) / 4)

    def pilot_step(self, level: int) -> float:
        """Quantiser step of the pilots at a level."""
        return PILOT_STEPS[self.lowest_tier + level // TIER_LEVELS]

    def levels_of(self, tier: int) -> range:
        """Levels whose pilots have the step of a tier; none if the profile lacks it."""
        first = (tier - self.lowest_tier) * TIER_LEVELS
        return range(max(first, 0), max(min(first + TIER_LEVELS, len(LEVELS)), 0))

    @property
    def message_bits(self) -> int:
        """Bits of both classes, without their checks."""
        return 8 * (self.l0_bytes + self.l1_bytes)

    @property
    def groups(self) -> int:
        """Data cells of a frame without pilots."""
        return (self.last_bin - self.first_bin) // self.cell_bins

    @property
    def data_cells(self) -> int:
        """Cells of one superframe that carry coded bits."""
        pilots = PILOTS_PER_FRAME * PILOT_BINS // self.cell_bins
        return (self.groups - pilots) * FRAMES_PER_SUPERFRAME

    @property
    def uneven(self) -> bool:
        """False: bits are spread over values that are about equally sure."""
        return False

    @property
    def l0_mother(self) -> int:
        """Bits of the mother code of the first class."""
        return longest_mother(self.l0_coded)

    @property
    def l1_coded(self) -> int:
        """Coded bits of the second class."""
        return self.data_cells - self.l0_coded

    @property
    def net_bps(self) -> float:
        """Payload of both classes in bit/s."""
        return self.message_bits / SUPERFRAME_S

    @property
    def gross_bps(self) -> float:
        """Coded bits per second."""
        return self.data_cells / SUPERFRAME_S


ROBUST = AudioProfile(
    name="robust",
    number=0,
    l0_bytes=7,
    l1_bytes=0,
    l0_coded=1344,
    cell_bins=4,
    first_bin=2,
    last_bin=102,
    alphas=(0.65, 0.35),
    strength=1.75,
    lowest_tier=1,
    coder_bits=350.0,
    grade=HARD_LINE_GRADE,
)

STANDARD = AudioProfile(
    name="standard",
    number=1,
    l0_bytes=20,
    l1_bytes=7,
    l0_coded=1536,
    cell_bins=4,
    first_bin=6,
    last_bin=158,
    alphas=(0.6, 0.6),
    strength=1.0,
    lowest_tier=0,
    coder_bits=500.0,
)

HIGH = AudioProfile(
    name="high",
    number=2,
    l0_bytes=20,
    l1_bytes=36,
    l0_coded=2816,
    cell_bins=2,
    first_bin=6,
    last_bin=238,
    alphas=(0.65, 0.65),
    strength=0.75,
    lowest_tier=0,
    coder_bits=500.0,
    side_period=8,
)

DISCREET = AudioProfile(
    name="discreet",
    number=3,
    l0_bytes=12,
    l1_bytes=0,
    l0_coded=1856,
    cell_bins=4,
    first_bin=2,
    last_bin=134,
    alphas=(0.6, 0.6),
    strength=1.0,
    lowest_tier=0,
    coder_bits=500.0,
)

PROFILES: dict[str, AudioProfile] = {
    profile.name: profile for profile in (ROBUST, STANDARD, HIGH, DISCREET)
}
"""Profiles by name; a profile's number is its place."""


def find_profile(name: str) -> AudioProfile:
    """Return the profile called `name`.

    Raises
    ------
    CueError
        If there is none.

    Examples
    --------
    >>> find_profile("standard").net_bps
    337.5
    """
    return find_named(PROFILES, name, "profile")
