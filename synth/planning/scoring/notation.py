"""Keys as the teachers of Cued Speech write them: shape, hyphen, letter of the placement.

The letters are the usual ones of French software for Cued Speech (s side,
m mouth, c chin, b cheekbone, t throat); the paper writes placement before shape, in digits.
"""

from codec.cues.score import Key
from codec.errors import CueError

PLACEMENT_LETTER = {"rest": "n", "side": "s", "mouth": "m", "chin": "c", "cheek": "b",
                    "throat": "t"}  # fmt: skip

_PLACEMENT = {letter: placement for placement, letter in PLACEMENT_LETTER.items()}


def as_taught(key: Key) -> str:
    """Return a key in the notation of teachers.

    Examples
    --------
    >>> as_taught(Key(0.0, 0.2, ("b", "ɔ̃"), 4, "mouth"))
    '4-m'
    """
    return f"{key.shape}-{PLACEMENT_LETTER[key.placement]}"


def read_taught(text: str) -> list[tuple[int, str]]:
    """Return (shape, placement) of keys in the notation of teachers, separated by spaces.

    Raises
    ------
    CueError
        If a key is not a shape, a hyphen and a letter.

    Examples
    --------
    >>> read_taught("4-m 1-c 3-s")
    [(4, 'mouth'), (1, 'chin'), (3, 'side')]
    """
    keys = []
    for word in text.split():
        shape, _, letter = word.partition("-")
        if shape not in "012345678" or len(shape) != 1 or letter not in _PLACEMENT:
            raise CueError(f"key {word!r} is not a shape 0..8, a hyphen and one of nsmcbt")
        keys.append((int(shape), _PLACEMENT[letter]))
    return keys
