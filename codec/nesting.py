"""A fine superframe inside a coarse one, for channels of which one bears more than the other.

The picture bears more than the sound. For both to bear the same L0, the picture's L1 holds the
whole superframe once more, finer: its L0, which is as long, then its L1. Specification:
spec/video-carrier.md, section 7.
"""

from codec.bits import read_header
from codec.errors import BitstreamError
from codec.payload import is_intact


def nest(coarse_l0: bytes, fine_l0: bytes, fine_l1: bytes) -> tuple[bytes, bytes]:
    """Return the parts of a superframe that holds `fine` beside a coarse L0.

    Examples
    --------
    >>> nest(b"ab", b"cd", b"efg")
    (b'ab', b'cdefg')
    """
    assert len(coarse_l0) == len(fine_l0), "both L0 have one length"
    return coarse_l0, fine_l0 + fine_l1


def unnest(l0: bytes | None, l1: bytes | None) -> tuple[bytes | None, bytes | None]:
    """Return the finest superframe that these parts hold: the nested one, or themselves.

    Examples
    --------
    >>> unnest(b"ab", b"cde")
    (b'ab', b'cde')
    """
    if l0 is None or not l1 or len(l1) < len(l0) or not is_intact(l1[: len(l0)]):
        return l0, l1
    try:
        nested = read_header(l1[: len(l0)]) == read_header(l0)
    except BitstreamError:
        return l0, l1
    return (l1[: len(l0)], l1[len(l0) :]) if nested else (l0, l1)
