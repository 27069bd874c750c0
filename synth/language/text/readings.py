"""How the pieces of written French that are not words are read aloud.

Each function takes the match of its pattern and returns words; `RULES` is the list of patterns
and readings in the order of their application by `synth.language.text.normalise`.
"""

import re
from collections.abc import Callable, Iterable

from synth.language.text import numbers
from synth.language.text.lexicon import lookup, lookup_name
from synth.language.text.tables import (
    ABBREVIATIONS,
    CURRENCIES,
    FEMININE_ENDING,
    FEMININE_NOUNS,
    LETTER_NAMES,
    MONTHS,
    SPELLED_SIGLES,
    SPOKEN_SIGLES,
    SYMBOLS,
    UNITS,
)

Match = re.Match[str]
Reading = Callable[[Match], str]


def _integer(text: str) -> int:
    return int(re.sub(r"\D", "", text))


def say_integer(text: str, following: str = "") -> str:
    """Return an integer written with or without separators; leading zeros are said.

    Examples
    --------
    >>> say_integer("1 200"), say_integer("07"), say_integer("21", "heures")
    ('mille deux cents', 'zéro sept', 'vingt et une')
    """
    plain = re.sub(r"\D", "", text)
    if len(plain) > 15:
        return numbers.digits(plain)
    significant = plain.lstrip("0")
    zeros = len(plain) - len(significant)
    if not significant:
        return numbers.digits(plain)
    feminine = following in FEMININE_NOUNS or bool(FEMININE_ENDING.fullmatch(following))
    value = numbers.cardinal(int(significant), feminine=feminine)
    return " ".join([*["zéro"] * zeros, value])


def _number(whole: str, fraction: str | None) -> str:
    if fraction:
        return numbers.decimal(re.sub(r"\D", "", whole), fraction)
    return say_integer(whole)


def _count(m: Match, one: str, many: str, feminine: bool) -> str:
    """Return the number of the groups n and f with the name of the counted things."""
    n = _integer(m["n"])
    name = one if n < 2 else many
    if m["f"] or n > numbers.LARGEST:
        return f" {_number(m['n'], m['f'])} {name} "
    return f" {numbers.cardinal(n, feminine=feminine)} {name} "


def unit(m: Match) -> str:
    """Read a number with a unit: 5 km, 3,5 %."""
    return _count(m, *UNITS[m["u"]])


def amount(m: Match) -> str:
    """Read a sum of money: 3,50 €, 2 millions €, $5."""
    one, many, feminine = CURRENCIES[m["c"]]
    de = f"d'{many}" if many[0] in "aeiouy" else f"de {many}"
    if m["s"]:
        return f" {_number(m['n'], m['f'])} {m['s']} {de} "
    n = _integer(m["n"])
    if n and n % 10**6 == 0 and not m["f"]:
        many = de
    if not m["f"] or len(m["f"]) != 2 or n > numbers.LARGEST:
        return _count(m, one, many, feminine)
    cents = f"{numbers.cardinal(int(m['f']))} " if int(m["f"]) else ""
    return f" {numbers.cardinal(n, feminine=feminine)} {one if n < 2 else many} {cents}"


def hour(m: Match) -> str:
    """Read a time of day or a duration: 20h30, 8 h, 12:05:30."""
    hours, minutes, seconds = (int(m[i] or 0) for i in (1, 2, 3))
    if minutes > 59 or seconds > 59:
        return str(m[0])
    said = [numbers.cardinal(hours, feminine=True), "heure" if hours < 2 else "heures"]
    if minutes:
        said.append(numbers.cardinal(minutes, feminine=True))
    if seconds:
        said += ["et", numbers.cardinal(seconds, feminine=True), "secondes"]
    return f" {' '.join(said)} "


def date(m: Match) -> str:
    """Read a date in figures: 14/07/1789, 1.1.2000."""
    day, month = int(m[1]), int(m[2])
    if not (1 <= day <= 31 and 1 <= month <= 12):
        return str(m[0])
    name = "premier" if day == 1 else numbers.cardinal(day)
    return f" {name} {MONTHS[month - 1]} {numbers.cardinal(int(m[3]))} "


