"""French text to words with phones: lexicon, context, liaison, schwa.

In: text.  Out: a list of `Word`, each with its phones as they are spoken there and the pause that
follows it.  The steps: tokens (`synth.language.text.normalise`), variants
(`synth.language.text.lexicon`, espeak-ng for words that it lacks), classes
(`synth.language.text.tagging`), homographs that need more than their class, numerals and liaison
(`synth.language.text.liaison`), final schwa.
"""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from codec.cues.phonology import CONSONANTS, VOWELS
from codec.errors import CueError
from synth.language.text import espeak, homographs, liaison
from synth.language.text.colloquial import clipped
from synth.language.text.lexicon import Variant, lookup, lookup_name
from synth.language.text.normalise import PAUSES, normalise
from synth.language.text.tagging import SUBJECT, tag
from synth.language.text.words import DraftWord, Word

LIAISONS = ("obligatory", "none")
SCALES = ("cent", "cents", "mille")
"""Numerals that others count."""

SCHWAS = ("none", "cluster", "cluster-pause", "all")

FUTURE_ENDINGS = {
    "a": ("a",), "ai": ("e",), "as": ("a",), "ons": ("ɔ̃",), "ez": ("e",), "ont": ("ɔ̃",),
    "ais": ("ɛ",), "ait": ("ɛ",), "aient": ("ɛ",), "ions": ("j", "ɔ̃"), "iez": ("j", "e"),
}  # fmt: skip
"""Endings after the r of the future and the conditional, and how they sound."""

_FUTURE = re.compile(f"(\\w{{2,}})er({'|'.join(FUTURE_ENDINGS)})")
_PLURAL = re.compile("(?:[^s]s|[aeo]ux)$")
_VOWEL_SET = frozenset(VOWELS)
_CONSONANT_SET = frozenset(CONSONANTS) - {"w", "ɥ", "j"}
"""Consonants that make a cluster; glides do not."""


_CRY_PHONES = dict(zip("bdfgklmnprstvzʃ", "bdfgklmnpʁstvzʃ", strict=True)) | {
    "h": "",
    "c": "k",
    "j": "ʒ",
}


@dataclass(frozen=True, slots=True)
class Style:
    """How the text is spoken where French leaves a choice.

    Attributes
    ----------
    liaison : str
        ``obligatory``, or ``none`` for material labelled without.
    final_schwa : str
        When a final mute e is spoken: ``none``; ``cluster``: after two consonants when another
        follows (quatre femmes); ``cluster-pause``: also before a pause; ``all``: after
        every consonant when another follows (verse, the south).

    Examples
    --------
    >>> Style(liaison="none").final_schwa
    'cluster'
    """

    liaison: str = "obligatory"
    final_schwa: str = "cluster"

    def __post_init__(self) -> None:
        if self.liaison not in LIAISONS:
            raise CueError(f"liaison is {self.liaison!r}, not one of {', '.join(LIAISONS)}")
        if self.final_schwa not in SCHWAS:
            raise CueError(f"final_schwa is {self.final_schwa!r}, not one of {', '.join(SCHWAS)}")


DEFAULT_STYLE = Style()


def phonemise(
    text: str,
    *,
    style: Style = DEFAULT_STYLE,
    user_lexicon: Mapping[str, tuple[Variant, ...]] | None = None,
) -> list[Word]:
    """Return the spoken words of `text`.

    Parameters
    ----------
    text : str
        Written French; figures, abbreviations and signs are read aloud.
    style : Style
    user_lexicon : mapping, optional
        Words that come before the built-in lexicon
        (`synth.language.text.lexicon.read_user_lexicon`).

    Returns
    -------
    list of Word
        Words without any sound are left out.

    Examples
    --------
    >>> ["".join(word.phones) for word in phonemise("Les enfants jouent.")]
    ['le', 'zɑ̃fɑ̃', 'ʒu']
    """
    items: list[DraftWord] = []
    for stretch in _stretches(normalise(text, user_lexicon or {}), user_lexicon or {}):
        _tag(stretch)
        homographs.resolve(stretch)
        _speak_together(stretch, style)
        items += stretch
    return [Word(i.text, i.phones, i.pause, i.word_class, i.guess) for i in items if i.phones]


def _stretches(
    tokens: Sequence[str], user_lexicon: Mapping[str, tuple[Variant, ...]]
) -> Iterator[list[DraftWord]]:
    """Yield the words between pauses, each with its variants."""
    stretch: list[DraftWord] = []
    for token in tokens:
        if token in PAUSES:
            stretch[-1].pause = token
            yield stretch
            stretch = []
        else:
            stretch += _items(token, user_lexicon)
    if stretch:
        yield stretch


