"""The pronunciation lexicon: a word to its variants, each with its phones and word classes.

Four layers, the first that knows the word answers: the user's own lexicon file, the
supplement that stands in `synth.assets` beside the derived Lexique (function words, letter
names, loanwords and names that Lexique lacks or gives otherwise), Lexique 3.83 itself
(`lab.lexicon` describes the format), and names (`lab.names`, before it a
list of our own).  Everything is read at the first question.
"""

import bisect
import functools
import lzma
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from codec.cues.phonology import PHONES
from codec.errors import CueError

ASSETS = Path(__file__).resolve().parents[2] / "assets"
ASSET = ASSETS / "lexicon.txt.xz"
SUPPLEMENT = ASSETS / "lexicon_supplement.txt"
NAMES = ASSETS / "names.txt.xz"
NAMES_SUPPLEMENT = ASSETS / "names_supplement.txt"

LEXIQUE_PHONES = {
    "a": "a", "o": "o", "9": "œ", "°": "ə", "i": "i", "§": "ɔ̃", "@": "ɑ̃", "E": "ɛ", "O": "ɔ",
    "u": "u", "5": "ɛ̃", "2": "ø", "e": "e", "y": "y", "1": "œ̃",
    "p": "p", "d": "d", "Z": "ʒ", "k": "k", "v": "v", "z": "z", "s": "s", "R": "ʁ", "b": "b",
    "n": "n", "8": "ɥ", "m": "m", "t": "t", "f": "f", "l": "l", "S": "ʃ", "N": "ɲ", "w": "w",
    "g": "g", "j": "j", "G": "ŋ",
}  # fmt: skip
"""Lexique's one-letter code to the phones of `codec.cues.phonology`."""

WORD_CLASSES = "NAUDVROPCI"
"""Noun, adjective, numeral, determiner, verb, adverb, pronoun, preposition, conjunction, cry."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One pronunciation of a word.

    Attributes
    ----------
    phones : tuple of str
        IPA symbols of `codec.cues.phonology`.
    classes : dict of str to int
        Letter of `WORD_CLASSES` to level: 9 + log2 of its share of the word's uses.

    Examples
    --------
    >>> Variant(("w", "i"), {"C": 9}).phones
    ('w', 'i')
    """

    phones: tuple[str, ...]
    classes: Mapping[str, int]


def decode(code: str) -> tuple[str, ...]:
    """Return the phones of a string in Lexique's one-letter code.

    Raises
    ------
    CueError
        If a letter is not of the code.

    Examples
    --------
    >>> decode("b§ZuR")
    ('b', 'ɔ̃', 'ʒ', 'u', 'ʁ')
    """
    try:
        return tuple(LEXIQUE_PHONES[letter] for letter in code)
    except KeyError as error:
        raise CueError(f"unknown phone letter {error.args[0]!r} in {code!r}") from None


@functools.cache
def _supplement() -> dict[str, str]:
    lines = SUPPLEMENT.read_text(encoding="utf-8").splitlines()
    return dict(_split(line) for line in lines if line and not line.startswith("#"))


@functools.cache
def _lexique() -> list[str]:
    """Return the lines of the lexicon, by word."""
    return lzma.decompress(ASSET.read_bytes()).decode().split("\n")


def _in_lexique(word: str) -> str | None:
    lines = _lexique()
    at = bisect.bisect_left(lines, word + "\t")
    found, _, variants = lines[at].partition("\t") if at < len(lines) else ("", "", "")
    return variants if found == word else None


def _split(line: str) -> tuple[str, str]:
    word, _, variants = line.partition("\t")
    return word, variants


def parse_variants(field: str) -> tuple[Variant, ...]:
    """Return the variants of one line of the lexicon.

    Examples
    --------
    >>> [v.phones for v in parse_variants("kuv@:N9 kuv:V5")]
    [('k', 'u', 'v', 'ɑ̃'), ('k', 'u', 'v')]
    """
    variants = []
    for variant in field.split(" "):
        code, _, tags = variant.partition(":")
        classes = {tags[i]: int(tags[i + 1]) for i in range(0, len(tags), 2)}
        variants.append(Variant(decode(code), classes or {"N": 9}))
    return tuple(variants)