def telephone(m: Match) -> str:
    """Read a telephone number by pairs, with pauses."""
    plain = re.sub(r"\D", "", m[0])
    pairs = re.findall(r"\d\d", plain if plain[0] == "0" else plain[3:])
    head = [] if plain[0] == "0" else [f"plus trente-trois {numbers.digits(plain[2])}"]
    return f" {' , '.join([*head, *map(say_integer, pairs)])} "


def ordinal(m: Match) -> str:
    """Read an ordinal: 1er, 2e, 3ème, XIXe, 2nde."""
    n = numbers.roman(m[1]) if m[1].isalpha() else _integer(m[1])
    suffix: str = m[2]
    if not 0 < n <= numbers.LARGEST:
        return str(m[0])
    plural = "s" if suffix.endswith("s") else ""
    if suffix.startswith("nd"):
        return f" seconde{plural} " if "e" in suffix else f" second{plural} "
    return f" {numbers.ordinal(n, feminine=suffix.startswith(('re', 'ère')))}{plural} "


def short_date(m: Match) -> str:
    """Read a day and a month in figures after its article: le 11/09, du 1/5."""
    day, month = int(m[2]), int(m[3])
    if not (1 <= day <= 31 and 1 <= month <= 12):
        return str(m[0])
    name = "premier" if day == 1 else numbers.cardinal(day)
    return f"{m[1]} {name} {MONTHS[month - 1]} "


def free_call(m: Match) -> str:
    """Read a telephone number by threes, with pauses: 0 800 123 456."""
    plain = re.sub(r"\D", "", m[0])
    groups = [f"zéro {numbers.cardinal(int(plain[1:4]))}", *re.findall(r"\d{3}", plain[4:])]
    return f" {' , '.join([groups[0], *map(say_integer, groups[1:])])} "


def height(m: Match) -> str:
    """Read a length in metres and centimetres: 1m80, 1 m 80."""
    n = _integer(m[1])
    return f" {numbers.cardinal(n)} {'mètre' if n < 2 else 'mètres'} {say_integer(m[2])} "


def scaled(m: Match) -> str:
    """Read a number of millions or milliards written short before a noun: 2,5 M d'euros."""
    name = "million" if m["s"] == "M" else "milliard"
    return f" {_number(m['n'], m['f'])} {name}{'s' if _integer(m['n']) > 1 else ''} "


def mixed(m: Match) -> str:
    """Read letters and figures in one word: M6, 3D, H1N1, CO2, C-3PO, COP21."""
    pieces = re.findall(r"[^\W\d_]+|\d+", m[0])
    return f" {' '.join(map(_mixed_piece, pieces))} "


def _mixed_piece(piece: str) -> str:
    if piece.isdigit():
        return say_integer(piece)
    return piece.lower() if piece.lower() in SPOKEN_SIGLES else spell(piece)


def regnal(m: Match) -> str:
    """Read a Roman numeral after a name or the part of a book: Louis XIV, chapitre IV."""
    n = numbers.roman(m[2])
    single = len(m[2]) == 1 and m[2] not in "VX"
    return str(m[0]) if not n or single or n > 50 else f"{m[1]} {numbers.cardinal(n)}"


def fraction(m: Match) -> str:
    """Read a fraction or a score out of something: 1/2, 3/4, 15/20."""
    top, bottom = m[1], m[2]
    names = {"2": "demi", "3": "tiers", "4": "quart"}
    if bottom not in names and not (bottom.isdigit() and 5 <= int(bottom) <= 10):
        return f" {say_integer(top)} sur {say_integer(bottom)} "
    if len(top) > 1 or top == "0":
        return f" {say_integer(top)} sur {say_integer(bottom)} "
    name = names.get(bottom) or numbers.ordinal(int(bottom))
    plural = "s" if int(top) > 1 and not name.endswith("s") else ""
    return f" {numbers.cardinal(int(top))} {name}{plural} "


def plain_number(m: Match) -> str:
    """Read any other number; before some feminine nouns one is une."""
    following = (m["w"] or "").strip().lower()
    said = _number(m["n"], m["f"]) if m["f"] else say_integer(m["n"], following)
    return f" {said}{m['w'] or ' '}"


