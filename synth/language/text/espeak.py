"""Phones of words that no lexicon knows, from the espeak-ng library.

espeak-ng (GPL-3) comes as a shared library through the wheel of espeakng-loader and is called
through ctypes as a separate part at run time.  Its symbols are mapped onto the 38 phones; its
known faults in French (the vowel of -ouent, no ɥ, English words in an English voice) are mended.
"""

import ctypes
import functools
import re
from itertools import pairwise
from typing import Any

from codec.cues.phonology import PHONES
from codec.errors import CueError
from synth.language.text.lexicon import split_ipa

_AUDIO_OUTPUT_SYNCHRONOUS = 2
"""Numbers of espeak-ng's interface (speak_lib.h), as are those below."""

_PHONEME_EVENTS, _PHONEME_IPA_EVENTS, _DONT_EXIT = 0x0001, 0x0002, 0x8000
"""Flags of its start."""

_OPTIONS = _PHONEME_EVENTS | _PHONEME_IPA_EVENTS | _DONT_EXIT
RATE_HZ = 22_050
"""Sampling rate of the library's voices."""

_CHARS_UTF8 = 1
"""Code of espeak-ng for text in UTF-8."""

_PHONEMES_IPA = 0x02
"""Code of espeak-ng for phones named by IPA."""

_VOWELS = frozenset("aeiouyøœəɛɔɑ")

FOREIGN = {
    "r": "ʁ", "ɹ": "ʁ", "ɾ": "ʁ", "ʀ": "ʁ", "x": "ʁ", "χ": "ʁ", "h": "", "ʔ": "", "θ": "s",
    "ð": "z", "ɫ": "l", "ʎ": "j", "β": "b", "ɣ": "g", "ɡ": "g", "ç": "ʃ", "ɸ": "f", "ʍ": "w",
    "ɪ": "i", "ɨ": "i", "ᵻ": "i", "ʊ": "u", "ʌ": "œ", "ɐ": "a", "æ": "a", "ɒ": "ɔ", "ɜ": "œ",
    "ɝ": "œ", "ɚ": "œ", "ɤ": "ø", "ʏ": "y", "ɘ": "ə", "õ": "ɔ̃", "ã": "ɑ̃", "ẽ": "ɛ̃",
}  # fmt: skip
"""Sounds that French lacks, and their replacements in a French mouth; "" is not spoken."""


@functools.cache
def _library() -> ctypes.CDLL:
    import espeakng_loader

    return load(espeakng_loader.get_library_path())


def load(path: str) -> ctypes.CDLL:
    """Return the library in the file `path`, its French voice set.

    Raises
    ------
    CueError
        If it does not load.
    """
    import espeakng_loader

    try:
        loaded = ctypes.CDLL(path)
    except OSError as error:
        raise CueError(f"cannot load the espeak-ng library: {error}") from error
    loaded.espeak_TextToPhonemes.restype = ctypes.c_char_p
    data = espeakng_loader.get_data_path().encode()
    rate = loaded.espeak_Initialize(_AUDIO_OUTPUT_SYNCHRONOUS, 0, data, _OPTIONS)
    if rate != RATE_HZ or loaded.espeak_SetVoiceByName(b"fr") != 0:
        raise CueError(f"espeak-ng does not give its French voice at {RATE_HZ} Hz")
    return loaded


def transcribe(word: str) -> tuple[str, ...]:
    """Return the phones that espeak-ng gives a French reading of `word`.

    Parameters
    ----------
    word : str
        Lower-case letters; the result is () if nothing of it is spoken.

    Raises
    ------
    CueError
        If the library does not load.

    Examples
    --------
    >>> "".join(transcribe("mouchouent"))
    'muʃu'
    >>> "".join(transcribe("nuager"))
    'nɥaʒe'
    """
    if opening := re.match("sch(?=[bcdflmnprtvw])", word):
        return ("ʃ", *transcribe(word[opening.end() :]))
    word = _neighbours(word)
    ipa = _ipa(_respell(word))
    if "(en)" in ipa:
        ipa = _ipa(_as_french(_respell(word)))
    phones = _single(to_phones(ipa))
    return _palatal(word, phones) if "gn" in word else phones


_LETTERS = {
    "č": "tch", "ć": "tch", "š": "ch", "ž": "j", "đ": "dj", "ł": "l", "ğ": "g", "ş": "ch",
    "ı": "i", "ń": "nn", "ę": "è", "ą": "on", "ř": "rj", "ě": "ié", "ů": "ou", "ő": "eu",
    "ű": "u", "ß": "ss", "å": "o", "ø": "eu", "ã": "an", "õ": "on", "ț": "ts", "ţ": "ts",
    "ș": "ch", "ă": "a", "ż": "j", "ź": "z", "ś": "ch", "ó": "o", "á": "a", "í": "i",
    "ú": "ou", "ý": "i", "ň": "gn", "ð": "d", "þ": "t", "ľ": "l", "ď": "d", "ť": "t", "ē": "é",
    "ā": "a", "ī": "i", "ō": "o", "ū": "ou",
}  # fmt: skip
"""Letters of neighbouring languages, as French speakers read them."""


