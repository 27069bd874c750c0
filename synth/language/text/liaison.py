"""Liaison: which silent final consonant is heard before a vowel, and numerals before nouns.

In: neighbouring words with their phones and classes.  Out: the phone that links them, and the
left word's phones where the link changes its vowel (bon ami, premier étage).  Two ways of
speaking are known: ``obligatory`` (what every speaker links) and ``none`` (no link, as the
labels of some corpora are made).
"""

import re
from collections.abc import Sequence

from codec.cues.phonology import VOWELS
from synth.language.text.words import DraftWord

_MUTE_H = re.compile(
    "h(?:a(?:bi|gi|lein|lieu|lluc|log|lt[eè]r|meç|rmon|rusp)|eb|éb|éc|ect|éd|ég|él(?!er|e$|ai|è)|elv|ém|end|"
    "épa|ept|éral|erb|ercul|érédi|érés|érét|érit|erma|ermé|ermi|éroï[nqs]|erp|ertz|ési|éta|été|"
    "eur(?!t)|évé|ex|iatu|iber|ibis|iém|ier(?!a)|ila|ind|ippiq|ippo|iron|irsu|ispa|ist|iver|oloc|"
    "olog|omél|omé|omi|omm|omo|onnê|onneu|onor|ôpit|orai|oriz|orlo|ormo|oro|orri|orre|ortens|ortic|"
    "osan|ospi|osti|ôte|uil|uiss|uîtr|umai|uman|umbl|umec|umér|umeu|umid|umil|umor|umou|umus|"
    "ya|yb|ydr|yèn|ygi|ym|yp|yst)"
)
_CLOSED = re.compile(r"onz|oui$|ouis|ouais|ouah|ouat|oued|uhl|ulul|w|huit|y(?!$|eux|euse|onne|v)")

_PARTICIPLE = re.compile("(?:é|i|u)e?s?$")
_VOWEL_SET = frozenset(VOWELS)

DETERMINERS = frozenset(
    "un les des ces mes tes ses nos vos leurs aux mon ton son aucun deux trois cent cents vingts "
    "quels quelles certains certaines plusieurs quelques différents différentes divers diverses "
    "toutes vingt nul".split()
)
PRONOUNS = frozenset("nous vous ils elles on en les".split())
PREPOSITIONS = frozenset("dans chez sans sous en".split())
ADVERBS = frozenset("très plus moins bien trop fort tout".split())
AUXILIARIES = frozenset("est sont ont".split())
PRENOMINAL = frozenset(
    "petit grand gros bon mauvais premier dernier ancien long second certain prochain plein vain "
    "moyen divin faux heureux doux saint tout vieux léger parfait excellent".split()
)
FIXED = frozenset(
    {("temps", "en"), ("mot", "à"), ("pas", "à"), ("petit", "à"), ("nuit", "et"), ("plus", "ou"),
     ("plus", "en"), ("moins", "en"), ("haut", "en"), ("quand", "elle"), ("quand", "il"),
     ("quand", "on"), ("quand", "ils"), ("quand", "elles"), ("quand", "un"), ("quand", "une"),
     ("quand", "est-ce"), ("quand", "est"),
     ("dont", "il"), ("dont", "elle"), ("dont", "on"), ("comment", "allez"), ("bout", "à"),
     ("face", "à"), ("états", "unis"), ("nations", "unies"), ("arts", "et"), ("cent", "ans"),
     ("vingt", "et"), ("champs", "élysées"), ("jeux", "olympiques"), ("tout", "à"),
     ("rien", "à"), ("quant", "à"), ("quant", "au"), ("quant", "aux")}
)  # fmt: skip
"""Pairs that are linked whatever their classes."""

LINK_OF_LETTER = {"s": "z", "x": "z", "z": "z", "t": "t", "d": "t", "n": "n", "r": "ʁ", "p": "p"}
_DENASALISED = (("ein", "ɛ"), ("ain", "ɛ"), ("ien", "ɛ"), ("yen", "ɛ"), ("on", "ɔ"), ("in", "i"))


def opens(word: str, phones: Sequence[str]) -> bool:
    """Whether `word` begins with a vowel sound that takes liaison and elision.

    Examples
    --------
    >>> opens("homme", ("ɔ", "m")), opens("héros", ("e", "ʁ", "o")), opens("oiseau", ("w", "a"))
    (True, False, True)
    """
    if not phones or _CLOSED.match(word):
        return False
    if word[0] == "h":
        return bool(_MUTE_H.match(word))
    return phones[0] in _VOWEL_SET or (phones[0] in ("w", "j", "ɥ") and word[0] in "oyu")


