"""From what a subtitle displays to what is said: markup, labels and sounds taken out."""

import html
import re

_ASS_TAG = re.compile(r"\{\\[^}]*\}")
_TAG = re.compile(r"</?[a-zA-Z][^<>]*>|<\d[\d:.]*>|</?>")
_SOUND = re.compile(r"\([^()]*\)|\[[^\[\]]*\]")
_MUSIC_SIGN = re.compile(r"[♪♫♬♩𝄞¶]+|(?<!\w)#(?!\w)|(?<!\w)\*(?!\w)|^\*|\*$")
_MUSIC_NOTE = re.compile(r"^\W*(?:musique|chanson|générique|mélodie|jingle|rires|applaudi)", re.I)
_DASH = re.compile(r"^\s*(?:[-‐‑‒–—]+|>>+)\s*")
_SPEAKER = re.compile(r"^\s*[A-ZÀ-Ý][A-ZÀ-Ý' .-]{1,30}\d?\s?:\s")
_END = re.compile(r"[.?!…:;,»\"]\s*$")


def plain(text: str) -> str:
    r"""Return `text` without tags of HTML, WebVTT and ASS, entities decoded.

    Examples
    --------
    >>> plain("{\\an8}<i>Tu viens&nbsp;?</i>")
    'Tu viens\xa0?'
    """
    return html.unescape(_TAG.sub("", _ASS_TAG.sub("", text)).replace("\\N", "\n"))


def spoken(text: str) -> str:
    r"""Return the words that are said in a subtitle, on one line.

    Sound descriptions in brackets, names of speakers before a colon, dashes that open a speech
    and musical notes are taken out; a line that only describes music is dropped, sung words
    stay. A change of speaker ends a sentence.

    Examples
    --------
    >>> spoken("- (Il rit) Tu viens ?\n- JEAN : Oui")
    'Tu viens ? Oui'
    >>> spoken("♪ Musique douce ♪")
    ''
    """
    pieces: list[str] = []
    for line in _SOUND.sub(" ", text).split("\n"):
        music = _MUSIC_SIGN.search(line)
        bare = _MUSIC_SIGN.sub(" ", line)
        if music and _MUSIC_NOTE.match(bare):
            continue
        turn = _DASH.match(bare)
        words = _SPEAKER.sub("", _DASH.sub("", bare)).strip()
        if not any(letter.isalnum() for letter in words):
            continue
        if turn and pieces and not _END.search(pieces[-1]):
            pieces[-1] += "."
        pieces.append(words)
    return re.sub(r"\s+", " ", " ".join(pieces)).strip()
