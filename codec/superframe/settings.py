"""The setting of a superframe as symbols: step, use of the prediction, basis and level.

A `Setting` goes in, symbols of a range code come out, and back. Filmed superframes have tables of
their own. Specification: spec/bitstream.md, H8 and H13.
"""

import numpy as np

from codec.superframe.bits import SCORE
from codec.superframe.quantise import NO_RESIDUAL, NOTHING_SENT, PARTS, UNUSED, Setting
from codec.superframe.range_coder import TOTAL, RangeDecoder, RangeEncoder, cumulative

STEP_BITS = 6
"""Bits of the step (H8)."""

EIGHTHS = cumulative([1, 2, 8, 42, 8, 1, 1, 1])
"""Frequencies of eighths of the steps, of filmed superframes (H13)."""

EIGHTH_BITS = 3
"""Bits of a step within its eighth."""

BASES = cumulative([8, 4, 2, 2]), cumulative([1, 1, 15, 15]), cumulative([1, 1, 3, 27])
"""Tables of the basis, with a prediction, without one, and of filmed superframes (H13)."""

LEVELS = cumulative([14, 5, 5, 3, 2.5, 1.5, 1])
"""Frequencies of the levels (H8)."""

COURSES = cumulative([12, 2, 1, 1])
"""Frequencies of the courses (H8)."""

SHIFTS = cumulative([10, 2, 2, 1, 1])
"""Frequencies of the shifts (H8)."""

WHOLE, NONE, BY_PART = range(3)
"""How a superframe uses its prediction (H8)."""

USES = cumulative([8, 4, 4]), cumulative([6, 9, 1])
"""Their frequencies, and those of filmed superframes (H13)."""

SHARE = cumulative([6, 2, 8])
"""Frequencies of a part's share of the prediction (H8)."""

_FILMED = 2
"""Number of the tables of filmed superframes in `BASES`."""

_BASIS_BITS = [np.log2(TOTAL) - np.log2(np.diff(row)) for row in BASES]
_LEVEL_BITS = np.log2(TOTAL) - np.log2(np.diff(LEVELS))


def use_of(setting: Setting) -> int:
    """Return how a superframe with a score uses its prediction."""
    if setting.shares == UNUSED:
        return NONE
    return BY_PART if any(setting.shares) else WHOLE


def put_setting(
    encoder: RangeEncoder, setting: Setting, mode: int, *, filmed: bool = False
) -> None:
    """Append a setting.

    Parameters
    ----------
    encoder : RangeEncoder
    setting : Setting
    mode : int
        Of the superframe; mode ``plain`` has no prediction.
    filmed : bool
        Whether the superframe is.
    """
    if filmed:
        encoder.put(setting.step >> EIGHTH_BITS, EIGHTHS)
        encoder.put_bits(setting.step & 7, EIGHTH_BITS)
    else:
        encoder.put_bits(setting.step, STEP_BITS)
    if setting.step == NO_RESIDUAL:
        return
    use = use_of(setting) if mode == SCORE else NONE
    if mode == SCORE:
        encoder.put(use, USES[filmed])
    encoder.put(setting.basis, BASES[_FILMED if filmed else use == NONE])
    encoder.put(setting.level, LEVELS)
    if use == NONE:
        return
    encoder.put(setting.course, COURSES)
    encoder.put(setting.shift, SHIFTS)
    for share in setting.shares if use == BY_PART else ():
        encoder.put(share, SHARE)


def read_setting(decoder: RangeDecoder, mode: int, *, filmed: bool = False) -> Setting:
    """Return the setting that follows (H8, H13)."""
    if filmed:
        step = decoder.get(EIGHTHS) << EIGHTH_BITS
        step |= decoder.get_bits(EIGHTH_BITS)
    else:
        step = decoder.get_bits(STEP_BITS)
    if step == NO_RESIDUAL:
        return NOTHING_SENT
    use = decoder.get(USES[filmed]) if mode == SCORE else NONE
    basis = decoder.get(BASES[_FILMED if filmed else use == NONE])
    level = decoder.get(LEVELS)
    if use == NONE:
        return Setting(step, basis, level, shares=UNUSED if mode == SCORE else (0,) * PARTS)
    course, shift = decoder.get(COURSES), decoder.get(SHIFTS)
    if use == WHOLE:
        return Setting(step, basis, level, course, shift)
    shares = tuple(decoder.get(SHARE) for _ in range(PARTS))
    return Setting(step, basis, level, course, shift, shares)


def setting_bits(setting: Setting, mode: int) -> float:
    """Return the length of the symbols that say a setting of a superframe of a file, bits."""
    encoder = RangeEncoder()
    put_setting(encoder, setting, mode)
    return encoder.bits


def choice_bits(basis: int, level: int, *, unpredicted: bool, filmed: bool) -> float:
    """Return the length of the symbols that name a basis and a level, bits."""
    table = _BASIS_BITS[_FILMED if filmed else unpredicted]
    bits: float = table[basis] + _LEVEL_BITS[level]
    return bits