def address(m: Match) -> str:
    """Read an address of the net: jean@site.fr, www.arte.tv."""
    text = re.sub(r"^https?://", "", m[0].lower()).rstrip("/")
    pieces = re.findall(r"[^\W\d_]+|\d+|[.@/_-]", text)
    signs = {".": "point", "@": "arobase", "/": "barre oblique", "_": "tiret bas", "-": "tiret"}
    return f" {' '.join(signs.get(p) or _address_piece(p) for p in pieces)} "


def _address_piece(piece: str) -> str:
    if piece == "www":
        return "trois double vé"
    if len(piece) > 2 or piece.isdigit():
        return piece
    return spell(piece)


def spell(letters: str) -> str:
    """Return the names of letters.

    Examples
    --------
    >>> spell("tgv")
    'té gé vé'
    """
    return " ".join(LETTER_NAMES.get(letter, letter) for letter in letters.lower())


_C, _V = "[bcçdfghjklmnpqrstvwxz]", "[aeiouyàâéèêëîïôùû]"
_READABLE = re.compile(f"{_C}{{0,2}}{_V}{{1,2}}(?:{_C}{{1,2}}{_V}{{1,2}})*(?:[rlns]?{_C})?")
"""Words that do not ask to be spelled: no long runs, no strange end."""


def sigle(m: Match) -> str:
    """Read a word in capitals: as a word if it is one, else letter by letter."""
    letters = re.sub("[.-]", "", m[0])
    word = letters.lower()
    vowels = re.search("[aeiouyàâéèêëîïôùû]", word)
    if set(letters) <= set("IVX") and numbers.roman(letters):
        return f" {numbers.cardinal(numbers.roman(letters))} "
    if word in SPELLED_SIGLES:
        return f" {spell(word)} "
    if word in SPOKEN_SIGLES or (vowels and "." not in m[0] and lookup(word)):
        return word
    if len(word) > 3 and _READABLE.fullmatch(word):
        return word
    return f" {spell(word)} "


def _fixed(said: str) -> Reading:
    return lambda _: f" {said} "


def _any_of(words: Iterable[str]) -> str:
    return "|".join(sorted(map(re.escape, words), key=len, reverse=True))


_SET_ASIDE = "\U00020000-\U0002ffff"
"""Letters that stand for names which a capital shows (`synth.language.text.normalise`)."""


def _is_word(word: str) -> bool:
    return bool(lookup(word) or lookup_name(word))


_INTEGER = r"\d{1,3}(?:[ .]\d{3})+(?!\d)|\d+"
_N = rf"(?<![\w,.])(?P<n>{_INTEGER})(?:,(?P<f>\d+))?"
_SCALE = r"(?:(?P<s>millions?|milliards?|milliers?) ?)?"
_MONTH = "|".join(MONTHS)

