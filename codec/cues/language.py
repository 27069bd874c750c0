"""Languages as data: phones, hand shapes, placements and the chart that joins them.

French is that of the format's tables; others are files of the same form in ``spec/data/languages``
or of a user's own. The number of a phone, a shape or a placement in a bitstream is its number
here. Specification: spec/bitstream.md, S11, S12, tables 7 and 8.
"""

import functools
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from codec.errors import CueError
from codec.files.data import DATA

PAUSE = "_"
"""Silence between phones, the first phone of each language."""

REST = "rest"
"""The first placement of each language."""

_MOST_BYTES = 1 << 22
"""Bytes of a file of tables at most."""

_MOST_PHONES, _MOST_KINDS, _FEWEST = 64, 16, 3
"""Limits of an inventory: phones, kinds (shapes or placements), and the least number of kinds."""

_FRENCH = {
    "code": "",
    "movement": {},
    "alternatives": ["œ̃", "ə", "œ"],
    "stand_ins": {
        "consonants": ["d", "k", "s", "n", "t", "l", "g", "j"],
        "vowels": ["a", "i", "ɛ", "ɛ̃", "e"],
    },
    "common": ["d", "k", "ʁ", "n", "t", "l", "g", "j"],
}
"""Members that the file of French leaves out (table 8)."""


@dataclass(frozen=True, slots=True)
class Language:
    """Phones and chart of a language; two are the same if their files are.

    Attributes
    ----------
    digest : bytes
        SHA-256 of the file of its tables.
    name : str
    code : str
        Two letters of ISO 639-1; none in the tables of French.
    phones : tuple of str
        IPA symbols by their number: the pause, the vowels, the consonants.
    n_vowels : int
    placements : tuple of str
        Names by their number, ``rest`` first.
    shapes : mapping of str to int
        Hand shape of each consonant.
    placement_of : mapping of str to str
        Placement of each vowel.
    shape_alone, placement_alone : int, str
        Shape of a vowel without a consonant, placement of a consonant without a vowel.
    movement : mapping of str to str
        Where placements that move begin (P12).
    alternatives : tuple of str
        Vowels that options can cue at the cheek.
    stand_ins : tuple of tuple of int
        Numbers of the phones that stand for the shapes from 1 on and for the placements from 1 on,
        0 where no vowel has the placement (J8).
    common : frozenset of str
        Consonants that keys are likelier to have (F11).
    score : mapping
        Frequencies of the score's symbols, as far as they were counted (S12).

    Examples
    --------
    >>> from codec.cues.language import french
    >>> french().name, len(french().phones)
    ('French', 38)
    """

    digest: bytes
    name: str = field(compare=False)
    code: str = field(compare=False, repr=False)
    phones: tuple[str, ...] = field(compare=False, repr=False)
    n_vowels: int = field(compare=False, repr=False)
    placements: tuple[str, ...] = field(compare=False, repr=False)
    shapes: Mapping[str, int] = field(compare=False, repr=False)
    placement_of: Mapping[str, str] = field(compare=False, repr=False)
    shape_alone: int = field(compare=False, repr=False)
    placement_alone: str = field(compare=False, repr=False)
    movement: Mapping[str, str] = field(compare=False, repr=False)
    alternatives: tuple[str, ...] = field(compare=False, repr=False)
    stand_ins: tuple[tuple[int, ...], tuple[int, ...]] = field(compare=False, repr=False)
    common: frozenset[str] = field(compare=False, repr=False)
    score: Mapping[str, Any] = field(compare=False, repr=False)
    number_of: Mapping[str, int] = field(init=False, compare=False, repr=False)
    n_phones: int = field(init=False, compare=False, repr=False)
    n_shapes: int = field(init=False, compare=False, repr=False)
    n_placements: int = field(init=False, compare=False, repr=False)
    silence: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        shapes = 1 + max([*self.shapes.values(), self.shape_alone])
        for name, value in {
            "number_of": {symbol: number for number, symbol in enumerate(self.phones)},
            "n_phones": len(self.phones),
            "n_shapes": shapes,
            "n_placements": len(self.placements),
            "silence": (shapes - 1) * (len(self.placements) - 1),
        }.items():
            object.__setattr__(self, name, value)

    @property
    def identity(self) -> str:
        """The first sixteen hexadecimal digits of the digest, as voice files name it."""
        return self.digest.hex()[:16]

    def is_consonant(self, number: int) -> bool:
        """Return whether a phone number is a consonant's."""
        return number > self.n_vowels

    def is_vowel(self, number: int) -> bool:
        """Return whether a phone number is a vowel's."""
        return 1 <= number <= self.n_vowels

    def starts_key(self, before: int, number: int) -> bool:
        """Return whether a phone after another one starts a key (S10)."""
        return number > 0 and not (self.is_vowel(number) and self.is_consonant(before))

    def letter_of(self, number: int) -> int:
        """Return the symbol of a phone in the tables: vowels, consonants, pause (S3)."""
        return (number - 1) % self.n_phones

    def phone_of(self, letter: int) -> int:
        """Return the phone number of a symbol in the tables (S3)."""
        return (letter + 1) % self.n_phones

    def key_number(self, shape: int, placement: str) -> int:
        """Return the number of a key (J4)."""
        return self.n_placements * shape + self.placements.index(placement)

    def beginning_of(self, key: int) -> int:
        """Return the number of the key at which a key begins: itself, unless it moves (P12)."""
        shape, place = divmod(key, self.n_placements)
        name = self.placements[place]
        return self.key_number(shape, self.movement[name]) if name in self.movement else key

    def symbol_of(self, shape: int, placement: int) -> int:
        """Return the symbol of a key in previews, labels and files (V2)."""
        return (self.n_placements - 1) * (shape - 1) + placement - 1

    def key_of(self, symbol: int) -> tuple[int, int]:
        """Return shape and placement number of such a symbol."""
        shape, place = divmod(symbol, self.n_placements - 1)
        return 1 + shape, 1 + place


