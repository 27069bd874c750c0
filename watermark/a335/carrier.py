"""The line as a carrier of superframes: marking frames of a programme and reading them again.

In: frames of luma; out: the same frames with their first two lines replaced, and the superframes
found. Specification: spec/a335-carrier.md.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from numpy.typing import NDArray

from codec.errors import CueError
from watermark.a335.framing import (
    SHORT_PARTS,
    join_long,
    join_short,
    long_blocks,
    long_grid,
    pack_block,
    parse_short,
    read_shared,
    rooms,
    shared_blocks,
    short_block,
)
from watermark.a335.line import LINES, RUN_IN, LineSystem, check_width, line_candidates, line_values
from watermark.a335.messages import (
    EXTENDED_VP1,
    USER_PRIVATE_LONG,
    USER_PRIVATE_SHORT,
    VP1,
    Block,
    Convention,
    parse_blocks,
)
from watermark.a335.profile import DOMAIN, PROFILES, A335Profile
from watermark.a335.vp1 import Vp1, parse_vp1
from watermark.link.inputs import checked_payload
from watermark.link.superframe import SUPERFRAME_S, ReceivedSuperframe, find_named

Luma = NDArray[Any]
Source = Callable[[int], tuple[bytes, bytes]]

_SPAN = Fraction(SUPERFRAME_S).limit_denominator(1000)


class A335Embedder:
    """Write superframes into the first two lines of every frame.

    Parameters
    ----------
    width, height : int
        Pixels of the picture.
    fps : Fraction, int or float
        Frames per second; at least 8, at most 100 (64 frames a superframe).
    source : callable
        `source(k)` gives (l0, l1) of the superframe that goes on air at k * 0.64 s.
    profile : str
        "1x", "1x-high", "1x-max", or the same with 2x.
    system : LineSystem, optional
        The profile's modulation with other levels.
    depth : int
        Bits per sample.
    domain : str
        Tagging entity of the messages; both ends must agree.
    convention : "ieee" or "mpeg"
        Checksum: as on air, or as in the text of A/336.
    overwrite : bool
        Replace lines that already carry another service; by default they are left alone and the
        redundancy makes up for them.

    Raises
    ------
    CueError
        If the picture is too small or the profile unknown or not possible at this frame rate.
    """

    def __init__(
        self,
        width: int,
        height: int,
        fps: Fraction | float,
        source: Source,
        *,
        profile: str = "1x",
        system: LineSystem | None = None,
        depth: int = 8,
        domain: str = DOMAIN,
        convention: Convention = "ieee",
        overwrite: bool = False,
    ) -> None:
        check_width(width)
        if height < 2 * LINES:
            raise CueError(f"picture of height {height}: the line needs at least {2 * LINES}")
        self._shape = (height, width)
        self._profile = find_profile(profile)
        self._system = system or self._profile.system
        if self._system.bits != self._profile.system.bits:
            raise CueError(f"profile {profile} needs modulation {self._profile.system.name}")
        self._fps = frame_rate(fps)
        self._source, self._depth, self._domain = source, depth, domain
        self._convention, self._overwrite = convention, overwrite
        self._frame = 0
        self._superframe = -1
        self._block = b""
        self._long: list[Block] = []
        self.skipped = 0
        # Refuse at once a depth, or a long message that does not fit its lines.
        self._system.levels_at(depth)
        if self._profile.superframes > 1:
            rooms(self._profile, self._frames_of(0)[1], domain)
        elif self._profile.message_id == USER_PRIVATE_LONG:
            long_grid(self._profile, self._frames_of(0)[1], domain)

    @property
    def profile(self) -> A335Profile:
        """Profile in use."""
        return self._profile

    def process(self, luma: Luma) -> list[Luma]:
        """Return the next frame, alone in a list, with its first two lines marked.

        Parameters
        ----------
        luma : ndarray of uint8 or uint16, shape (height, width)
            Samples of the picture, unchanged.

        Raises
        ------
        CueError
            If the frame has another size than announced.
        """
        if luma.shape != self._shape:
            raise CueError(f"frame of shape {luma.shape}: expected {self._shape}")
        k = self._frame // (_SPAN * self._fps)
        k -= k % self._profile.superframes
        first, count = self._frames_of(k)
        if k != self._superframe:
            self._superframe = k
            self._start_message(k, count)
        part = self._frame - first
        self._frame += 1
        if not self._overwrite and is_foreign(luma, self._domain, self._depth):
            self.skipped += 1
            return [luma]
        payload = RUN_IN + self._message(k, part).pack()
        marked = luma.copy()
        marked[:LINES] = line_values(
            payload, luma.shape[1], system=self._system, depth=self._depth
        ).astype(luma.dtype)
        return [marked]

    def flush(self) -> list[Luma]:
        """Return nothing: this carrier holds no frame back."""
        return []

    def _start_message(self, k: int, count: int) -> None:
        if self._profile.superframes > 1:
            self._long = shared_blocks(
                [
                    checked_payload(self._source, k + j, self._profile)
                    for j in range(self._profile.superframes)
                ],
                self._profile,
                count=count,
                version=k // self._profile.superframes & 15,
                domain=self._domain,
                convention=self._convention,
            )
            return
        self._block = pack_block(*checked_payload(self._source, k, self._profile), self._profile)
        if self._profile.message_id == USER_PRIVATE_LONG:
            self._long = long_blocks(
                self._block,
                self._profile,
                count=count,
                version=k & 15,
                domain=self._domain,
                convention=self._convention,
            )

    def _message(self, k: int, part: int) -> Block:
        if self._profile.message_id == USER_PRIVATE_LONG:
            return self._long[part]
        return short_block(
            self._block,
            self._profile,
            superframe=k,
            part=part,
            version=(self._frame - 1) & 15,
            domain=self._domain,
            convention=self._convention,
        )

    def _frames_of(self, k: int) -> tuple[int, int]:
        """First frame of superframe k and the number of frames of its message."""
        span = _SPAN * self._fps
        first, end = -(-k * span // 1), -(-(k + self._profile.superframes) * span // 1)
        return int(first), int(end - first)


@dataclass(slots=True)
class _Collection:
    """Parts of one superframe while they come in."""

    profile: A335Profile
    tag: tuple[int, int]
    first_part: int
    started: int
    last: int
    parts: dict[int, bytes] = field(default_factory=dict)
    done: bool = False
    given: set[int] = field(default_factory=set)


class A335Receiver:
    """Find superframes in the first line of a programme's frames.

    Parameters
    ----------
    width, height : int
        Pixels of the picture.
    fps : Fraction, int or float
        Frames per second.
    depth : int
        Bits per sample.
    domain : str
        Tagging entity of the messages.

    Attributes
    ----------
    frames, marked : int
        Frames seen, and those with a block whose checksum was right.
    first_lock_s : float or None
        When the first superframe was complete.
    vp1 : Vp1 or None
        The last VP1 message found beside ours.
    """

    def __init__(
        self,
        width: int,
        height: int,
        fps: Fraction | float,
        *,
        depth: int = 8,
        domain: str = DOMAIN,
    ) -> None:
        check_width(width)
        self._shape = (height, width)
        self._fps = frame_rate(fps)
        self._depth, self._domain = depth, domain
        self._open: _Collection | None = None
        self._recent: deque[bool] = deque(maxlen=round(2 * self._fps))
        self.frames = self.marked = 0
        self.first_lock_s: float | None = None
        self.vp1: Vp1 | None = None
        self.profile: A335Profile | None = None

    @property
    def locked(self) -> bool:
        """Whether a frame of the last two seconds was marked."""
        return any(self._recent)

    def process(self, luma: Luma) -> list[ReceivedSuperframe]:
        """Read the next frame; return the superframes that became complete.

        Raises
        ------
        CueError
            If the frame has another size than announced.
        """
        if luma.shape != self._shape:
            raise CueError(f"frame of shape {luma.shape}: expected {self._shape}")
        blocks = read_blocks(luma, self._depth)
        found: list[ReceivedSuperframe] = []
        ours = False
        for system, block in blocks:
            if block.message_id in (VP1, EXTENDED_VP1):
                self.vp1 = _vp1_or(block, self.vp1)
            part = self._part(system, block)
            if part is not None:
                ours = True
                found += self._add(*part)
        self.marked += ours
        self._recent.append(ours)
        self.frames += 1
        return found

    def _part(
        self, system: LineSystem, block: Block
    ) -> tuple[A335Profile, tuple[int, int], int, bytes] | None:
        """Profile, tag of the superframe, part number and data of one of our blocks."""
        frames = block.last_fragment + 1
        known = PROFILES.values()
        profile = next(
            (p for p in known if p.fills(system, block.message_id, frames, float(self._fps))), None
        )
        if profile is None:
            return None
        if block.message_id == USER_PRIVATE_SHORT:
            parsed = parse_short(block, self._domain)
            return None if parsed is None else (profile, (parsed[0], 0), parsed[1], parsed[2])
        return profile, (block.version, block.last_fragment + 1), block.fragment, block.body

    def _add(
        self, profile: A335Profile, tag: tuple[int, int], part: int, data: bytes
    ) -> list[ReceivedSuperframe]:
        current = self._open
        # A part of another message, or one too late to belong to this, begins a new collection.
        if (
            current is None
            or (current.profile, current.tag) != (profile, tag)
            or self.frames - current.last > _SPAN * self._fps * profile.superframes
        ):
            current = _Collection(profile, tag, part, self.frames, self.frames)
            self._open = current
        current.last = self.frames
        current.parts[part] = data
        # Messages that share several superframes deliver them one by one.
        if profile.superframes > 1:
            return self._shared(current)
        if current.done:
            return []
        if profile.message_id == USER_PRIVATE_LONG:
            classes = join_long(current.parts, profile, count=tag[1], domain=self._domain)
        else:
            classes = join_short(current.parts, profile)
        if classes is None:
            return []
        current.done = True
        return [self._found(current, classes, 0)]

    def _shared(self, current: _Collection) -> list[ReceivedSuperframe]:
        """Superframes of a message of several that the last fragment completed."""
        found = []
        for number in range(current.profile.superframes):
            if number not in current.given:
                classes = read_shared(
                    current.parts,
                    current.profile,
                    count=current.tag[1],
                    number=number,
                    domain=self._domain,
                )
                if classes is not None:
                    current.given.add(number)
                    found.append(self._found(current, classes, number))
        return found

    def _found(
        self, current: _Collection, classes: tuple[bytes, bytes], number: int
    ) -> ReceivedSuperframe:
        self.profile = current.profile
        if self.first_lock_s is None:
            self.first_lock_s = float((self.frames + 1) / self._fps)
        position_s = float((current.started - current.first_part) / self._fps + number * _SPAN)
        confidence = len(current.parts) / (self.frames - current.started + 1)
        return ReceivedSuperframe(*classes, position_s, min(1.0, confidence))


def frame_rate(fps: Fraction | float) -> Fraction:
    """Exact frame rate; 23.976, 29.97 and 59.94 become multiples of 1000/1001.

    Raises
    ------
    CueError
        If it is not between 8 and 100 frames per second.

    Examples
    --------
    >>> frame_rate(29.97)
    Fraction(30000, 1001)
    """
    rate = Fraction(fps).limit_denominator(1001)
    if abs(rate * 1001 / 1000 - round(rate * 1001 / 1000)) < Fraction(1, 500) and rate % 1:
        rate = Fraction(round(rate * 1001 / 1000) * 1000, 1001)
    if not 8 <= rate <= SHORT_PARTS / SUPERFRAME_S:
        raise CueError(f"{float(fps):g} frames per second: must be 8..100")
    return rate


def find_profile(name: str) -> A335Profile:
    """Profile of that name.

    Raises
    ------
    CueError
        If there is none.
    """
    return find_named(PROFILES, name, "A/335 profile")


def read_blocks(luma: Luma, depth: int = 8) -> list[tuple[LineSystem, Block]]:
    """Read the message blocks of a frame: from its first line, else from both or the second."""
    for line in (luma[0], luma[:LINES].mean(axis=0), luma[1]):
        for system, payload in line_candidates(line, depth=depth):
            if blocks := parse_blocks(payload):
                return [(system, block) for block in blocks]
    return []


def is_foreign(luma: Luma, domain: str, depth: int = 8) -> bool:
    """Whether the line carries messages that are not ours."""
    return any(not _is_ours(block, domain) for _, block in read_blocks(luma, depth))


def _is_ours(block: Block, domain: str) -> bool:
    if block.message_id == USER_PRIVATE_SHORT:
        return parse_short(block, domain) is not None
    if block.message_id == USER_PRIVATE_LONG:
        name = bytes([len(domain) - 1]) + domain.encode("ascii")
        return block.fragment > 0 or block.body.startswith(name)
    return False


def _vp1_or(block: Block, previous: Vp1 | None) -> Vp1 | None:
    return parse_vp1(block) or previous
