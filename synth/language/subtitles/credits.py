"""Lines that name who made the subtitles: they are shown and never said."""

import re

_WORK = (
    r"sous-titr(?:ages?|es|é)|soustitr\w+|adaptation|traduction|traduit|relecture|transcription|"
    r"resynchro\w*|synchro\w*|resync\w*|sync(?:ed)?|repérage|audiodescription|version française|"
    r"vélotypie|subtitl(?:es?|ing|ed)|subs|captions?|captioning|translat(?:ed|ion)|ripped|"
    r"corrections?|corrigé\w*|encodage|timing"
)
_MAKERS = (
    r"red bee|titra|télétota|teletota|mfp|hiventy|tva|nice fellow|eclair|éclair|dubbing brothers|"
    r"st'? ?50[01]|vectracom|imaginables|ericsson|vdm|boulevard des productions|blue elements|"
    r"radio-canada|tv5|france ?télévisions|arte|cinéphase|lylo|lvt|c\.?m\.?c\.?|gesse\w*"
)
_NAMED = re.compile(
    rf"^\W*(?:{_WORK})\b[^.?!]{{0,40}}(?::|\bpar\b|\bby\b|©|\b(?:{_MAKERS})\b)", re.I
)
_ALONE = re.compile(r"^\W*sous-titr(?:age|es)\b(?![^.?!]*\b(?:est|sont|a|ont|en|pour)\b)", re.I)
_SITE = re.compile(
    r"opensubtitles|addic7ed|subscene|podnapisi|amara\.org|sous-titres\.eu|subfactory|seriessub|"
    r"(?:www\.|https?://)\S+.*sous-titr|sous-titr.*(?:www\.|https?://)\S+",
    re.I | re.S,
)

_LONGEST = 160
"""Characters of a line of credits at most."""


def is_credit(text: str) -> bool:
    """Whether a subtitle only names those who made the subtitles.

    Examples
    --------
    >>> is_credit("Sous-titrage : RED BEE MEDIA"), is_credit("Les sous-titres sont en retard.")
    (True, False)
    """
    if len(text) > _LONGEST:
        return False
    return any(form.search(text) for form in (_NAMED, _ALONE, _SITE))