def language_of(content: bytes, name: str) -> Language:
    """Return the language of a file of tables.

    Parameters
    ----------
    content : bytes
        The file.
    name : str
        Of the file, for messages.

    Raises
    ------
    CueError
        If it is not one.
    """
    try:
        document = json.loads(content)
        # What a language leaves out is as in French.
        told: dict[str, Any] = _FRENCH | document["language"]
        phones = tuple(map(str, told["phones"]))
        numbers = {symbol: number for number, symbol in enumerate(phones)} | {None: 0}
        stand_ins = told["stand_ins"]
        language = Language(
            hashlib.sha256(content).digest(), str(told["name"]), str(told["code"]), phones,
            int(told["vowels"]),
            tuple(map(str, told["placements"])),
            {str(k): int(v) for k, v in told["shape"].items()},
            {str(k): str(v) for k, v in told["placement"].items()},
            int(told["shape_without_consonant"]), str(told["placement_without_vowel"]),
            {str(k): str(v) for k, v in told["movement"].items()}, tuple(told["alternatives"]),
            (
                tuple(numbers[s] for s in stand_ins["consonants"]),
                tuple(numbers[s] for s in stand_ins["vowels"]),
            ),
            frozenset(told["common"]), document.get("score", {}),
        )  # fmt: skip
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CueError(f"{name}: not the tables of a language: {error!r}") from error
    problem = _problem_of(language)
    if problem:
        raise CueError(f"{name}: not the tables of a language: {problem}")
    return language


def _problem_of(language: Language) -> str:
    """Return the fault of a language, "" if there is none."""
    phones, last = language.phones, language.n_vowels
    vowels, consonants = phones[1 : 1 + last], phones[1 + last :]
    limits = {
        "phones": (len(phones), _MOST_PHONES),
        "shapes": (language.n_shapes, _MOST_KINDS),
        "placements": (language.n_placements, _MOST_KINDS),
    }
    for what, (count, most) in limits.items():
        if not _FEWEST <= count <= most:
            return f"{count} {what}, not within {_FEWEST}..{most}"
    places = set(language.placements)
    named = {*language.placement_of.values(), *language.movement.values()}
    consonant_stand_ins, vowel_stand_ins = language.stand_ins
    checks = {
        "phones repeat, or the first is not the pause": len(set(phones)) == len(phones)
        and phones[0] == PAUSE,
        "placements repeat, or the first is not rest": len(places) == language.n_placements
        and language.placements[0] == REST,
        "vowels and their placements differ": set(vowels) == set(language.placement_of),
        "consonants and their shapes differ": set(consonants) == set(language.shapes),
        "a shape below 1": min([*language.shapes.values(), language.shape_alone]) >= 1,
        "a placement that is not in its list": named
        | {language.placement_alone}
        | set(language.movement)
        <= places - {REST},
        "a movement from a placement that moves": not set(language.movement)
        & {*language.movement.values(), language.placement_alone},
        "stand-ins do not fit the chart": _stands(language, consonant_stand_ins, vowel_stand_ins),
        "alternatives that are not in its vowels": set(language.alternatives) <= set(vowels),
    }
    return next((text for text, holds in checks.items() if not holds), "")


def _stands(language: Language, consonants: tuple[int, ...], vowels: tuple[int, ...]) -> bool:
    """Return whether stand-ins have the shapes and placements for which they stand."""
    phones, places = language.phones, language.placements[1:]
    return (
        [language.shapes.get(phones[n]) for n in consonants] == list(range(1, language.n_shapes))
        and len(vowels) == len(places)
        and all(
            language.placement_of.get(phones[n]) == place
            if n
            else place == language.placement_alone
            for n, place in zip(vowels, places, strict=True)
        )
    )


def load_language(path: str | os.PathLike[str]) -> Language:
    """Read a language from the file of its tables; its phones are known from then on.

    Parameters
    ----------
    path : path-like
        A file of the form of ``spec/data/languages``.

    Returns
    -------
    Language

    Raises
    ------
    CueError
        If the file is missing, too large or no such file.

    Examples
    --------
    >>> load_language("missing.json")
    Traceback (most recent call last):
    codec.errors.CueError: missing.json: No such file or directory
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error
    if len(content) > _MOST_BYTES:
        raise CueError(f"{path}: more than {_MOST_BYTES} bytes")
    language = language_of(content, str(path))
    _known()[language.identity] = language
    return language


@functools.cache
def french() -> Language:
    """Return French, whose tables are the format's own."""
    return language_of((DATA / "tables.json").read_bytes(), "tables.json")


@functools.cache
def _known() -> dict[str, Language]:
    """Return the languages that this process knows by their identity."""
    built_in = [
        language_of(path.read_bytes(), path.name)
        for path in sorted((DATA / "languages").glob("*.json"))
    ]
    return {language.identity: language for language in (french(), *built_in)}


def known_languages() -> tuple[Language, ...]:
    """Return the languages that this process knows: the built-in ones, and those it has loaded."""
    return tuple(_known().values())


def find_language(identity: str) -> Language:
    """Return a known language by its identity.

    Raises
    ------
    CueError
        If there is none.
    """
    found = _known().get(identity)
    if found is None:
        names = ", ".join(f"{one.name} ({one.identity})" for one in known_languages())
        raise CueError(f"tables {identity} are of a language that is not here; here are {names}")
    return found
