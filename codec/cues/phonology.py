"""The phones of French as the toolkit writes them: one IPA symbol each, in one fixed order.

The order is part of the bitstream (spec/bitstream.md, phone numbers): never re-sort it.
"""

VOWELS = (
    "a", "ɑ", "o", "œ", "ə", "i", "ɔ̃", "ɑ̃", "ɛ", "ɔ", "u", "ɛ̃", "ø", "e", "y", "œ̃",
)  # fmt: skip
"""The sixteen vowels."""

CONSONANTS = (
    "p", "d", "ʒ", "k", "v", "z", "s", "ʁ", "b", "n", "ɥ",
    "m", "t", "f", "l", "ʃ", "ɲ", "w", "g", "j", "ŋ",
)  # fmt: skip
"""The twenty-one consonants; the glides j, ɥ and w count among them in Cued Speech."""

PAUSE = "_"
"""Silence between phones."""

PHONES = (PAUSE, *VOWELS, *CONSONANTS)
"""All 38 symbols; a phone's number in a bitstream is its index here."""

PHONE_NUMBER = {symbol: number for number, symbol in enumerate(PHONES)}
"""Inverse of `PHONES`."""