_PATTERNS: list[tuple[str, Reading]] = [
    (r"(?:https?://|www\.)[\w./-]*[\w/]|[\w.+-]+@[\w-]+(?:\.[\w-]+)+", address),
    (r"\b[\w-]+\.(?:fr|com|org|net|tv|eu)\b(?!\.\w)", address),
    (r"(?<!\d)(?:\+33 ?\d|0\d)(?:[ .]?\d\d){4}(?!\d)", telephone),
    (r"(?<![\d,.] )(?<!\d)0 ?8\d\d(?: \d{3}){2}(?!\d)", free_call),
    (r"(?<!\d)(\d{1,2}) ?[hH] ?/ ?(\d{1,2})(?![\w/])",
     lambda m: f" {numbers.cardinal(int(m[1]), feminine=True)} heures sur {say_integer(m[2])} "),
    (r"(?<!\d)(\d) ?j(?:ours?)? ?/ ?(\d)(?![\w/])",
     lambda m: f" {say_integer(m[1])} jours sur {say_integer(m[2])} "),
    (r"(?<![\d,.])(\d) ?m ?(\d\d)(?![\w,.]\d|\w)", height),
    (r"\b([Ll]e|[Dd]u|[Aa]u) (\d{1,2})/(\d{1,2})(?![\d/])", short_date),
    *((pattern.replace("[A-ZÉ", f"[{_SET_ASIDE}A-ZÉ"), _fixed(said))
      for pattern, said in ABBREVIATIONS),
    (r"(?<=\d) ?[x×] ?(?=\d)", _fixed("fois")),
    (rf"(?<![\w,.])(?P<n>{_INTEGER}) ?(?P<c>[€$£])(?P<f>\d\d)(?P<s>(?!))?(?!\d)", amount),
    (r"(?<![\w'-])([B-DF-HJ-NP-TV-XZ])([A-Z][a-z]{2,})\b",
     lambda m: f" {spell(m[1])} {m[2]}" if not _is_word(m[0].lower()) else m[0]),
    (r"(?<![\d,])(\d{1,2}) ?[hH] ?(\d\d)(?:(?: ?m| ?mn| ?min)? ?(\d\d) ?s)?(?: ?min| ?mn)?(?!\w)",
     hour),
    (r"(?<![\d,])(\d{1,2}) ?[hH](?!\w)()()", hour),
    (r"(?<![\d:])(\d{1,2}):(\d\d)(?::(\d\d))?(?![\d:])", hour),
    (r"(?<![\d/])(\d{1,2})/(\d{1,2})/(\d{4}|\d\d)(?![\d/])", date),
    (r"(?<![\d.])(\d{1,2})\.(\d{1,2})\.(\d{4})(?![\d.])", date),
    (rf"(?<!\d)\b1(?= (?:{_MONTH})\b)", _fixed("premier")),
    (rf"\b({_INTEGER}|[IVX]+)(ers?|ères?|res?|nde?s?|i?[eè]mes?|es?)\b(?!')", ordinal),
    (r"(?<![\w)])-(?=\d)", _fixed("moins")),
    (rf"{_N} ?(?P<s>M|Mds?|Mrds?)(?= (?:d'|de ))", scaled),
    (rf"{_N} ?{_SCALE}(?P<c>{_any_of(CURRENCIES)})(?!\w)", amount),
    (rf"(?<!\w)(?P<c>[$£€]) ?(?P<n>{_INTEGER})(?:[.,](?P<f>\d+))?(?P<s>(?!))?", amount),
    (rf"{_N} ?(?P<u>{_any_of(UNITS)})(?![\w'])", unit),
    (r"(?<![\w/])(\d+)/(\d+)(?![\w/])", fraction),
    (r"\b([A-ZÉ][\w-]+|chapitre|tome|acte|scène|livre|siècle) ([IVXLCDM]+)\b", regnal),
    (r"(?<![\w'-])[A-Z]{1,3}(?:-?\d+|\d+(?:[A-Z]{1,2}\d*)*|-\d+[A-Z]{1,2})"
     r"(?:-[A-Z]{1,2}\d+)?(?![\w%°])", mixed),
    (r"(?<=')[A-Z]{1,3}-?\d+(?:[A-Z]{1,2}\d*)*(?![\w%°])", mixed),
    (r"(?<![\w-])(?:\d[A-Z](?:\d[A-Z])*|(?:COP|COVID)-?\d+|[Cc]ovid-\d+)(?![\w%°])", mixed),
    (r"(?<=\d)-(?=\d)", _fixed("")),
    (rf"{_N}(?P<w> ?[^\W\d_]+)?", plain_number),
    (r"\d+", lambda m: f" {say_integer(m[0])} "),
    *((re.escape(sign), _fixed(said)) for sign, said in SYMBOLS.items()),
    (r"\b(?:[A-ZÉ]\.-?){2,}", sigle),
    (r"(?<![\w-])[A-ZÀ-Ý]{2,}(?!\w)", sigle),
    (r"(?<![\w'’-])[B-DF-HJ-NP-TV-XZ](?![\w'’-])\.?", lambda m: f" {spell(m[0][0])} "),
]  # fmt: skip

RULES = [(re.compile(pattern), reading) for pattern, reading in _PATTERNS]
"""Patterns and their readings, in order of application."""
