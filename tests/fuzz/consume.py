"""What the fuzzer does with bytes: superframes and stream files, decoded whatever they are.

Any exception but the errors that the codec promises is a finding, and so are parameters that are
not finite.
"""

import contextlib

import numpy as np

from codec.cuer.voice import Voice, load_voice
from codec.cues.timeline import TICKS
from codec.errors import BitstreamError, VoiceError
from codec.streamfile.inspect import inspect_stream
from codec.superframe.bits import COMPACT, HEADER_BYTES, crc8, identity_bits
from codec.superframe.checks import with_check
from codec.superframe.coding import coding_for
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.superframe import merge_scores

_VOICE: list[Voice] = []
_RENDERED = 8
"""One input of so many has its lost superframes rendered."""


def _parts(data: bytes, identity: str, index: int) -> tuple[bytes, bytes]:
    """Return parts with a valid version, number, voice and checks, for the rest to be read."""
    mode, size = data[0] % 3, data[1] % 64
    body, more = data[2 : 2 + size], data[2 + size :][:64]
    if mode == COMPACT:
        signed = data[0] & 0x10
        last = (body[-1:] or b"\0")[0] & (0xF3 if signed else 0xFC)
        last |= identity_bits(identity, index) << (2 if signed else 0)
        return bytes([0x20 | signed | index % 16]) + body[:-1] + bytes([last]), b""
    fields = mode << 12 | index % 64 << 6 | 2 << 4 | data[0] >> 4
    l0 = with_check(fields.to_bytes(HEADER_BYTES, "big") + body, identity)
    return l0, more + bytes([crc8(l0[-2:] + more)])


def consume(data: bytes) -> None:
    """Decode what some bytes say, as superframes that follow one another and as a file."""
    if not _VOICE:
        _VOICE.append(load_voice())
    voice = _VOICE[0]
    with contextlib.suppress(BitstreamError):
        inspect_stream(data)
    decoder, done, index, rest = SuperframeDecoder(voice), [], 3, data
    while len(rest) > 2 and index < 8:
        l0, l1 = _parts(rest, coding_for(voice).identity, index)
        rest = rest[2 + rest[1] % 64 + 64 :]
        with contextlib.suppress(BitstreamError, VoiceError):
            done.append(decoder.push(l0, l1, index))
        index += 1 + len(rest) % 2
    # What was lost costs most to render and depends least on bytes.
    lost = range(3, index + 1) if sum(data) % _RENDERED == 0 else ()
    for frame in [*done, *(decoder.render(k) for k in lost)]:
        assert frame.params.shape == (TICKS, len(voice.layout))
        assert np.isfinite(frame.params).all()
    merge_scores(done)
