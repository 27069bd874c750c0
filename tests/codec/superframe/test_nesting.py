"""A fine superframe inside a coarse one."""

from codec.superframe.bits import Header
from codec.superframe.checks import with_check
from codec.superframe.payload import nest, unnest


def l0(sequence: int, fill: int) -> bytes:
    return with_check(Header(0, sequence, 2).to_bytes() + bytes([fill]) * 16, "1234" + 12 * "0")


def test_round_trip() -> None:
    coarse, fine = l0(5, 1), l0(5, 2)
    assert unnest(*nest(coarse, fine, b"more")) == (fine, b"more")
    assert unnest(*nest(coarse, fine, b"")) == (fine, b"")


def test_what_is_not_nested_stays() -> None:
    coarse = l0(5, 1)
    for l1 in (None, b"", b"short", bytes(60), l0(6, 2) + b"more", l0(5, 2)[:-1] + b"xx"):
        assert unnest(coarse, l1) == (coarse, l1)
    assert unnest(None, None) == (None, None)
