"""Numbers as French words: cardinals, ordinals, decimals, Roman numerals.

In: integers and strings of digits.  Out: words separated by spaces, hyphens inside compound
numbers only where the lexicon of pronunciations expects them apart anyway, so none.
"""

import re

from codec.errors import CueError

UNITS = (
    "zéro un deux trois quatre cinq six sept huit neuf dix onze douze treize quatorze quinze "
    "seize dix-sept dix-huit dix-neuf"
).split()
TENS = "vingt trente quarante cinquante soixante soixante quatre-vingt quatre-vingt".split()
SCALES = ((10**12, "billion"), (10**9, "milliard"), (10**6, "million"))

LARGEST = 10**15 - 1
"""Largest number that has French words here."""

ORDINAL_STEMS = {"quatre": "quatr", "cinq": "cinqu", "neuf": "neuv"}

ROMAN = {"I": 1, "V": 5, "X": 10, "L": 50, "C": 100, "D": 500, "M": 1000}
_ROMAN_FORM = re.compile(r"M{0,3}(CM|CD|D?C{0,3})(XC|XL|L?X{0,3})(IX|IV|V?I{0,3})")


def cardinal(n: int, *, feminine: bool = False) -> str:
    """Return the integer `n` in words, |n| < 10**15.

    Raises
    ------
    CueError
        If `n` is too large to be read as a number.

    Examples
    --------
    >>> cardinal(71), cardinal(80), cardinal(21, feminine=True)
    ('soixante et onze', 'quatre-vingts', 'vingt et une')
    >>> cardinal(1_234_567)
    'un million deux cent trente-quatre mille cinq cent soixante-sept'
    """
    if abs(n) > LARGEST:
        raise CueError(f"number {n} is larger than {LARGEST}")
    if n < 0:
        return f"moins {cardinal(-n, feminine=feminine)}"
    if n == 0:
        return UNITS[0]
    words = []
    for scale, name in SCALES:
        count, n = divmod(n, scale)
        if count:
            words.append(f"{cardinal(count)} {name}{'s' if count > 1 else ''}")
    thousands, n = divmod(n, 1000)
    if thousands:
        words.append("mille" if thousands == 1 else f"{_below_1000(thousands, plural=False)} mille")
    if n:
        words.append(_below_1000(n, plural=True))
    text = " ".join(words)
    return f"{text}e" if feminine and text.endswith("un") else text


def _below_1000(n: int, *, plural: bool) -> str:
    hundreds, rest = divmod(n, 100)
    words = []
    if hundreds:
        name = "cents" if hundreds > 1 and not rest and plural else "cent"
        words.append(name if hundreds == 1 else f"{UNITS[hundreds]} {name}")
    if rest:
        words.append(_below_100(rest, plural=plural))
    return " ".join(words)


def _below_100(n: int, *, plural: bool) -> str:
    if n < 20:
        return UNITS[n]
    tens, unit = divmod(n, 10)
    name = TENS[tens - 2]
    if tens in (7, 9):
        unit += 10
    if not unit:
        return f"{name}s" if tens == 8 and plural else name
    link = " et " if unit in (1, 11) and tens < 8 else "-"
    return f"{name}{link}{UNITS[unit]}"


def ordinal(n: int, *, feminine: bool = False) -> str:
    """Return the ordinal of a positive integer.

    Examples
    --------
    >>> ordinal(1), ordinal(1, feminine=True), ordinal(21), ordinal(80)
    ('premier', 'première', 'vingt et unième', 'quatre-vingtième')
    """
    if n < 1:
        raise CueError(f"no ordinal of {n}: it is below 1")
    if n == 1:
        return "première" if feminine else "premier"
    text = cardinal(n)
    if text.endswith(("cents", "vingts", "millions", "milliards")):
        text = text[:-1]
    for end, stem in ORDINAL_STEMS.items():
        if text.endswith(end):
            text = text[: -len(end)] + stem
    return f"{text.removesuffix('e')}ième"


def decimal(whole: str, fraction: str) -> str:
    """Return a decimal number; zeros after the comma are said one by one.

    Examples
    --------
    >>> decimal("3", "14"), decimal("0", "05")
    ('trois virgule quatorze', 'zéro virgule zéro cinq')
    """
    significant = fraction.lstrip("0")
    zeros = [UNITS[0]] * (len(fraction) - len(significant))
    tail = [digits(significant) if len(significant) > 3 else cardinal(int(significant or 0))]
    return " ".join([cardinal(int(whole)), "virgule", *zeros, *(tail if significant else [])])


def digits(text: str) -> str:
    """Return a string of digits said one by one.

    Examples
    --------
    >>> digits("007")
    'zéro zéro sept'
    """
    return " ".join(UNITS[int(digit)] for digit in text)


def roman(text: str) -> int:
    """Return the value of a Roman numeral in capitals, 0 if `text` is none.

    Examples
    --------
    >>> roman("XIV"), roman("IIX")
    (14, 0)
    """
    if not text or not _ROMAN_FORM.fullmatch(text):
        return 0
    values = [ROMAN[letter] for letter in text]
    following = [*values[1:], 0]
    return sum(-v if v < after else v for v, after in zip(values, following, strict=True))
