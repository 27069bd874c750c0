"""Keys as the teachers of Cued Speech write them: shape, hyphen, letter of the placement.

The letters are the usual ones of French software for Cued Speech (s side,
m mouth, c chin, b cheekbone, t throat); the paper writes placement before shape, in digits.
"""

from codec.cues.score import Key

PLACEMENT_LETTER = {"rest": "n", "side": "s", "mouth": "m", "chin": "c", "cheek": "b",
                    "throat": "t"}  # fmt: skip


def as_taught(key: Key) -> str:
    """Return a key in the notation of teachers.

    Examples
    --------
    >>> as_taught(Key(0.0, 0.2, ("b", "ɔ̃"), 4, "mouth"))
    '4-m'
    """
    return f"{key.shape}-{PLACEMENT_LETTER[key.placement]}"
