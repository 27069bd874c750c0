"""Messages from the receiver to its page over the WebSocket, and the page's answers.

Motion travels as one binary message per piece, everything else as small JSON documents; the page's
side is ``page/feed.js``. Layout of a motion message, little endian::

    kind u8 = 1 | layers u8 | count u16 | width u16 | epoch u16 | start_s f64 | rate_hz f32
    count x width f32

Bits of `layers`: 0 = L0, 1 = L1, 7 = concealed (neither arrived).
"""

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from codec.errors import CueError
from receiver.reception.events import (
    AuthenticityChanged,
    Event,
    KeysFound,
    MotionPiece,
    StateChanged,
    SuperframeLost,
    Unreadable,
)

_HEADER = struct.Struct("<BBHHHdf")

_MOTION = 1
"""First byte of a message that holds motion."""

_LAYER_BITS = {"L0": 1, "L1": 2}

_CONCEALED_BIT = 0x80
"""Bit that stands where no layer arrived."""

MAX_REQUEST_BYTES = 256
"""Characters of a page's message at most."""

_MAX_TIME_S = 1e7
"""Latest position in seconds: four months."""

assert _HEADER.size == 20


def pack_motion(piece: MotionPiece) -> bytes:
    """Return the binary message of a piece of motion.

    Examples
    --------
    >>> piece = MotionPiece(1.28, 50.0, np.zeros((32, 31), np.float32), ("L0",))
    >>> len(pack_motion(piece)) == 20 + 4 * 32 * 31
    True
    """
    count, width = piece.params.shape
    bits = sum(_LAYER_BITS[name] for name in piece.layers) or _CONCEALED_BIT
    header = _HEADER.pack(
        _MOTION, bits, count, width, piece.epoch & 0xFFFF, piece.start_s, piece.rate_hz
    )
    return header + np.ascontiguousarray(piece.params, dtype="<f4").tobytes()


def pack_event(event: Event) -> str | bytes:
    """Return the message that sends `event` to the page: bytes for motion, text for the rest."""
    match event:
        case MotionPiece():
            return pack_motion(event)
        case StateChanged(time_s, state):
            return json.dumps({"type": "status", "state": state, "time_s": time_s})
        case KeysFound(keys):
            return json.dumps({"type": "keys", "keys": [key.as_dict() for key in keys]})
        case SuperframeLost(start_s, count):
            return json.dumps({"type": "lost", "time_s": start_s, "count": count})
        case Unreadable(time_s, message):
            return json.dumps({"type": "unreadable", "time_s": time_s, "message": message})
        case AuthenticityChanged(time_s, status, of, reason, age_s):
            told = {"type": "authenticity", "time_s": time_s, "status": status, "of": of}
            return json.dumps(told | {"reason": reason, "age_s": age_s})


def pack_heard(from_s: float, until_s: float) -> str:
    """Return the message that states which stretch of the programme was received, in seconds.

    Examples
    --------
    >>> pack_heard(0.0, 4.5)
    '{"type": "heard", "from_s": 0.0, "until_s": 4.5}'
    """
    return json.dumps({"type": "heard", "from_s": from_s, "until_s": round(until_s, 3)})


@dataclass(frozen=True, slots=True)
class Position:
    """Where a viewer is.

    Attributes
    ----------
    time_s : float
        On the programme's clock.
    jumped : bool
        The page knows no motion there: reception has to go there.
    """

    time_s: float
    jumped: bool


def parse_position(text: str) -> Position:
    """Read a page's message.

    Raises
    ------
    CueError
        If it is not a position within the limits.

    Examples
    --------
    >>> parse_position('{"type": "position", "time_s": 4.5, "jumped": false}')
    Position(time_s=4.5, jumped=False)
    """
    if len(text) > MAX_REQUEST_BYTES:
        raise CueError(f"message of {len(text)} characters is longer than {MAX_REQUEST_BYTES}")
    try:
        document: Any = json.loads(text)
        time_s = float(document["time_s"])
        known = document["type"] == "position"
        jumped = document.get("jumped", False) is True
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise CueError(f"malformed message {text[:40]!r}") from error
    if not known or not 0 <= time_s <= _MAX_TIME_S:
        raise CueError(f"message {text[:40]!r} is not a position within 0..{_MAX_TIME_S:g} s")
    return Position(time_s, jumped)