def _neighbours(word: str) -> str:
    """Return a word with French letters for those of neighbouring languages.

    Examples
    --------
    >>> _neighbours("pogačar"), _neighbours("vlahović"), _neighbours("lewandowski")
    ('pogatchar', 'vlahovitch', 'levandovski')
    """
    if re.search("[čćšžđ]", word):
        word = re.sub("c(?![hkiey])", "ts", word.replace("u", "ou")).replace("e", "é")
    if re.search("[łńęąśźż]|[oe]wsk[ia]$|ewicz$", word):
        word = word.replace("cz", "tch").replace("sz", "ch").replace("w", "v")
    return "".join(_LETTERS.get(letter, letter) for letter in word)


def _single(phones: tuple[str, ...]) -> tuple[str, ...]:
    """Return phones without consonants said twice, as the library does with kk and zz.

    Examples
    --------
    >>> _single(("a", "k", "k", "u", "a", "a"))
    ('a', 'k', 'u', 'a', 'a')
    """
    return tuple(
        phone for before, phone in pairwise(["", *phones]) if phone != before or phone in _VOWELS
    )


def _ipa(word: str) -> str:
    """Return the library's reading of a word, in its IPA."""
    loaded = _library()
    text = ctypes.c_char_p(word.encode())
    pointer: Any = ctypes.cast(text, ctypes.c_void_p)
    ipa = b""
    while pointer.value:
        ipa += b" " + (
            loaded.espeak_TextToPhonemes(
                ctypes.byref(pointer), _CHARS_UTF8, _PHONEMES_IPA | ord("_") << 8
            )
            or b""
        )
    return ipa.decode()


def _respell(word: str) -> str:
    """Return a word spelled so that the library reads it as French, with the ends of names.

    Common words with these ends stand in the lexicon. T before i is s there, unless s or x comes
    before it.

    Examples
    --------
    >>> [_respell(word) for word in ("artaxerxès", "dioclétien", "sébastien", "croatie", "hélios")]
    ['artaxerxèsse', 'dioclécien', 'sébastien', 'croacie', 'héliosse']
    """
    word = re.sub(r"ouent$", "oue", word.replace("sch", "ch"))
    word = re.sub(r"(?<=[bcdfgklmnprtvxz])([iou]|è)s$", r"\1sse", word)
    word = re.sub(r"ios$", "iosse", word)
    word = re.sub(r"(?<=[^sx])tien(nes?|s?)$", r"cien\1", word)
    word = re.sub(r"([aéo]|en)tie(s?)$", r"\1cie\2", word)
    if _FOREIGN_SIGN.search(word):
        word = re.sub(r"(?<=[^aeiouyé])er$", "ère", word)
        word = re.sub(r"ey$", "i", word)
    return word


_FOREIGN_SIGN = re.compile(r"[kw]|th|sh|tz|oo|ee|(.)\1er$")


def _as_french(word: str) -> str:
    """Return a word without the spellings that make the library change to English.

    Examples
    --------
    >>> _as_french("kathy"), _as_french("mohandy")
    ('kati', 'moandi')
    """
    for pattern, letters in _FRENCH_SPELLINGS:
        word = pattern.sub(letters, word)
    return word


_FRENCH_SPELLINGS = tuple(
    (re.compile(pattern), letters)
    for pattern, letters in (
        ("th", "t"), ("sh", "ch"), ("ph", "f"), ("ee|ea(?!u)", "i"), ("oo", "ou"), ("ck", "k"),
        ("(?<=[aeiouyé])h(?=[aeiouyé])", ""), ("(?<=.)y(?![aeiouéè])", "i"),
        ("(?<=[aeo])w(?![aeiouyé])", "ou"), ("w(?=[aeiouyé])", "ou"), ("oing$", "oin"),
        ("([aeiou])h$", r"\1"),
    )
)  # fmt: skip


def _palatal(word: str, phones: tuple[str, ...]) -> tuple[str, ...]:
    """Return phones with one phone for gn, which the library says as n and j in some words."""
    if re.search("gni[aeou]", word):
        return phones
    line = " ".join(phones).replace("n j", "ɲ").replace("g n", "ɲ")
    return tuple(line.split())


def to_phones(ipa: str) -> tuple[str, ...]:
    """Map a string of IPA as espeak-ng writes it to phones.

    Language switches, stress and length marks and separators are dropped, foreign sounds
    replaced, y before a vowel becomes ɥ.

    Examples
    --------
    >>> to_phones("p_y_i"), to_phones("(en)t_ʃ_ˈeɪ_n_dʒ(fr)")
    (('p', 'ɥ', 'i'), ('t', 'ʃ', 'e', 'i', 'n', 'd', 'ʒ'))
    """
    plain = re.sub(r"\([a-z-]+\)|[ˈˌːˑ_\-\s‿.|ʲʰʷ\u0329\u032f\u0361]", "", ipa)
    phones = []
    for sound in split_ipa(plain):
        phone = sound if sound in PHONES[1:] else FOREIGN.get(sound, FOREIGN.get(sound[0], ""))
        if phone:
            phones.append(phone)
    return tuple(
        "ɥ" if here == "y" and after[:1] in _VOWELS else here
        for here, after in pairwise([*phones, ""])
    )
