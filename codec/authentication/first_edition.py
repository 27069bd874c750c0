"""Recognises proofs of the first edition, which can be forged and verify nothing.

Their fields have the same width and no bit says their edition: keys are tried by that edition's
rules, once. Specification: spec/authentication.md, E18 and section 8.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from codec.authentication.chain import hidden_parts
from codec.authentication.layout import SENT_BITS
from codec.authentication.received import ArrivedSuperframe

MESSAGE = "its proofs are those of the first edition, which can be forged: they verify nothing"


@dataclass(frozen=True, slots=True)
class _Rules:
    """Blocks of one width: tags as their bits, nearest and farthest distance; blocks in a row."""

    block: int
    whole: tuple[int, int, int]
    quick: tuple[int, int, int]
    blocks: int

    @property
    def reach(self) -> int:
        """Superframes in a row that are looked at."""
        return self.block * self.blocks + self.whole[2] - 1


_RULES = {9: _Rules(8, (12, 9, 24), (12, 7, 7), 3), 2: _Rules(44, (24, 45, 88), (16, 32, 35), 1)}

Arrived = Mapping[int, ArrivedSuperframe]


def is_first_edition(arrived: Arrived, last: int, width: int) -> bool | None:
    """Return whether the superframes up to index `last` have proofs of the first edition.

    None if too few arrived in a row to say it.
    """
    rules = _RULES[width]
    if any(
        index not in arrived or (arrived[index].proof or (0, 0))[1] != width
        for index in range(last - rules.reach, last + 1)
    ):
        return None
    return any(
        all(_agrees(arrived, end - n * rules.block, width) for n in range(rules.blocks))
        for end in range(last, last - rules.block, -1)
    )


def _agrees(arrived: Arrived, last: int, width: int) -> bool:
    """Return whether both tags of the block that ends at an index agree under one of its keys."""
    rules, number = _RULES[width], 0
    # The block's number is the concatenation of its superframes' fields: part of a key that was
    # sent, then the short tag, then the long one.
    for index in range(last - rules.block + 1, last + 1):
        number = number << width | (arrived[index].proof or (0, 0))[0]
    sent = (number & (1 << SENT_BITS) - 1).to_bytes(SENT_BITS // 8, "big")
    number >>= SENT_BITS
    # The key's last bytes are never sent: try them all; each tag keeps the keys under which it
    # agrees.
    keys = [sent + hidden for hidden in hidden_parts()]
    for bits, nearest, farthest in (rules.quick, rules.whole):
        digest = hashlib.sha256(b"cuecast-data-1")
        for distance in range(nearest, farthest + 1):
            data = arrived[last + 1 - distance].covered
            digest.update(distance.to_bytes(2, "big") + len(data).to_bytes(2, "big") + data)
        head = b"cuecast-tag-1" + (farthest - nearest + 1).to_bytes(1, "big")
        tail, tag = digest.digest(), number & (1 << bits) - 1
        number >>= bits
        sha256 = hashlib.sha256
        keys = [
            key
            for key in keys
            if int.from_bytes(sha256(head + key + tail).digest()[:4], "big") >> 32 - bits == tag
        ]
    return bool(keys)
