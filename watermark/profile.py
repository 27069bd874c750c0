"""Constants of the audio carrier, gathered in one frozen value per profile.

Implements spec/audio-carrier.md sections 1 and 2. A profile says where the mark lies (frames, bins,
cells), how strongly it is written (step, distortion compensation) and how many bytes of each class
a superframe carries. Embedder and receiver are handed the same profile; nothing is module state.
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


@dataclass(frozen=True, slots=True)
class Profile:
    """One way to trade rate against robustness.

    Attributes
    ----------
    name : str
        What the receiver reports.
    number : int
        What the pilot announces, 0 to 3.
    l0_bytes, l1_bytes : int
        Payload of the two protection classes per superframe.
    l0_coded : int
        Coded bits of the first class; the second class takes all other data cells.
    first_bin, last_bin : int
        Half-open range of transform bins (50 Hz each) that carry cells.
    cell_bins : int
        Bins of one cell, the spreading L.
    pilot_groups : int
        Number of lowest cell positions of a frame among which pilots are placed.
    pilots_per_frame : int
        Pilot cells of each frame.
    step : float
        Quantiser step of a projection in units of the mask's amplitude.
    alpha : float
        Part of the quantisation error that the embedder removes, 0 to 1 (Costa's parameter).
    """

    name: str
    number: int
    l0_bytes: int
    l1_bytes: int
    l0_coded: int
    first_bin: int
    last_bin: int
    cell_bins: int
    pilot_groups: int
    pilots_per_frame: int
    step: float
    alpha: float

    def __post_init__(self) -> None:
        if not 0 < self.first_bin < self.last_bin <= HOP:
            raise CueError(f"bins {self.first_bin}..{self.last_bin} are not within 1..{HOP}")
        if not 0 < self.l0_coded < self.data_cells:
            raise CueError(f"{self.l0_coded} coded bits of L0, limit {self.data_cells - 1}")

    @property
    def groups(self) -> int:
        """Cells of one frame."""
        return (self.last_bin - self.first_bin) // self.cell_bins

    @property
    def cells(self) -> int:
        """Cells of one superframe, pilots included."""
        return self.groups * FRAMES_PER_SUPERFRAME

    @property
    def data_cells(self) -> int:
        """Cells of one superframe that carry coded bits."""
        return (self.groups - self.pilots_per_frame) * FRAMES_PER_SUPERFRAME

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


STANDARD = Profile(
    name="standard",
    number=1,
    l0_bytes=17,
    l1_bytes=10,
    l0_coded=1152,
    first_bin=6,
    last_bin=238,
    cell_bins=8,
    pilot_groups=6,
    pilots_per_frame=2,
    step=9.0,
    alpha=0.8,
)

PROFILES: dict[str, Profile] = {profile.name: profile for profile in (STANDARD,)}
"""Profiles by name."""


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