def _items(token: str, user_lexicon: Mapping[str, tuple[Variant, ...]]) -> list[DraftWord]:
    """Return the token as one item, or cut at its hyphens if only its parts are known."""
    if token[0].isupper() and (name := lookup_name(token.lower())):
        return [DraftWord(token.lower(), name)]
    token = token.lower()
    known = user_lexicon.get(token) or lookup(token) or lookup_name(token) or clipped(token)
    if known and token.endswith(("-et-un", "-et-une")):
        known = (Variant(known[0].phones, {"U": 9}),)
    if known:
        return [DraftWord(token, known)]
    parts = token.split("-")
    if len(parts) > 1:
        items = [item for part in parts for item in _items(part, user_lexicon)]
        for item in items[:-1]:
            item.hyphen = True
        return items
    guessed = _guess(token)
    return [DraftWord(token, guessed, guess=guessed[0].phones)]


def _guess(word: str) -> tuple[Variant, ...]:
    """Return the pronunciation of a word that no lexicon lists."""
    if word == "t":
        return (Variant(("t",), {"O": 9}),)
    if _PLURAL.search(word) and (singular := lookup(word[:-1])):
        return singular
    if future := _future(word):
        return (Variant(future, {"V": 9}),)
    if cry := _cry(word):
        return (Variant(cry, {"I": 9}),)
    word_class = "V" if word.endswith(("er", "ent", "ait", "aient", "ez")) else "N"
    return (Variant(espeak.transcribe(word), {word_class: 9}),)


def _cry(word: str) -> tuple[str, ...]:
    """Return the phones of a cry without vowels (grr, tss, bzz), () if `word` is none."""
    if len(word) > 1 and all(letter in _CRY_PHONES for letter in word):
        spelled = word.replace("ch", "ʃ").replace("sh", "ʃ")
        phones = (_CRY_PHONES[letter] for letter, _ in itertools.groupby(spelled))
        return tuple(phone for phone in phones if phone)
    return ()


def _future(word: str) -> tuple[str, ...]:
    """Return the phones of a future or conditional in -era, -erait of a known verb in -er."""
    match = _FUTURE.fullmatch(word)
    infinitive = lookup(f"{match[1]}er") if match else ()
    if not match or not infinitive or infinitive[0].phones[-2] not in _CONSONANT_SET:
        return ()
    return (*infinitive[0].phones[:-1], "ə", "ʁ", *FUTURE_ENDINGS[match[2]])


def _tag(stretch: Sequence[DraftWord]) -> None:
    """Choose the class of each word and the variant that the class prefers."""
    merged = []
    for item in stretch:
        levels: dict[str, int] = {}
        for variant in item.variants:
            for letter, level in variant.classes.items():
                levels[letter] = max(level, levels.get(letter, 0))
        merged.append(levels)
    for item, letter in zip(stretch, tag([i.text for i in stretch], merged), strict=True):
        item.word_class = letter
        wanted = "O" if letter == SUBJECT else letter
        item.phones = max(item.variants, key=lambda v: v.classes.get(wanted, -1)).phones


def _speak_together(stretch: Sequence[DraftWord], style: Style) -> None:
    """Apply what neighbours do to each other: numerals, liaison, final schwa."""
    hyphen_before = False
    for left, right in itertools.pairwise(stretch):
        counts = right.word_class in "NA" or right.text in (*SCALES, "pour")
        counts &= right.text != "virgule"
        if left.word_class == "U" and counts:
            left.phones = liaison.numeral_phones(left.text, left.phones, right.text, right.phones)
        if style.liaison != "none" and liaison.opens(right.text, right.phones):
            consonant = liaison.link(left, right, joined_left=hyphen_before)
            if consonant and left.phones[-1:] != (consonant,):
                left.phones = liaison.linked_phones(left.text, left.phones, consonant)
                right.phones = (consonant, *right.phones)
        hyphen_before = left.hyphen
    for left, right in itertools.pairwise(stretch):
        left.phones += _final_schwa(left, right, style)
    if stretch and stretch[-1].pause:
        stretch[-1].phones += _final_schwa(stretch[-1], None, style)


def _final_schwa(item: DraftWord, following: DraftWord | None, style: Style) -> tuple[str, ...]:
    """Return ("ə",) if the mute e at the end of the word is spoken, else ()."""
    mute = item.text.endswith(("e", "es")) or (item.text.endswith("ent") and item.word_class == "V")
    phones = item.phones
    if style.final_schwa == "none" or not mute or phones[-1:] == () or phones[-1] in _VOWEL_SET:
        return ()
    if following:
        if liaison.opens(following.text, following.phones):
            return ()
    elif style.final_schwa != "cluster-pause":
        return ()
    cluster = len(phones) > 1 and phones[-2] in _CONSONANT_SET
    return ("ə",) if cluster or style.final_schwa == "all" else ()
