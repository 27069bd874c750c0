"""Written French to words: everything that is not a word is spelled out.

In: a line of text as subtitles have it.  Out: a list of tokens, lower-case words (an elided word
keeps its apostrophe: ``l'``, ``qu'``; words joined by a hyphen stay one token) and the marks ``,``
(a short pause) and ``.``, ``!``, ``?`` (a long one, by the sentence that it ends). Text in capitals
without accents, as teletext and titles have it, gets its accents back.
"""

import functools
import re
import unicodedata
from collections.abc import Collection

from synth.language.text.colloquial import clipped
from synth.language.text.lexicon import capital_names, known_words, lookup, lookup_name
from synth.language.text.readings import RULES
from synth.language.text.shouting import is_shouted, lowered
from synth.language.text.stretched import shortened

SHORT_PAUSE, LONG_PAUSE = ",", "."
EXCLAIMED, ASKED = "!", "?"
PAUSES = (SHORT_PAUSE, LONG_PAUSE, EXCLAIMED, ASKED)
"""Of several marks in a row the last one here counts: « Quoi ?! » is asked."""

_TRANSLATION = str.maketrans(
    dict.fromkeys("\u00a0\u2007\u2009\u202f\t\r\n_|~*^[]{}\\", " ")
    | dict.fromkeys("’ʼ‘`´′＇", "'")
    | dict.fromkeys("‐‑‒−", "-")
    | dict.fromkeys("\u00ad\ufeff\u200b\u200e\u200f")
    | {"—": " , ", "–": " , ", "…": " ... ", "ﬁ": "fi", "ﬂ": "fl"}
    | {"？": "?", "！": "!", "⁇": "?", "⁈": "?", "⁉": "?", "‽": "?"}
)

_TOKEN = re.compile(r"[^\W\d_]+(?:[-'][^\W\d_]+)*'?|\.{2,}|[,;:.?!()«»\"]")
_WHOLE_WORD = re.compile(r"[^\W_]+(?:[-.&+][^\W_]+)*")
_INSIDE = re.compile(r"[a-zà-ÿœ,][ ']\Z")
_RARE_LETTERS = 0x20000
"""Ideographs of an extension: letters that no French text has."""

_ELIDED = re.compile(r"(?:c|ç|d|j|l|m|n|s|t|y|z|qu|jusqu|lorsqu|puisqu|quoiqu|quelqu|presqu|entr)'")


def normalise(text: str, own: Collection[str] = ()) -> list[str]:
    """Return the tokens of `text`.

    Parameters
    ----------
    text : str
    own : collection of str
        Lower-case words that are one token as they stand, whatever rule would read them
        otherwise: those of the user's lexicon.

    Examples
    --------
    >>> " ".join(normalise("M. Dupont arrive à 20h30, n° 3."))
    'monsieur dupont arrive à vingt heures trente , numéro trois .'
    >>> normalise("Aujourd’hui, l'homme qu'on attend…")
    ["aujourd'hui", ',', "l'", 'homme', "qu'", 'on', 'attend', '.']
    """
    line = _plain(unicodedata.normalize("NFC", text)).translate(_TRANSLATION)
    line, kept = _set_aside(_whole_names(line), own)
    line = shortened(_lower_shouting(line))
    for pattern, reading in RULES:
        line = pattern.sub(reading, line)
    line = "".join(" " if sign.isdigit() else sign for sign in line.lower())
    tokens: list[str] = []
    for piece in _TOKEN.findall(line):
        if piece[0].isalpha():
            tokens += _words(piece)
        elif tokens:
            _add_pause(tokens, piece[0] if piece[0] in PAUSES else SHORT_PAUSE)
    return [kept.get(token, token) for token in tokens]


def _plain(text: str) -> str:
    """Return a text with ordinary letters and digits for those of other widths and weights."""
    return "".join(
        unicodedata.normalize("NFKC", sign)
        if not sign.isascii() and unicodedata.category(sign) in ("Lu", "Ll", "Nd")
        else sign
        for sign in text
    )


_CAPITALS = re.compile(
    r"(?<![\w-])[A-ZÀ-Ý][\w'’]+(?: (?:de|du|des|sur|en|la|le|les) (?=[A-ZÀ-Ý])| (?=[A-ZÀ-Ý]))"
    r"(?:[A-ZÀ-Ý][\w']+(?: (?:de|du|des|sur|en|la|le|les) (?=[A-ZÀ-Ý])| (?=[A-ZÀ-Ý]))?)+"
)


def _whole_names(line: str) -> str:
    """Return a line whose names of several words that the lists know have hyphens.

    Examples
    --------
    >>> _whole_names("À Buenos Aires ou San Francisco")
    'À Buenos-Aires ou San-Francisco'
    """
    return line if is_shouted(line) else _CAPITALS.sub(_hyphenated, line)


def _hyphenated(match: re.Match[str]) -> str:
    words = match[0].split(" ")
    joined: list[str] = []
    while words:
        for count in range(min(len(words), 4), 0, -1):
            name = "-".join(words[:count])
            if count == 1 or lookup_name(name.lower()) or lookup(name.lower()):
                joined.append(name)
                words = words[count:]
                break
    return " ".join(joined)


