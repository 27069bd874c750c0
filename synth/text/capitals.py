"""Text in capitals without accents, as teletext and titles have it: the accents put back.

In: a line in lower case whose accents are missing.  Out: the line with those that matter for its
sounds. A word that the lexicon knows only with accents gets them; one that it knows both ways gets
them where an auxiliary asks for a participle (``IL A MANGE``).
"""

import functools
import re
import unicodedata

from synth.text.lexicon import known_words, lookup

_WORD = re.compile(r"[^\W\d_]+")
_AUXILIARIES = frozenset(
    "ai as a avons avez ont avais avait avions aviez avaient aurai auras aura aurons aurez auront "
    "aurait auraient avoir ayant suis es est sommes sont étais était étions étiez étaient sera "
    "serai seras serez seront serait seraient fut furent être été étant".split()
)
_BETWEEN = frozenset("pas plus jamais rien bien mal tout déjà encore toujours été".split())


def accented(line: str) -> str:
    """Return a line in lower case with its accents.

    Examples
    --------
    >>> accented("l'ete dernier, il a mange avec le president")
    "l'été dernier, il a mangé avec le président"
    >>> accented("il mange tres peu")
    'il mange très peu'
    """
    said: list[str] = []

    def restore(match: re.Match[str]) -> str:
        said.append(_restored(match[0], said))
        return said[-1]

    return _WORD.sub(restore, line)


def _restored(word: str, said: list[str]) -> str:
    candidates = _index().get(word, ())
    participles = [c for c in candidates if re.search("ée?s?$", c)]
    before = [w for w in said[-3:] if w not in _BETWEEN]
    if participles and before and before[-1] in _AUXILIARIES:
        return participles[0]
    if lookup(word) or not candidates:
        return word
    return next((c for c in candidates if c not in participles), candidates[0])


@functools.cache
def _index() -> dict[str, tuple[str, ...]]:
    """Return the words that bear accents by their letters without them."""
    index: dict[str, tuple[str, ...]] = {}
    for word in known_words():
        if not word.isascii() and (plain := without_accents(word)) != word:
            index[plain] = (*index.get(plain, ()), word)
    return index


def without_accents(text: str) -> str:
    """Return a text without its accents.

    Examples
    --------
    >>> without_accents("Ça, déjà l'été")
    "Ca, deja l'ete"
    """
    parts = unicodedata.normalize("NFD", text)
    return "".join(sign for sign in parts if not unicodedata.combining(sign))
