"""VP1 messages found in a line: the content of the broadcaster's own mark.

In: the body of a vp1_message or extended_vp1_message block; out: its fields. ATSC A/334:2022
section 5 and A/336 section 5.4; checked against a frame recorded off air.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.errors import BitstreamError
from watermark.a335 import bch
from watermark.a335.messages import EXTENDED_VP1, VP1, Block

_PACKET_BITS = bch.N + 1  # one zero bit of padding
_WHITENING = {
    VP1: (
        "11100110111111111011011010111101100100010000100101110000100100000001101100101",
        "00100001000010100011000000001011100000011100110111",
    ),
    EXTENDED_VP1: (
        "00111001110010100111100011110000011100101001100100011011110100100010011111000",
        "11001001110100011101011100010010011001110101101100",
    ),
}


@dataclass(frozen=True, slots=True)
class Vp1:
    """A VP1 payload.

    Attributes
    ----------
    large_domain : bool
        True: 23 bits of server and 25 of interval; False: 31 and 17.
    server, interval : int
        Codes of the recovery server and of the interval, which advances every 1.5 s.
    query : bool
        A new dynamic event is waiting at the server.
    time_offset : int or None
        1/30 s units of an extended message.
    corrected_bits : int
        Wrong bits that the code put right.
    """

    large_domain: bool
    server: int
    interval: int
    query: bool
    time_offset: int | None
    corrected_bits: int


def parse_vp1(block: Block) -> Vp1 | None:
    """Decode the VP1 packet of a block.

    Returns
    -------
    Vp1 or None
        None where too many bits are wrong.

    Raises
    ------
    BitstreamError
        If the block is no VP1 message or has a wrong length.
    """
    if block.message_id not in _WHITENING:
        raise BitstreamError(
            f"message {block.message_id:#04x} is no VP1 message", section="ATSC A/336 5.4"
        )
    lead = 1 if block.message_id == EXTENDED_VP1 else 0
    expected = lead + 4 + _PACKET_BITS // 8
    if len(block.body) != expected:
        raise BitstreamError(
            f"VP1 message of {len(block.body)} bytes: must be {expected}", section="ATSC A/336 5.4"
        )
    # Packet = BCH codeword xor whitening sequence of the message's kind.
    packet = np.unpackbits(np.frombuffer(block.body[lead + 4 :], dtype=np.uint8))[: bch.N]
    found = bch.decode(packet ^ _whitening(block.message_id))
    if found is None:
        return None
    bits, corrected = found
    large = bool(bits[0])
    server_bits = 23 if large else 31
    return Vp1(
        large_domain=large,
        server=_number(bits[1 : 1 + server_bits]),
        interval=_number(bits[1 + server_bits : 49]),
        query=bool(bits[49]),
        time_offset=block.body[0] if lead else None,
        corrected_bits=corrected,
    )


def _whitening(message_id: int) -> NDArray[np.int64]:
    return np.array([int(b) for part in _WHITENING[message_id] for b in part], dtype=np.int64)


def _number(bits: NDArray[np.int64]) -> int:
    return int("".join(map(str, bits)), 2)
