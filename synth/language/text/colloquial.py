"""Words with an apostrophe for a sound that is not spoken: r'garde, quat', p'têt', m'sieur.

In: a word in lower case that no lexicon lists.  Out: its variant if the lexicon knows the word with
the letters that the apostrophe stands for.
"""

import functools

from synth.language.text.lexicon import Variant, lookup

_FINAL = (("re", "ʁ"), ("le", "l"), ("e", ""))
"""Letters that a final apostrophe stands for, and the last phone that they take along."""

_VOWELS = "aeiouyàâéèêëîïôùûü"


@functools.lru_cache(maxsize=2000)
def clipped(word: str) -> tuple[Variant, ...]:
    """Return the variant of a clipped word, () if it is none.

    Examples
    --------
    >>> ["".join(v.phones) for w in ("r'garde", "quat'", "possib'") for v in clipped(w)]
    ['ʁgaʁd', 'kat', 'pɔsib']
    """
    if word.endswith("'"):
        for letters, phone in _FINAL:
            if (known := lookup(word[:-1] + letters)) and len(word) > 3:
                return tuple(_without(variant, phone) for variant in known)
    before, mark, after = word.partition("'")
    if not mark or not before or not after or before[-1] in _VOWELS or after[0] in _VOWELS:
        return ()
    known = lookup(f"{before}e{after}") or lookup(f"{before}e{after.rstrip(chr(39))}")
    return tuple(_without_schwa(variant, before) for variant in known)


def _without(variant: Variant, phone: str) -> Variant:
    phones = variant.phones[:-1] if phone and variant.phones[-1:] == (phone,) else variant.phones
    return Variant(phones, variant.classes)


def _without_schwa(variant: Variant, before: str) -> Variant:
    """Return a variant without the first mute e that follows the letters `before`."""
    phones = list(variant.phones)
    if "ə" in phones[: len(before) + 1]:
        phones.remove("ə")
    return Variant(tuple(phones), variant.classes)