@functools.cache
def capital_names() -> frozenset[str]:
    """Return the names, in lower case, that are words as well: only a capital separates them."""
    own = NAMES_SUPPLEMENT.read_text(encoding="utf-8").splitlines()
    names = (
        pair.partition("=")[0] for row in own if not row.startswith("#") for pair in row.split()
    )
    return frozenset(name.lower() for name in names if lookup(name.lower()))


@functools.cache
def _names() -> dict[str, str]:
    own = NAMES_SUPPLEMENT.read_text(encoding="utf-8").splitlines()
    text = lzma.decompress(NAMES.read_bytes()).decode() if NAMES.exists() else ""
    pairs = [line.split("=") for row in own if not row.startswith("#") for line in row.split()]
    return dict(_split(line) for line in text.split("\n")) | {a.lower(): b for a, b in pairs}


@functools.lru_cache(maxsize=5_000)
def lookup_name(word: str) -> tuple[Variant, ...]:
    """Return the variant of a name of a person, a place or a firm in lower case; () if unknown.

    Names stand behind the words of the language: what `lookup` knows is not asked here.

    Examples
    --------
    >>> ["".join(v.phones) for v in lookup_name("sarkozy")]
    ['saʁkɔzi']
    """
    code = _names().get(word)
    return (Variant(decode(code), {"N": 9}),) if code else ()


def known_words() -> Iterator[str]:
    """Yield every word that `lookup` knows."""
    yield from _supplement()
    yield from (line.partition("\t")[0] for line in _lexique())


@functools.lru_cache(maxsize=20_000)
def lookup(word: str) -> tuple[Variant, ...]:
    """Return the known variants of a lower-case word, the most used first; () if unknown.

    Examples
    --------
    >>> [" ".join(v.phones) for v in lookup("huit")]
    ['ɥ i t']
    """
    for layer in (_supplement().get, _in_lexique):
        field = layer(word)
        if field is not None:
            return parse_variants(field)
    for joined, apart in (("œ", "oe"), ("æ", "ae")):
        if joined in word:
            return lookup(word.replace(joined, apart))
    return ()


def read_user_lexicon(path: str | Path) -> dict[str, tuple[Variant, ...]]:
    """Read a user's lexicon: a word, a tab or spaces, its phones in IPA, one word a line.

    A name of several words is followed by a tab.

    Empty lines are skipped, and what follows a #.

    Raises
    ------
    CueError
        If the file cannot be read, or a line has no phones or an unknown one; the message gives
        its number.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise CueError(f"{path}: cannot read the lexicon: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CueError(f"{path}: the lexicon is not valid utf-8: {error.reason}") from error
    words: dict[str, tuple[Variant, ...]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        entry = line.partition("#")[0].strip()
        if not entry:
            continue
        word, *rest = entry.split("\t" if "\t" in entry else None, maxsplit=1)
        phones = split_ipa("".join(rest))
        if not phones:
            raise CueError(f"{path.name} line {number}: no phones after {word!r}")
        unknown = [phone for phone in phones if phone not in PHONES[1:]]
        if unknown:
            raise CueError(f"{path.name} line {number}: unknown phone {unknown[0]!r}")
        words[" ".join(word.lower().split())] = (Variant(phones, {"N": 9}),)
    return words


def split_ipa(text: str) -> tuple[str, ...]:
    """Split a string of IPA into phones: a tilde belongs to the letter before it.

    Examples
    --------
    >>> split_ipa("bɔ̃ʒuʁ")
    ('b', 'ɔ̃', 'ʒ', 'u', 'ʁ')
    """
    phones: list[str] = []
    for letter in text:
        if letter == "\N{COMBINING TILDE}" and phones:
            phones[-1] += letter
        elif not letter.isspace():
            phones.append(letter)
    return tuple(phones)