def _is_verb_alone(word: str) -> bool:
    """Whether a word is only an infinitive of the lexicon: a capital then opens a name."""
    classes = {letter for variant in lookup(word) for letter in variant.classes}
    return classes == {"V"} and word.endswith("er")


def _set_aside(line: str, own: Collection[str]) -> tuple[str, dict[str, str]]:
    """Return a line with rare letters in place of the user's words, and a map of these.

    So do they for names that are words as well, such as Damas, where a capital inside a sentence
    marks them; those keep it.
    """
    kept: dict[str, str] = {}

    # Longest names first, so that none is cut by a shorter one.
    for phrase in sorted((word for word in own if " " in word), key=len, reverse=True):
        letter = chr(_RARE_LETTERS + len(kept))
        line, found = re.subn(rf"(?<!\w){re.escape(phrase)}(?!\w)", letter, line, flags=re.I)
        if found:
            kept[phrase] = letter

    # A letter that no French text has passes every later rule unchanged.
    def aside(match: re.Match[str]) -> str:
        word = match[0].lower()
        if word not in own:
            if not match[0].istitle() or word not in capital_names():
                return match[0]
            if not (_INSIDE.search(line[: match.start()]) or _is_verb_alone(word)):
                return match[0]
            word = match[0]
        return kept.setdefault(word, chr(_RARE_LETTERS + len(kept)))

    marked = _WHOLE_WORD.sub(aside, line)
    return marked, {letter: word for word, letter in kept.items()}


def _lower_shouting(line: str) -> str:
    """Return a line in capitals in lower case: its capitals do not mark sigles.

    Where no capital bears an accent, they are missing.
    """
    if not is_shouted(line):
        return line
    lower = lowered(line)
    return lower if without_accents(line) != line else accented(lower)


def _add_pause(tokens: list[str], mark: str) -> None:
    """Append a pause; of two in a row the more specific one stays."""
    if tokens[-1] not in PAUSES:
        tokens.append(mark)
    else:
        tokens[-1] = max(tokens[-1], mark, key=PAUSES.index)


def _words(piece: str) -> list[str]:
    """Split the elided words off a run of letters, hyphens and apostrophes.

    Examples
    --------
    >>> _words("qu'aujourd'hui"), _words("l'ex-champion"), _words("p'tit")
    (["qu'", "aujourd'hui"], ["l'", 'ex-champion'], ["p'tit"])
    """
    words = []
    while not _is_listed(piece) and (elided := _ELIDED.match(piece)):
        words.append(elided[0])
        piece = piece[elided.end() :]
    if piece:
        words.append(piece if _is_listed(piece) else piece.rstrip("'"))
    return words


def _is_listed(piece: str) -> bool:
    """Whether a word with its apostrophe is known, as it stands or clipped."""
    name = "'" in piece and lookup_name(piece)
    return bool(lookup(piece) or name or (piece.endswith("'") and clipped(piece)))


_WORD = re.compile(r"[^\W\d_]+")
_AUXILIARIES = frozenset(
    "ai as a avons avez ont avais avait avions aviez avaient aurai auras aura aurons aurez auront "
    "aurait auraient avoir ayant suis es est sommes sont étais était étions étiez étaient sera "
    "serai seras serez seront serait seraient fut furent être été étant".split()
)
_BETWEEN = frozenset("pas plus jamais rien bien mal tout déjà encore toujours été".split())


def accented(line: str) -> str:
    """Return a line in lower case with its accents.

    Examples
    --------
    >>> accented("l'ete dernier, il a mange avec le president")
    "l'été dernier, il a mangé avec le président"
    >>> accented("il mange tres peu")
    'il mange très peu'
    """
    said: list[str] = []

    def restore(match: re.Match[str]) -> str:
        if match[0].isupper():
            return match[0]
        said.append(_restored(match[0], said))
        return said[-1]

    return _WORD.sub(restore, line)


def _restored(word: str, said: list[str]) -> str:
    candidates = _index().get(word, ())
    participles = [c for c in candidates if re.search("ée?s?$", c)]
    before = [w for w in said[-3:] if w not in _BETWEEN]
    if participles and before and before[-1] in _AUXILIARIES:
        return participles[0]
    if lookup(word) or not candidates:
        return word
    return next((c for c in candidates if c not in participles), candidates[0])


def accent_candidates(word: str) -> tuple[str, ...]:
    """Return the words with accents whose letters are those of `word`."""
    return _index().get(word, ())


@functools.cache
def _index() -> dict[str, tuple[str, ...]]:
    """Return the words that bear accents by their letters without them."""
    index: dict[str, tuple[str, ...]] = {}
    for word in known_words():
        if not word.isascii() and (plain := without_accents(word)) != word:
            index[plain] = (*index.get(plain, ()), word)
    return index


def without_accents(text: str) -> str:
    """Return a text without its accents.

    Examples
    --------
    >>> without_accents("Ça, déjà l'été")
    "Ca, deja l'ete"
    """
    parts = unicodedata.normalize("NFD", text)
    return "".join(sign for sign in parts if not unicodedata.combining(sign))
