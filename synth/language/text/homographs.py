"""Homographs that their word class does not separate: plus, tous, fils, os.

In: the tagged words of a stretch.  Each rule looks at the words around and sets the phones.
"""

from collections.abc import Callable, Sequence

from synth.language.text.lexicon import decode
from synth.language.text.words import DraftWord

_THREADS = (
    "électri fer coudre soie lain coton nylon télépho barbel tiss cuivre aiguill bobin cous dénud "
    "branch couleur teint métal tress tendu emmêl noué brod"
).split()
_POSSESSIVES = frozenset("mon ton son mes tes ses nos vos leurs notre votre".split())
_PLURALS = frozenset("des les ces mes tes ses nos vos leurs aux deux trois quatre".split())
_NEGATIONS = frozenset("ne n' non pas sans jamais".split())


def resolve(stretch: Sequence[DraftWord]) -> None:
    """Set the phones of the homographs of a stretch of words."""
    for position, item in enumerate(stretch):
        if verb := _plain_verb(stretch, position):
            item.phones, item.word_class = verb, "V"
            continue
        rule = _RULES.get(item.text)
        if rule:
            item.phones = decode(rule(stretch, position))


def _plain_verb(stretch: Sequence[DraftWord], position: int) -> tuple[str, ...]:
    """Return the phones of a verb in -ent or -tions that reads as another word, else ().

    After a noun in the plural an adjective would be in the plural: ils excellent; between nous, a
    pronoun and the end only the verb has a place: nous les éditions.
    """
    item = stretch[position]
    if not item.text.endswith(("ent", "tions")) or len(item.variants) < 2:
        return ()
    verbs = [variant.phones for variant in item.variants if "V" in variant.classes]
    others = [
        v.phones for v in item.variants if set(v.classes) & set("NA") and "V" not in v.classes
    ]
    if not verbs or not others:
        return ()
    end = position
    while end and stretch[end - 1].text in _CLITICS - {"nous"}:
        end -= 1
    before = stretch[end - 1].text if end else ""
    if item.text.endswith("tions"):
        opens = end == 1 or (end > 1 and stretch[end - 2].word_class == "C")
        return verbs[0] if before == "nous" and opens else ()
    several = before in ("ils", "elles") or (end == position and _plural_noun(stretch, position))
    return verbs[0] if several else ()


def _text(stretch: Sequence[DraftWord], position: int) -> str:
    return stretch[position].text if 0 <= position < len(stretch) else ""


def _plus(stretch: Sequence[DraftWord], position: int) -> str:
    """Return ply when it denies or compares; plys when it adds or ends the phrase."""
    before, after = _text(stretch, position - 1), _text(stretch, position + 1)
    if any(item.text in _NEGATIONS or item.text == "plus" for item in stretch[:position]):
        return "ply"
    if after in ("que", "qu'") and before not in ("", "de", "d'", "pas"):
        # One says more than: a quantity, unless something is denied.
        return "plys"
    numeral = position + 1 < len(stretch) and stretch[position + 1].word_class == "U"
    adds = numeral and position > 0 and stretch[position - 1].word_class in "UNA"
    if adds or (not after and before not in ("de", "non", "")) or before in ("en", "signe"):
        return "plys"
    return "ply"


def _tous(stretch: Sequence[DraftWord], position: int) -> str:
    """Return tu before its noun, tus when it stands alone."""
    after = stretch[position + 1] if position + 1 < len(stretch) else None
    if after is None or after.text == "ensemble":
        return "tus"
    if after.word_class in "DU" or after.text in ("ceux", "deux", "les", "leurs"):
        return "tu"
    alone = position > 0 and stretch[position - 1].word_class in "VSO"
    return "tu" if after.word_class in "NA" and not alone else "tus"


def _fils(stretch: Sequence[DraftWord], position: int) -> str:
    """Return fil for threads, which their company betrays, fis for sons."""
    if _text(stretch, position - 1) in _POSSESSIVES:
        return "fis"
    near = [item.text for item in stretch[max(0, position - 3) : position + 4]]
    return "fil" if any(word.startswith(thread) for word in near for thread in _THREADS) else "fis"


def _os(stretch: Sequence[DraftWord], position: int) -> str:
    """Return Os for one bone, o for several."""
    near = {_text(stretch, position - 1), _text(stretch, position - 2)}
    return "o" if near & _PLURALS else "Os"


def _est(stretch: Sequence[DraftWord], position: int) -> str:
    """Return Est for the point of the compass: after d', and after l' that no subject precedes."""
    if _text(stretch, position - 1) == "d'":
        return "Est"
    named = _text(stretch, position - 1) == "l'"
    subject = position > 1 and stretch[position - 2].word_class in "SRO"
    return "Est" if stretch[position].word_class in "NA" or (named and not subject) else "E"


def _convient(stretch: Sequence[DraftWord], position: int) -> str:
    """Return k§vi (from convier) for several who invite, k§vj5 (from convenir) else."""
    before = [item.text for item in stretch[:position]]
    near = [word for word in before if word not in _CLITICS][-1:]
    several = near in (["ils"], ["elles"])
    return "k§vi" if several or _plural_noun(stretch, position) else "k§vj5"


def _plural_noun(stretch: Sequence[DraftWord], position: int) -> bool:
    """Whether the word stands right after a noun in the plural and its determiner."""
    end = position
    while end and stretch[end - 1].text in _CLITICS:
        end -= 1
    head = stretch[:end]
    if not head or head[-1].word_class not in "NA" or head[-1].text[-1] not in "sx":
        return False
    return any(item.text in _PLURALS for item in head[-4:-1])


def _punch(stretch: Sequence[DraftWord], position: int) -> str:
    """Return pœnʃ for a blow and for energy, pɔ̃ʃ for the drink."""
    near = [item.text for item in stretch[max(0, position - 5) : position + 4]]
    if any(word.startswith(drink) for word in near for drink in _DRINKS):
        return "p§S"
    return "p9nS" if _text(stretch, position - 1) in _ENERGY else "p§S"


_CLITICS = frozenset("ne n' nous vous les le la l' leur lui me m' te t' se s' y en".split())
_DRINKS = "boi boire bu buv verre bol rhum cocktail planteur coco goût sers servi tasse".split()
_ENERGY = frozenset("du de son ton mon ce quel plein manque sans peu leur".split())

_RULES: dict[str, Callable[[Sequence[DraftWord], int], str]] = {
    "plus": _plus,
    "tous": _tous,
    "fils": _fils,
    "os": _os,
    "est": _est,
    "convient": _convient,
    "punch": _punch,
}
