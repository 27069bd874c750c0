"""Checks of a block: parities of the tags of its superframes, so that losses cost little.

Two symbols of 12 bits are the tag of a superframe. Each check is a sum of all symbols of a block in
GF(2**12), with the coefficients of a Cauchy matrix, whose square parts all have inverses: each
lost superframe takes two of the checks that arrived, and if two are left over, they prove all
superframes that arrived (Reed and Solomon 1960; MacWilliams and Sloane 1977, chapter 11).
Specification: spec/authentication.md, section 4.
"""

from collections.abc import Iterable, Mapping

from codec.authentication.layout import CHECK_BITS

_POLYNOMIAL = 0x1053
"""Primitive polynomial: x^12 + x^6 + x^4 + x + 1."""

_ORDER = (1 << CHECK_BITS) - 1
"""Order of the multiplicative group: elements of the field but zero."""

_MOST_CHECKS = 16
"""First number of a symbol: checks are numbered below it."""

_SPARE = 2
"""Checks that have to agree beyond those that the missing superframes take: 24 bits."""


def _powers() -> tuple[list[int], list[int]]:
    """Return powers of x, twice over, and the logarithms of all elements."""
    powers, logarithms, value = [], [0] * (_ORDER + 1), 1
    for exponent in range(_ORDER):
        powers.append(value)
        logarithms[value] = exponent
        value <<= 1
        if value > _ORDER:
            value ^= _POLYNOMIAL
    return 2 * powers, logarithms


_POWERS, _LOGARITHMS = _powers()


def multiply(a: int, b: int) -> int:
    """Return a product in GF(2**12).

    Examples
    --------
    >>> hex(multiply(0x800, 2))
    '0x53'
    """
    return _POWERS[_LOGARITHMS[a] + _LOGARITHMS[b]] if a and b else 0


def inverse(a: int) -> int:
    """Return the inverse of an element that is not 0."""
    return _POWERS[_ORDER - _LOGARITHMS[a]]


def _coefficient(check: int, symbol: int) -> int:
    return inverse(check ^ (_MOST_CHECKS + symbol))


def checks_of(tags: Mapping[int, int], count: int) -> list[int]:
    """Return the checks of a block.

    Parameters
    ----------
    tags : mapping of int to int
        Tags of 24 bits by the superframe's place in its block; none for those not sent.
    count : int
        Of the checks.
    """
    checks = [0] * count
    for place, tag in tags.items():
        for half, value in enumerate(divmod(tag, 1 << CHECK_BITS)):
            for check in range(count):
                checks[check] ^= multiply(_coefficient(check, 2 * place + half), value)
    return checks


def agree(
    told: Mapping[int, int], tags: Mapping[int, int], missing: Iterable[int], spare: int = _SPARE
) -> bool | None:
    """Return whether checks agree with what arrived, whatever the missing superframes were.

    Parameters
    ----------
    told : mapping of int to int
        The checks that arrived, by their number.
    tags : mapping of int to int
        Tags of the superframes that arrived, by their place.
    missing : iterable of int
        Places of those that were lost.
    spare : int
        Checks that have to be left over.

    Returns
    -------
    bool or None
        None if too few checks are left over to say it.
    """
    unknown = [2 * place + half for place in missing for half in (0, 1)]
    if len(told) < len(unknown) + spare:
        return None
    own = checks_of(tags, 1 + max(told, default=0))
    rows = [
        [*(_coefficient(check, symbol) for symbol in unknown), value ^ own[check]]
        for check, value in told.items()
    ]
    for column in range(len(unknown)):  # each square part has an inverse: no row begins with 0
        pivot = rows.pop()
        scale = inverse(pivot[column])
        for row in rows:
            factor = multiply(row[column], scale)
            row[:] = [a ^ multiply(factor, b) for a, b in zip(row, pivot, strict=True)]
    return all(row[-1] == 0 for row in rows)
