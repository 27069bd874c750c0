"""Constants of the audio carrier, gathered in one frozen value per profile.

Implements spec/audio-carrier.md sections 1, 2 and 8. A profile says where the mark lies (frames,
bins, cells), how it is written and how many bytes of each class a superframe carries. Embedder and
receiver are handed the same profile; nothing is module state.
"""

from dataclasses import dataclass

from codec.errors import CueError

FS = 48_000
"""Rate in Hz at which the mark is defined; other rates are converted to it."""

HOP = 480
"""Samples between frames of the lapped transform: 10 ms."""

FRAMES_PER_SUPERFRAME = 64
"""Frames of one superframe: 0.64 s."""

SUPERFRAME = FRAMES_PER_SUPERFRAME * HOP
"""Samples of one superframe at `FS`."""

SUPERFRAME_S = SUPERFRAME / FS
"""Duration of a superframe in seconds."""

SLOT_FRAMES = 8
"""Frames of one slot: 0.08 s, the unit that a channel may lose."""

FIRST_BIN = 6
"""Lowest bin that carries a cell: 300 Hz; a bin is 50 Hz wide."""

PILOT_GROUPS = 6
"""Lowest cell positions of a frame, alike in all profiles; the pilots are among them."""

PILOT_BINS = 8
"""Bins of a cell at these positions."""

PILOTS_PER_FRAME = 2
"""Pilot cells of each frame: the first is alike in all profiles, the second announces one."""

LEVELS = tuple(4.0 * 2 ** (level / 4) for level in range(12))
"""Quantiser steps in units of the mask's amplitude, 1.5 dB apart, from which the embedder chooses
for each superframe. The receiver finds out; a change of gain looks like a change of level."""

TIER_LEVELS = 4
"""Levels that share one step of the pilots."""

PILOT_STEPS = tuple(4.0 * 2 ** ((4 * tier + 1.5) / 4) for tier in range(3))
"""Quantiser step of the pilots in each tier of levels."""


@dataclass(frozen=True, slots=True)
class Profile:
    """One way to trade rate against robustness.

    Attributes
    ----------
    name : str
        What the receiver reports.
    number : int
        What the pilots announce.
    l0_bytes, l1_bytes : int
        Payload of the two protection classes per superframe; L1 may be absent.
    l0_coded : int
        Coded bits of the first class; the second class takes all other data cells.
    cell_bins : int
        Bins of a cell above the pilots' positions: the spreading.
    last_bin : int
        First bin above all cells.
    alpha : float
        Part of the quantisation error that the embedder removes, 0 to 1 (Costa's parameter).
    """

    name: str
    number: int
    l0_bytes: int
    l1_bytes: int
    l0_coded: int
    cell_bins: int
    last_bin: int
    alpha: float

    def __post_init__(self) -> None:
        if not 0 < self.l0_coded <= self.data_cells:
            raise CueError(f"{self.l0_coded} coded bits of L0, limit {self.data_cells}")
        if (self.l1_bytes > 0) != (self.l1_coded > 0):
            raise CueError(f"{self.l1_bytes} bytes of L1 in {self.l1_coded} coded bits")

    @property
    def starts(self) -> tuple[int, ...]:
        """First bin of each cell of a frame, and the first bin above the last as a final entry."""
        split = FIRST_BIN + PILOT_GROUPS * PILOT_BINS
        low = range(FIRST_BIN, split, PILOT_BINS)
        count = (self.last_bin - split) // self.cell_bins
        return (*low, *range(split, split + count * self.cell_bins + 1, self.cell_bins))

    @property
    def groups(self) -> int:
        """Cells of one frame."""
        return len(self.starts) - 1

    @property
    def cells(self) -> int:
        """Cells of one superframe, pilots included."""
        return self.groups * FRAMES_PER_SUPERFRAME

    @property
    def data_cells(self) -> int:
        """Cells of one superframe that carry coded bits."""
        return (self.groups - PILOTS_PER_FRAME) * FRAMES_PER_SUPERFRAME

    @property
    def l1_coded(self) -> int:
        """Coded bits of the second class."""
        return self.data_cells - self.l0_coded

    @property
    def net_bps(self) -> float:
        """Payload of both classes in bit/s."""
        return 8 * (self.l0_bytes + self.l1_bytes) / SUPERFRAME_S

    @property
    def gross_bps(self) -> float:
        """Cells per second, pilots included."""
        return self.cells / SUPERFRAME_S


ROBUST = Profile(
    name="robust",
    number=0,
    l0_bytes=7,
    l1_bytes=0,
    l0_coded=1728,
    cell_bins=8,
    last_bin=238,
    alpha=0.65,
)

STANDARD = Profile(
    name="standard",
    number=1,
    l0_bytes=20,
    l1_bytes=7,
    l0_coded=1280,
    cell_bins=8,
    last_bin=238,
    alpha=0.75,
)

HIGH = Profile(
    name="high",
    number=2,
    l0_bytes=20,
    l1_bytes=32,
    l0_coded=1280,
    cell_bins=4,
    last_bin=238,
    alpha=0.85,
)

PROFILES: dict[str, Profile] = {profile.name: profile for profile in (ROBUST, STANDARD, HIGH)}
"""Profiles by name; a profile's number is its place."""


def find_profile(name: str) -> Profile:
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
    try:
        return PROFILES[name]
    except KeyError:
        known = ", ".join(PROFILES)
        raise CueError(f"unknown profile {name!r}, known: {known}") from None
