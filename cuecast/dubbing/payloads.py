"""Payloads of superframes: motion in, the bytes that a carrier sends out.

A superframe is coded and sent before its motion is due, so that a receiver has it in time.
"""

from collections.abc import Callable

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.filmed_encoder import LIVE_TURNS, TURNS
from codec.superframe.payload import nest
from codec.superframe.window import MAX_BYTES
from cuecast.dubbing.motions import RATE_HZ, MotionSource
from cuecast.dubbing.signing import Signing
from watermark.audio.signal.profile import STANDARD, AudioProfile
from watermark.link.superframe import SUPERFRAME_S

LEAD = 2
"""A superframe is on air this many superframes before its motion is due."""

FRAMES = 32
"""Frames of motion in a superframe."""

assert FRAMES / RATE_HZ == SUPERFRAME_S


def superframe_source(
    motion: MotionSource, voice: Voice, l0_bytes: int, l1_bytes: int, *, first: int = 0,
    beside: AudioProfile = STANDARD, signing: Signing | None = None,
) -> Callable[[int], tuple[bytes, bytes]]:  # fmt: skip
    """Return the function that gives an embedder the payloads (L0, L1) of its superframe k.

    That one is on air `first` + k superframes after the programme's clock's zero. Where L1 has room
    for it, the superframe is a nested one (`codec.superframe.payload`): its L0 is that of a sound
    with the profile `beside`. With `signing` its L0 is signed.
    """
    source = _unsigned_source(motion, voice, l0_bytes, l1_bytes, first, beside, signing is not None)
    return source if signing is None else signing.source(source, first)


def _unsigned_source(
    motion: MotionSource,
    voice: Voice,
    l0_bytes: int,
    l1_bytes: int,
    first: int,
    beside: AudioProfile,
    signed: bool,
) -> Callable[[int], tuple[bytes, bytes]]:
    """Return the source of superframes, with room for a proof if they will be signed."""
    nests = l0_bytes == beside.l0_bytes and l1_bytes >= 2 * (beside.l0_bytes + beside.l1_bytes)
    fine_bytes = l1_bytes - l0_bytes if nests else l1_bytes
    if l0_bytes <= MAX_BYTES:
        compact = CompactEncoder(voice, l0_bytes=l0_bytes, first=first + LEAD, signed=signed)

        def compact_source(k: int) -> tuple[bytes, bytes]:
            index = first + k + LEAD
            window = motion.window(index * SUPERFRAME_S, FRAMES)
            return compact.encode(window, index).l0, b""

        return compact_source
    fine = SuperframeEncoder(
        voice, l0_bytes=l0_bytes, l1_bytes=fine_bytes, lead=LEAD, protected=True, signed=signed,
        filmed=motion.filmed, begin=first + LEAD,
    )  # fmt: skip
    coarse = SuperframeEncoder(
        voice, l0_bytes=l0_bytes, l1_bytes=beside.l1_bytes if nests else 0, lead=LEAD,
        protected=True, signed=signed, filmed=motion.filmed, begin=first + LEAD,
    )  # fmt: skip

    def source(k: int) -> tuple[bytes, bytes]:
        index = first + k + LEAD
        window = _window(motion, index)
        superframe = fine.encode(window, index)
        if not nests:
            return superframe.l0, superframe.l1
        return nest(coarse.encode(window, index).l0, superframe.l0, superframe.l1)

    return source


def _window(motion: MotionSource, index: int) -> Motion:
    """Return the motion of a superframe, and of those beside it that shape a filmed one."""
    turns = TURNS if motion.whole else LIVE_TURNS
    before = turns if motion.filmed else 0
    after = before if motion.whole else 0
    return motion.window((index - before) * SUPERFRAME_S, (before + 1 + after) * FRAMES)
