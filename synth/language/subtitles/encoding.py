"""Bytes of a subtitle file to text, its encoding guessed.

A byte order mark decides; else UTF-16 betrays itself by its zeros, UTF-8 by its strict form;
what remains is an old 8-bit code, and the one whose letters look most French wins.
"""

import codecs
import re

from codec.errors import CueError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_OLD = ("cp1252", "iso-8859-15", "cp850", "mac-roman")
_CONTROL = re.compile(r"[^\t\n\r\f\v -\U0010ffff]")
_MOST_DAMAGE = 0.02
"""Share of letters that may be damaged in a text that is still read."""

_FRENCH = frozenset("àâäçéèêëîïôöùûüÿœæÀÂÇÉÈÊËÎÏÔÙÛÜŒÆ«»’‘“”…–—°€♪ \u00a0")


def decode(data: bytes, *, strict: bool = False) -> str:
    """Return the text of `data`, line ends as they are.

    A few bytes that are no text become U+FFFD, a few control characters spaces, unless `strict`.

    Raises
    ------
    CueError
        If the bytes are no text; the message gives the line.

    Examples
    --------
    >>> decode("déjà".encode("cp1252")), decode("déjà".encode("utf-16"))
    ('déjà', 'déjà')
    """
    text = _decode(data, strict=strict)
    found = [m.start() for m in _CONTROL.finditer(text)]
    if found and (strict or "\0" in text or len(found) > _MOST_DAMAGE * len(text)):
        line = text.count("\n", 0, found[0]) + 1
        raise CueError(
            f"line {line}: control character {ord(text[found[0]]):#04x}, not a text file"
        )
    return _CONTROL.sub(" ", text)


def _decode(data: bytes, *, strict: bool) -> str:
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), _zeros(data))
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-8" or b"\0" in data:
            lossy = data.decode(encoding, errors="replace")
            if not strict and lossy.count("\ufffd") <= _MOST_DAMAGE * len(lossy):
                return lossy
            line = error.object.count(b"\n", 0, error.start) + 1
            raise CueError(f"line {line}: not valid {encoding}: {error.reason}") from None
    return max((data.decode(name, errors="replace") for name in _OLD), key=_french_share)


def _zeros(data: bytes) -> str:
    head = data[:400]
    if head and not len(data) % 2 and head.count(0) > len(head) // 4:
        return "utf-16-le" if head[1::2].count(0) >= head[::2].count(0) else "utf-16-be"
    return "utf-8"


def _french_share(text: str) -> float:
    foreign = [letter for letter in text if letter >= "\x7f"]
    return sum(letter in _FRENCH for letter in foreign) / max(1, len(foreign))
