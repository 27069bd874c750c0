"""The chain of keys, and the tags that are made with them.

A chain begins with a secret and ends with what is published; who knows a key knows all before it
in time, and none after. SHA-256 throughout (FIPS 180-4). Specification: spec/authentication.md,
section 3.
"""

import hashlib
import hmac
from collections.abc import Iterator, Mapping

from codec.authentication.layout import HIDDEN_BITS, KEY_BYTES, SENT_BITS, Layout, Tag

_STEP = b"cuecast-step-1"
_TAG = b"cuecast-tag-1"
_DATA = b"cuecast-data-1"
_BEGIN = b"cuecast-begin-1"


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
        """Return the key with these sent bits that leads to a known one in one step or more."""
        prefix, sha256 = self._prefix, hashlib.sha256
        for key in _candidates(sent):
            nearer = key if steps == 1 else self.before(key, steps - 1)
            if sha256(prefix + nearer).digest()[:KEY_BYTES] == known:
                return key
        return None


def _candidates(sent: int) -> Iterator[bytes]:
    """Return all keys whose sent bits these are."""
    first = sent << HIDDEN_BITS
    return (key.to_bytes(KEY_BYTES, "big") for key in range(first, first + (1 << HIDDEN_BITS)))


def whole_key(sent: int, hidden: int) -> bytes:
    """Return a key from the bits that are sent, the higher ones, and those that are not."""
    return (sent << HIDDEN_BITS | hidden).to_bytes(KEY_BYTES, "big")


def sent_bits(key: bytes) -> int:
    """Return the bits of a key that are sent.

    Examples
    --------
    >>> hex(sent_bits(bytes(range(8))))
    '0x102030405'
    """
    assert 8 * len(key) == SENT_BITS + HIDDEN_BITS
    return int.from_bytes(key, "big") >> HIDDEN_BITS


def keys_of(secret: bytes, channel: bytes, period: int, layout: Layout) -> list[bytes]:
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
    """Return what tags are made of: a digest of superframes by their distance before the block.

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


def agreeing(sent: int, digest: bytes, tag: Tag, told: int) -> Iterator[bytes]:
    """Yield the keys with these sent bits under which a tag agrees.

    All are tried for each block until a receiver has found its first key: `tag_of` written out,
    so that this takes less than half the time.
    """
    sha256, least, before = (
        hashlib.sha256,
        told << 32 - tag.bits,
        _TAG + tag.reach.to_bytes(1, "big"),
    )
    first, last = least.to_bytes(4, "big"), (least | (1 << 32 - tag.bits) - 1).to_bytes(4, "big")
    for key in _candidates(sent):
        if first <= sha256(before + key + digest).digest()[:4] <= last:
            yield key
