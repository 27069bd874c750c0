"""The chain of keys, and the tags that are made with them.

A chain begins with a secret and ends with a published value; a key leads to all earlier ones and to
no later one. Each step is a function of its own (Kogan, Manohar, Boneh: "T/Key", CCS 2017), so that
a chain's length makes inverting it no cheaper. SHA-256 throughout (FIPS 180-4). Specification:
spec/authentication.md, section 3.
"""

import hashlib
import hmac
from collections.abc import Iterable
from functools import cache, lru_cache

from codec.authentication.layout import HIDDEN_BITS, KEY_BYTES, SENT_BITS, TAG_BITS, ProofLayout

_STEP = b"cuecast-step-3"
_TAG = b"cuecast-tag-3"
_BEGIN = b"cuecast-begin-3"


@cache
def hidden_parts() -> list[bytes]:
    """Return all values of the bytes of a key that are not sent: 3 MB, made when first needed."""
    return [number.to_bytes(HIDDEN_BITS // 8, "big") for number in range(1 << HIDDEN_BITS)]


class Chain:
    """One period's chain, as everybody can compute it: from later keys to earlier ones.

    Parameters
    ----------
    channel : bytes
        Common to all chains of a broadcaster, 8 bytes.
    period : int
    width : int
        Of the proof fields.

    Examples
    --------
    >>> chain = Chain(bytes(8), period=0, width=12)
    >>> last = bytes(KEY_BYTES)
    >>> chain.before(chain.before(last, 5), 4) == chain.before(last, 5, steps=2)
    True
    """

    def __init__(self, channel: bytes, period: int, width: int) -> None:
        self._prefix = hashlib.sha256(
            _STEP + channel + period.to_bytes(4, "big") + width.to_bytes(1, "big")
        ).digest()

    def before(self, key: bytes, place: int, steps: int = 1) -> bytes:
        """Return the key `steps` blocks before that of the block at `place` of the period.

        The end of the chain is `place` + 1 steps before.
        """
        prefix, sha256 = self._prefix, hashlib.sha256
        for at in range(place, place - steps, -1):
            key = sha256(prefix + at.to_bytes(4, "big") + key).digest()[:KEY_BYTES]
        return key

    def places(self, key: bytes, earlier: bytes, places: Iterable[int]) -> list[int]:
        """Return where in the period a key may stand that follows an earlier one."""
        prefix, sha256 = self._prefix, hashlib.sha256
        return [
            at
            for at in places
            if sha256(prefix + at.to_bytes(4, "big") + key).digest()[:KEY_BYTES] == earlier
        ]

    def find(self, sent: int, place: int, known: bytes, steps: int) -> bytes | None:
        """Return the key with these sent bits that leads to a known one in `steps`, if any does."""
        head = sent.to_bytes(SENT_BITS // 8, "big")
        for hidden in hidden_parts():
            if self.before(head + hidden, place, steps) == known:
                return head + hidden
        return None


def sent_bits(key: bytes) -> int:
    """Return the bits of a key that are sent.

    Examples
    --------
    >>> hex(sent_bits(bytes(range(8))))
    '0x102030405'
    """
    return int.from_bytes(key, "big") >> HIDDEN_BITS


@lru_cache(maxsize=4)
def keys_of(secret: bytes, channel: bytes, period: int, layout: ProofLayout) -> tuple[bytes, ...]:
    """Return the keys of a period, first block first; only the broadcaster can.

    Parameters
    ----------
    secret : bytes
        The broadcaster's, 32 bytes.
    """
    message = _BEGIN + channel + period.to_bytes(4, "big") + layout.width.to_bytes(1, "big")
    keys = [hmac.digest(secret, message, "sha256")[:KEY_BYTES]]
    chain = Chain(channel, period, layout.width)
    for place in range(layout.blocks - 1, 0, -1):
        keys.append(chain.before(keys[-1], place))
    return tuple(keys[::-1])


def tag_of(channel: bytes, key: bytes, distance: int, covered: bytes) -> int:
    """Return the 24 bits of the tag of a superframe.

    Parameters
    ----------
    channel, key : bytes
        8 bytes each.
    distance : int
        Superframes from this one to the end of the key's block, 1 for the last one.
    covered : bytes
        The superframe, as far as it is proved.
    """
    found = hashlib.sha256(_TAG + channel + key + distance.to_bytes(2, "big") + covered).digest()
    return int.from_bytes(found[: TAG_BITS // 8], "big")


def agreeing(channel: bytes, sent: int, distance: int, covered: bytes, tag: int) -> list[bytes]:
    """Return the keys with these sent bits under which a superframe has this tag."""
    key, sha256 = sent.to_bytes(SENT_BITS // 8, "big"), hashlib.sha256
    head, tail, told = _TAG + channel + key, distance.to_bytes(2, "big") + covered, TAG_BITS // 8
    wanted = tag.to_bytes(told, "big")
    return [key + h for h in hidden_parts() if sha256(head + h + tail).digest()[:told] == wanted]
