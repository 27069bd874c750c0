"""Keys looked up in what a broadcaster knows, instead of trying 65536 of them."""

import contextlib
from collections.abc import Iterator
from functools import cache
from unittest import mock

from codec.authentication import search, verifier
from codec.authentication.announcement import SigningKey
from codec.authentication.chain import Chain, agreeing, sent_bits, tag_of
from codec.authentication.layout import LAYOUTS


@cache
def keys_by_sent_bits(key: SigningKey, periods: range) -> dict[bytes, dict[int, bytes]]:
    """All keys of some periods by what is sent of them; by their chain."""
    return {
        Chain(key.channel, period, width)._prefix: {
            sent_bits(k): k for k in key.keys(period, width)
        }
        for width in LAYOUTS
        for period in periods
    }


@contextlib.contextmanager
def quick_search(key: SigningKey, periods: range) -> Iterator[None]:
    """What is found is the same: one search in 256 is done in both ways."""
    lists, original = keys_by_sent_bits(key, periods), Chain.find

    def find(self: Chain, sent: int, place: int, known: bytes, steps: int) -> bytes | None:
        found = lists.get(self._prefix, {}).get(sent)
        if found is None or self.before(found, place, steps) != known:
            return None
        if found[-1] == 0:
            assert found == original(self, sent, place, known, steps)
        return found

    def quick(channel: bytes, sent: int, distance: int, covered: bytes, tag: int) -> list[bytes]:
        known = [keys[sent] for keys in lists.values() if sent in keys]
        found = [k for k in known if tag_of(channel, k, distance, covered) == tag]
        if found and found[0][-1] == 0:
            assert found[0] in agreeing(channel, sent, distance, covered, tag)
        return found

    with (
        mock.patch.object(Chain, "find", find),
        mock.patch.object(search, "agreeing", quick),
        mock.patch.object(verifier, "agreeing", quick),
    ):
        yield
