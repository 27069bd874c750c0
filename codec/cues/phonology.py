"""The phones of French as the toolkit writes them: one IPA symbol each, in one fixed order.

The order is part of the bitstream (spec/bitstream.md, phone numbers): it is that of its tables.
"""

from codec.cues.language import PAUSE, french

__all__ = ["CONSONANTS", "PAUSE", "PHONES", "PHONE_NUMBER", "VOWELS"]

PHONES = french().phones
"""All 38 symbols; a phone's number in a bitstream is its index here."""

VOWELS = PHONES[1 : 1 + french().n_vowels]
"""The sixteen vowels."""

CONSONANTS = PHONES[1 + french().n_vowels :]
"""The twenty-one consonants; the glides j, ɥ and w count among them in Cued Speech."""

PHONE_NUMBER = french().number_of
"""Inverse of `PHONES`."""
