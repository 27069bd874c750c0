"""How superframes ride in the line: which modulation, which message form, how many bytes.

Specification: spec/a335-carrier.md, section 3. The profile follows from the line itself
(run-in and message identifier), so nothing needs to be announced.
"""

from dataclasses import dataclass

from watermark.a335.line import SYSTEM_1X, SYSTEM_2X, LineSystem
from watermark.a335.messages import (
    USER_PRIVATE_LONG,
    USER_PRIVATE_SHORT,
    body_capacity,
    private_overhead,
)
from watermark.link.superframe import SUPERFRAME_S

CHECK_BYTES = 4
"""Bytes of the CRC-32 that both classes of a superframe share."""

DOMAIN = "cue.tv,2026"
"""Tagging entity of the messages; a broadcaster puts a name of its own here."""


@dataclass(frozen=True, slots=True)
class A335Profile:
    """One way to fill the line.

    Attributes
    ----------
    name : str
        What `find_profile` is asked for.
    system : LineSystem
        Modulation.
    message_id : int
        0x7F: every frame is a message of its own: a receiver can start at any frame.
        0xFF: one message of as many fragments as the superframe has frames; more bytes.
    l0_bytes, l1_bytes : int
        Payload of the two classes per superframe.
    superframes : int
        Superframes of one message. Several share its overhead and have no redundancy.
    """

    name: str
    system: LineSystem
    message_id: int
    l0_bytes: int
    l1_bytes: int
    superframes: int = 1

    @property
    def block_bytes(self) -> int:
        """Bytes that the erasure code protects: both classes and a checksum."""
        return self.l0_bytes + self.l1_bytes + CHECK_BYTES

    @property
    def body_bytes(self) -> int:
        """Message bytes of one frame's line."""
        return body_capacity(self.system, self.message_id)

    @property
    def net_bps(self) -> float:
        """Payload of both classes in bit/s."""
        return 8 * (self.l0_bytes + self.l1_bytes) / SUPERFRAME_S

    def fills(self, system: LineSystem, message_id: int, frames: int, fps: float) -> bool:
        """Whether a message of `frames` frames, as seen on air, is one of this profile."""
        if (self.system.name, self.message_id) != (system.name, message_id):
            return False
        several = frames > 2 * SUPERFRAME_S * fps
        return message_id == USER_PRIVATE_SHORT or several == (self.superframes > 1)

    def overhead(self, domain: str) -> int:
        """Bytes of a message before its payload."""
        return private_overhead(domain, self.message_id)


PROFILES = {
    profile.name: profile
    for profile in (
        A335Profile("1x", SYSTEM_1X, USER_PRIVATE_SHORT, 20, 39),
        A335Profile("1x-high", SYSTEM_1X, USER_PRIVATE_LONG, 20, 220),
        A335Profile("1x-max", SYSTEM_1X, USER_PRIVATE_LONG, 20, 279, superframes=4),
        A335Profile("2x", SYSTEM_2X, USER_PRIVATE_SHORT, 20, 309),
        A335Profile("2x-high", SYSTEM_2X, USER_PRIVATE_LONG, 20, 640),
        A335Profile("2x-max", SYSTEM_2X, USER_PRIVATE_LONG, 20, 759, superframes=4),
    )
}
