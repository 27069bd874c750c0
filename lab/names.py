"""Build the list of names of the package from the French lexicon of gruut.

In: ``lexicon.db`` of gruut-lang-fr 2.0.2 (M. Hansen, MIT licence), an SQLite table of words and
their IPA.  Out: ``synth/assets/names.txt.xz``, UTF-8, one word a line, sorted: the words that
Lexique lacks, most of them names of people, places and firms, each with its pronunciation in
Lexique's one-letter code:

    word TAB phones

Entries whose phones cannot belong to their letters are left out.
Run as ``python -m lab.names lexicon.db``.
"""

import argparse
import lzma
import sqlite3
import unicodedata
from collections.abc import Iterator
from pathlib import Path

from lab.lexicon import mend
from synth.language.text.lexicon import LEXIQUE_PHONES, NAMES, known_words, split_ipa

_CODE = {phone: letter for letter, phone in LEXIQUE_PHONES.items()} | {"ɡ": "g"}
_SHORTEST_PART = 3
"""Least letters of a new part that makes a name of a word with hyphens; others are verbs."""

_FEWEST, _MOST = 0.4, 1.25
"""Phones per letter of an entry that may be right; a spelled sigle has more."""

_LETTERS_OF = {
    "p": "p", "b": "b", "t": "t", "d": "d", "k": "kcqx", "g": "gx", "f": "fpv", "v": "vw",
    "s": "scçztx", "z": "zsx", "S": "cs", "Z": "jg", "m": "m", "n": "n", "N": "gn", "G": "n",
    "l": "l", "R": "r",
}  # fmt: skip
"""Letters that may write a consonant."""


def read_gruut(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the words of the table and their first pronunciation, in Lexique's code."""
    known = frozenset(known_words())
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    try:
        rows = connection.execute(
            "select word, phonemes from word_phonemes where pron_order = 0 order by word"
        )
        for word, phonemes in rows:
            letters = word.lower()
            new = [part for part in letters.split("-") if part not in known]
            if letters in known or not letters.replace("-", "").isalpha():
                continue
            if not new or min(map(len, new)) < _SHORTEST_PART:
                continue
            code = "".join(_CODE.get(phone, "") for phone in split_ipa(phonemes))
            if is_plausible(letters, code):
                yield letters, mend(letters, code)
    finally:
        connection.close()


def is_plausible(word: str, code: str) -> bool:
    """Whether phones may be those of a word: as many as its letters allow, its own consonants.

    Examples
    --------
    >>> [is_plausible(*x) for x in (("pitt", "peitete"), ("kennedy", "kEdi"), ("metz", "mEs"))]
    [False, False, True]
    """
    letters = _plain(word.replace("-", ""))
    if not _FEWEST <= len(code) / len(letters) <= _MOST:
        return False
    sounds = [phone for phone in code if phone in _LETTERS_OF]
    if not all(any(letter in letters for letter in _LETTERS_OF[phone]) for phone in sounds):
        return False
    # An n before a vowel is heard or makes its vowel nasal.
    return letters.count("n") == 0 or any(phone in "nN5@1§G" for phone in code)


def _plain(text: str) -> str:
    parts = unicodedata.normalize("NFD", text.replace("ç", "c"))
    return "".join(letter for letter in parts if not unicodedata.combining(letter))


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="derive the list of names from gruut-lang-fr")
    parser.add_argument("lexicon", type=Path, help="lexicon.db")
    arguments = parser.parse_args()
    lines = [f"{word}\t{code}" for word, code in sorted(set(read_gruut(arguments.lexicon)))]
    packed = lzma.compress("\n".join(lines).encode(), preset=9 | lzma.PRESET_EXTREME)
    part = NAMES.with_suffix(".part")
    part.write_bytes(packed)
    part.replace(NAMES)
    print(f"{len(lines)} words, {len(packed)} bytes in {NAMES.name}")


if __name__ == "__main__":
    main()
