"""From the displayed text of a subtitle to the spoken one, without markup, labels, sounds."""

import html
import re

from synth.language.text.lexicon import lookup, lookup_name

_ASS_TAG = re.compile(r"\{\\[^}]*\}")
_TAG = re.compile(r"</?[a-zA-Z][^<>]*>|<\d[\d:.]*>|</?>")
_SOUND = re.compile(r"\([^()]*\)|\[[^\[\]]*\]")
_MUSIC_SIGN = re.compile(r"[♪♫♬♩𝄞¶]+|(?<!\w)#(?!\w)|(?<!\w)\*(?!\w)|^\*|\*$")
_MUSIC_NOTE = re.compile(r"^\W*(?:musique|chanson|générique|mélodie|jingle|rires|applaudi)", re.I)
_DASH = re.compile(r"^\s*(?:[-‐‑‒–—]+|>>+)\s*")
_STARS = re.compile(
    r"^(\s*(?:[-–—]\s*)?)\*[^*\n]+\*(?=\s*$|\s+[A-ZÀ-Ý«…])|(?<=[.!?…])(\s+)\*[^*\n]+\*(?=\s*$)",
    re.M,
)
_SPEAKER = re.compile(r"^\s*[A-ZÀ-Ý][A-ZÀ-Ý' .-]{1,30}\d?\s*:(?:\s+|$)")
_ROLES = "|".join(
    (
        "homme femme voix garçon fille enfant enfants tous toutes ensemble foule narrateur "
        "narratrice journaliste présentateur présentatrice commentateur commentatrice animateur "
        "animatrice policier médecin docteur infirmière professeur juge avocat avocate serveur "
        "serveuse client cliente soldat mère père maman papa radio télé télévision haut-parleur "
        "répondeur invité invitée reporter"
    ).split()
)
_NAME = r"[A-ZÀ-Ý][\w'’-]*"
_NAMES = rf"{_NAME}(?: (?:(?:de |du |la |le |Le |La )*{_NAME}|\d+)){{0,2}}"
_LABEL = re.compile(
    rf"^\s*(?:(?i:{_ROLES})(?: (?:de |du |des |d')?[\w'’-]+)?|{_NAMES})\s*:\s*"
    r"(?=[A-ZÀ-Ý«\"(.…\d]|$)"
)
_ANNOUNCES = re.compile(
    r"^\s*(?:attention|note|nota|résultat|exemple|conclusion|bref|problème|question|réponse|"
    r"remarque|important|rappel|objectif|mission|règle|preuve|total|bilan|moralité|verdict|urgent|"
    r"info|nom|prénom|âge|date|lieu|signe|score|danger|solution|conseil|astuce|étape|premièrement|"
    r"deuxièmement|ensuite|enfin|mais|et|donc|alors|oui|non|si|ou|lundi|mardi|mercredi|jeudi|"
    r"vendredi|samedi|dimanche|hier|aujourd'hui|demain)\b[^:]*:",
    re.I,
)
_BROKEN = re.compile(
    r"([^\W\d_]+)-[ \t]*\n[ \t]*(?=[a-zà-ÿœ])([^\W\d_]+(?:['’][^\W\d_]+)*)"
    r"|([A-ZÀ-Ý]+)-[ \t]*\n[ \t]*([A-ZÀ-Ý]+(?:['’][A-ZÀ-Ý]+)*)"
)
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
    for line in _unbroken(_STARS.sub(r"\1\2", _SOUND.sub(" ", text))).split("\n"):
        music = _MUSIC_SIGN.search(line)
        bare = _MUSIC_SIGN.sub(" ", line)
        if music and _MUSIC_NOTE.match(bare):
            continue
        turn = _DASH.match(bare)
        words = _unlabelled(_DASH.sub("", bare))
        if not any(letter.isalnum() for letter in words):
            continue
        if turn and pieces and not _END.search(pieces[-1]):
            pieces[-1] += "."
        pieces.append(words)
    return re.sub(r"\s+", " ", " ".join(pieces)).strip()


def _unlabelled(line: str) -> str:
    """Return a line without the name of who speaks.

    A name is in capitals, or one to three words with capitals, or a role, before a colon; after
    one in small letters a sentence begins. What announces something is said.

    Examples
    --------
    >>> [_unlabelled(x) for x in ("Jean : Oui.", "Voix de femme : Oui.", "Attention : Danger !")]
    ['Oui.', 'Oui.', 'Attention : Danger !']
    >>> _unlabelled("Paul : un génie.")
    'Paul : un génie.'
    """
    if not _ANNOUNCES.match(line):
        line = _LABEL.sub("", _SPEAKER.sub("", line), count=1)
    return line.strip()


def _unbroken(text: str) -> str:
    r"""Return a text with words that were cut at a line's end made whole.

    Examples
    --------
    >>> _unbroken("Je ne com-\nprends pas, donne-\nmoi le rendez-\nvous.")
    'Je ne comprends pas, donne-moi le rendez-vous.'
    """

    def join(match: re.Match[str]) -> str:
        first, second = match[1] or match[3], match[2] or match[4]
        joined = (first + second).replace("’", "'")
        parts = any(lookup(part.lower()) or lookup_name(part.lower()) for part in (first, second))
        whole = lookup(joined.lower()) or lookup_name(joined.lower()) or not parts
        return first + second if whole else f"{first}-{second}"

    return _BROKEN.sub(join, text)
