"""Importance of words: the least important are left out where there is no time for all."""

from synth.language.text.words import Word

_NEGATION = frozenset("pas plus jamais rien personne aucun aucune guère sans ni non".split())
_ARTICLES = frozenset("le la les l' un une des du de d' au aux ce cet cette ces".split())
_AUXILIARY = frozenset(
    "est a ont sont ai as es avons avez sommes êtes suis était avait étaient avaient été".split()
)
_LINKING = frozenset("z t n ʁ p".split())
_VOWEL_LETTERS = "aeiouyhàâäéèêëîïôöùûüœæ"


def links(word: Word) -> bool:
    """Return whether a word opens with the linking consonant of the word before it."""
    return word.text[:1] in _VOWEL_LETTERS and len(word.phones) > 1 and word.phones[0] in _LINKING


def importance(word: Word) -> int:
    """Return the importance of a word, 0 for the first to go.

    Function words before content words; what denies, counts or names goes last.

    Examples
    --------
    >>> [importance(Word(t, ("a",), word_class=c)) for t, c in (("le", "D"), ("pas", "R"))]
    [1, 8]
    """
    text, kind = word.text, word.word_class
    if text in ("ne", "n'"):
        return 0
    if text in _NEGATION or kind == "U":
        return 8
    if text in _ARTICLES:
        return 1
    if kind in "PC":
        return 2
    if kind in "SOD" or text in _AUXILIARY:
        return 3
    return {"I": 4, "R": 4, "A": 5, "V": 6}.get(kind, 7)
