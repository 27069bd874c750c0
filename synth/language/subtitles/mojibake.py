"""Text that was encoded twice: UTF-8 read as an old 8-bit code and written as UTF-8 again."""

import re

_CODES = ("cp1252", "mac-roman", "cp850")
_TWICE = re.compile("[\xc2\xc3\xc5][\x80-\xbf]|\xe2[\x80-\x84][\x80-\xbf]|\xef\xbb\xbf")
"""UTF-8 of letters and signs of French, a character for each byte."""

_MOST_TIMES = 3
"""Rounds of repair at most, so that the work on any text is bounded; not tuned."""


def _bytes_of(code: str) -> dict[int, int]:
    table = {}
    for byte in range(128, 256):
        shown = bytes([byte]).decode(code, errors="ignore") or chr(byte)
        table[ord(shown)] = byte
        if code == "cp1252":
            table.setdefault(byte, byte)
    return table


_TABLES = tuple(map(_bytes_of, _CODES))


def repaired(text: str) -> tuple[str, int]:
    r"""Return a text without double encoding, and the line of its first one, 0 without any.

    Examples
    --------
    >>> repaired("Dimanche\n\u00c3\u2030l\u00c3\u00a8ve"), repaired("Élève »")
    (('Dimanche\nÉlève', 2), ('Élève »', 0))
    """
    first = 0
    for _ in range(_MOST_TIMES):
        for table in _TABLES:
            shown = text.translate(table)
            found = list(_TWICE.finditer(shown))
            if found:
                break
        else:
            break
        first = first or text.count("\n", 0, found[0].start()) + 1
        pieces, end = [], 0
        for match in found:
            pieces += [text[end : match.start()], match[0].encode("latin-1").decode("utf-8")]
            end = match.end()
        text = "".join([*pieces, text[end:]])
    if first:
        text = text.replace("\u00c3 ", "à ")
    return text, first