def link(left: DraftWord, right: DraftWord, *, joined_left: bool = False) -> str:
    """Return the consonant heard between two words if the second `opens`, or "".

    Parameters
    ----------
    left, right : DraftWord
        Neighbouring words with their classes.
    joined_left : bool
        Whether a hyphen stands before `left` (``dit-on``: no link to what follows).

    Examples
    --------
    >>> link(DraftWord("les", (), word_class="D"), DraftWord("amis", (), word_class="N"))
    'z'
    >>> link(DraftWord("et", (), word_class="C"), DraftWord("ami", (), word_class="N"))
    ''
    """
    consonant = LINK_OF_LETTER.get(left.text[-1], "")
    if not consonant or left.text == "et":
        return ""
    if right.text in ("un", "une") and _tail(left) in ("cent", "cents", "vingts", "mille"):
        return ""
    if left.text == "vingt" and left.hyphen:
        return ""
    if left.hyphen and right.text in ("en", "y"):
        return consonant
    if left.hyphen and left.word_class == "V":
        return consonant if right.word_class in "SOR" else ""
    if (left.text, right.text) in FIXED:
        return consonant
    inverted = joined_left and left.word_class in "SO"
    return consonant if not inverted and _linked(left, right) else ""


def _linked(left: DraftWord, right: DraftWord) -> bool:
    """Whether the classes of two words without a hyphen ask for a link."""
    word, own, other = _tail(left), left.word_class, right.word_class
    if other == "C" or right.text in ("et", "ou", "où"):
        return False
    if right.text in ("à", "au", "aux"):
        return word in AUXILIARIES and own == "V"
    if word in ("les", "en") or word in PREPOSITIONS:
        return True
    if word in PRONOUNS and own in "SO":
        return other in "VOR"
    if word in AUXILIARIES and own == "V":
        return other in "VA" or (word == "est" and other in "DPRSO")
    if word in ADVERBS and own in "RDAN":
        return other in "AR" or (other == "V" and bool(_PARTICIPLE.search(right.text)))
    if word in DETERMINERS and own in "DUA":
        return other in ("NAUO" if word == "un" else "NAUOVD")
    if word in PRENOMINAL and own in "AD":
        return other in "NA"
    return own == "A" and other == "N" and word[-1] in "sx"


def _tail(item: DraftWord) -> str:
    """Return what decides about a link: the last part of a compound numeral."""
    return item.text.rsplit("-", 1)[-1] if item.word_class == "U" else item.text


def linked_phones(left: str, phones: Sequence[str], consonant: str) -> tuple[str, ...]:
    """Return the phones of `left` as they sound before the linking `consonant`.

    Examples
    --------
    >>> linked_phones("bon", ("b", "ɔ̃"), "n"), linked_phones("premier", ("m", "j", "e"), "ʁ")
    (('b', 'ɔ'), ('m', 'j', 'ɛ'))
    """
    *head, last = phones
    if consonant == "n" and left not in ("on", "en", "un", "aucun", "mon", "ton", "son", "bien",
                                         "commun", "rien"):  # fmt: skip
        for ending, vowel in _DENASALISED:
            if left.endswith(ending):
                return (*head, vowel)
    if consonant == "ʁ" and last == "e":
        return (*head, "ɛ")
    return tuple(phones)


def numeral_phones(
    word: str, phones: Sequence[str], following: str, following_phones: Sequence[str]
) -> tuple[str, ...]:
    """Return the phones of a numeral before the word that it counts.

    Examples
    --------
    >>> numeral_phones("six", ("s", "i", "s"), "francs", ("f", "ʁ", "ɑ̃"))
    ('s', 'i')
    >>> numeral_phones("trente-six", ("t", "ʁ", "ɑ̃", "t", "s", "i", "s"), "ans", ("ɑ̃",))
    ('t', 'ʁ', 'ɑ̃', 't', 's', 'i', 'z')
    >>> numeral_phones("neuf", ("n", "œ", "f"), "heures", ("œ", "ʁ"))
    ('n', 'œ', 'v')
    """
    vowel = opens(following, following_phones)
    last = word.rsplit("-", 1)[-1]
    if last == "neuf" and following in ("ans", "heures", "autres", "hommes"):
        return (*phones[:-1], "v")
    if last in ("six", "dix") and vowel:
        return (*phones[:-1], "z")
    if last in ("six", "dix", "huit") and not vowel:
        return tuple(phones[:-1])
    return tuple(phones)
