"""The chain of keys, and the tags that are made with them.

A chain begins with a secret and ends with what is published; who knows a key knows all before it
in time, and none after. SHA-256 throughout (FIPS 180-4). Specification: spec/authentication.md,
section 3.
"""

import hashlib
import hmac
from collections.abc import Mapping

from codec.authentication.layout import HIDDEN_BITS, KEY_BYTES, SENT_BITS, ProofLayout, Tag

_STEP = b"cuecast-step-1"
_TAG = b"cuecast-tag-1"
_DATA = b"cuecast-data-1"
_BEGIN = b"cuecast-begin-1"

_HIDDEN = [number.to_bytes(HIDDEN_BITS // 8, "big") for number in range(1 << HIDDEN_BITS)]
"""What may be the bytes of a key that are not sent."""


class Chain:
    """One period's chain, as everybody can compute it: from later keys to earlier ones.

    Parameters
    ----------
    channel : bytes
        What all chains of a broadcaster share, 8 bytes.
    period : int
    width : int
        Of the proof fields.
    """

    def __init__(self, channel: bytes, period: int, width: int) -> None:
        self._prefix = hashlib.sha256(
            _STEP + channel + period.to_bytes(4, "big") + width.to_bytes(1, "big")
        ).digest()

    def before(self, key: bytes, steps: int = 1) -> bytes:
        """Return the key so many blocks before `key`."""
        prefix, sha256 = self._prefix, hashlib.sha256
        for _ in range(steps):
            key = sha256(prefix + key).digest()[:KEY_BYTES]
        return key

    def find(self, sent: int, known: bytes, steps: int) -> bytes | None:
        """Return the key whose sent bits these are and which leads to a known one in `steps`."""
        head, sha256 = self._prefix + sent.to_bytes(SENT_BITS // 8, "big"), hashlib.sha256
        if steps == 1:  # the usual case
            found = [h for h in _HIDDEN if sha256(head + h).digest()[:KEY_BYTES] == known]
        else:
            found = [h for h in _HIDDEN if self.before(head[-SENT_BITS // 8 :] + h, steps) == known]
        return head[-SENT_BITS // 8 :] + found[0] if found else None


def sent_bits(key: bytes) -> int:
    """Return the bits of a key that are sent.

    Examples
    --------
    >>> hex(sent_bits(bytes(range(8))))
    '0x102030405'
    """
    assert 8 * len(key) == SENT_BITS + HIDDEN_BITS
    return int.from_bytes(key, "big") >> HIDDEN_BITS


def keys_of(secret: bytes, channel: bytes, period: int, layout: ProofLayout) -> list[bytes]:
    """Return the keys of a period, first block first; only the broadcaster can.

    Parameters
    ----------
    secret : bytes
        The broadcaster's, 32 bytes.
    """
    message = _BEGIN + channel + period.to_bytes(4, "big") + layout.width.to_bytes(1, "big")
    key = hmac.digest(secret, message, "sha256")[:KEY_BYTES]
    chain, keys = Chain(channel, period, layout.width), [key]
    for _ in range(layout.blocks - 1):
        key = chain.before(key)
        keys.append(key)
    return keys[::-1]


def digest_of(superframes: Mapping[int, bytes]) -> bytes:
    """Return what tags are made of: a digest of superframes by distance before the block's end.

    Those that are not there are left out: what was never sent, and what was lost.
    """
    digest = hashlib.sha256(_DATA)
    for distance in sorted(superframes):
        data = superframes[distance]
        digest.update(distance.to_bytes(2, "big") + len(data).to_bytes(2, "big") + data)
    return digest.digest()


def tag_of(key: bytes, digest: bytes, tag: Tag) -> int:
    """Return a tag of the superframes with this digest."""
    found = hashlib.sha256(_TAG + tag.reach.to_bytes(1, "big") + key + digest).digest()
    return int.from_bytes(found[:4], "big") >> 32 - tag.bits


def agreeing(sent: int, digest: bytes, tag: Tag, told: int) -> list[bytes]:
    """Return the keys with these sent bits under which a tag agrees."""
    key = sent.to_bytes(SENT_BITS // 8, "big")
    head, sha256 = _TAG + tag.reach.to_bytes(1, "big") + key, hashlib.sha256
    first = told >> tag.bits - 8
    likely = [key + h for h in _HIDDEN if sha256(head + h + digest).digest()[0] == first]
    return [key for key in likely if tag_of(key, digest, tag) == told]
