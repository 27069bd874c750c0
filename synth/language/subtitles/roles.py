"""Roles of colours in French subtitles for the deaf, and sounds that are named without one.

Red names sounds, magenta music, green marks a foreign language; white, yellow and cyan (thoughts,
voices off) are spoken words.  All else is left out with its reason.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from synth.language.subtitles.findings import Findings, LeftOut
from synth.language.subtitles.model import Subtitle, TextRun
from synth.language.subtitles.spoken import spoken

PROFILES = ("fr-sdh", "plain")
"""Subtitles for the deaf as French broadcasters write them; colours without a meaning."""

_ROLES = {
    "red": "a sound (red)",
    "magenta": "music (magenta)",
    "green": "a foreign language (green)",
}
_SUNG = re.compile(r"[♪♫♬♩#«»\"“]")

_MOST_COLOURED, _MANY = 0.5, 20
"""A colour with this share of a file's letters has no meaning, if the file has this many
subtitles: no programme is half of noises."""

_SOUNDS = re.compile(
    r"(?:(?:petits?|longs?|grands?|gros|légers?|faibles?|nouveaux?|nombreux) )?"
    r"(?:applaudissements?|rires?|éclats? de (?:rire|voix)|musiques?(?! et)|brouhaha|"
    r"sonneries?|bruits?|bips?|klaxons?|vrombissements?|détonations?|cliquetis|clapotis|chahut|"
    r"coups? (?:de (?:feu|sifflet|klaxon|tonnerre|fusil|frein)|à la porte|sourds?)|"
    r"acclamations?|huées|sanglots|pleurs|soupirs?|cris?|chants? d'oiseaux|gazouillis|"
    r"(?:abo|hurl|grond|siffl|claqu|craqu|bourdonn|gémiss|halèt|rican|chuchot|miaul|henniss|tint|"
    r"crépit|grinc|rugiss|ronfl|gargouill|froiss|criss|bêl|meugl|vagiss|couin|glouss|tambourin)"
    r"i?e?ments?|portes? qui|sirènes? (?:de|au)|jingle|explosions? au loin|tonnerre au loin|"
    r"générique)"
    r"(?:[ ,]+(?!est\b|sont\b|a\b|ont\b|et\b(?! [^\W\d_]+$))[\w'’-]+){0,5}\.?",
    re.I,
)
"""Nouns of noises with at most five words: no dash, no mark of an exclamation or a question."""

_VERBAL = re.compile(r"\b(?:je|tu|il|elle|on|nous|vous|ils|elles|c'est|est|sont|font|fait)\b", re.I)


def by_role(subtitles: Sequence[Subtitle], findings: Findings, profile: str) -> list[Subtitle]:
    """Return the subtitles that are spoken French by their colour and language.

    Parameters
    ----------
    subtitles : sequence of Subtitle
    findings : Findings
        Receives the omitted parts.
    profile : str
        One of `PROFILES`.
    """
    silent = _silent_colours(subtitles, findings) if profile == "fr-sdh" else frozenset()
    kept = []
    for subtitle in subtitles:
        reasons = [_reason(run, silent, findings.language) for run in subtitle.runs]
        for reason, pairs in groupby(zip(reasons, subtitle.runs, strict=True), lambda p: p[0]):
            text = "".join(run.text for _, run in pairs)
            if reason and text.strip():
                findings.left_out.append(omitted(subtitle, reason, text))
        if any(reasons):
            said = zip(subtitle.runs, reasons, strict=True)
            runs = tuple(run for run, reason in said if not reason)
            text = "".join(run.text for run in runs).strip()
            if not text:
                continue
            subtitle = replace(subtitle, text=text, runs=runs)
        kept.append(subtitle)
    return [left for s in kept for left in _spoken_lines(s, findings, profile)]


def omitted(subtitle: Subtitle, reason: str, text: str) -> LeftOut:
    """Return the omitted part of a subtitle, with its first letters."""
    return LeftOut(subtitle.line, f"{reason}: {' '.join(text.split())[:40]!r}", subtitle.column)


def is_sound(line: str) -> bool:
    """Whether a line only names a sound.

    Examples
    --------
    >>> is_sound("Musique douce"), is_sound("Musique !"), is_sound("Les rires font du bien.")
    (True, False, False)
    """
    return bool(_SOUNDS.fullmatch(line.strip())) and not _VERBAL.search(line)


def _spoken_lines(subtitle: Subtitle, findings: Findings, profile: str) -> list[Subtitle]:
    """Return the subtitle without lines that name sounds: one, or none if nothing is said."""
    lines = subtitle.text.split("\n")
    if profile == "fr-sdh":
        sounds = [line for line in lines if is_sound(line)]
        opens = [line for line in lines if line not in sounds]
        if sounds and (not opens or all(_stands_alone(line) for line in opens)):
            findings.left_out.append(omitted(subtitle, "a sound", " ".join(sounds)))
            lines = opens
            subtitle = replace(subtitle, text="\n".join(lines))
    if any(c.isalnum() for c in "".join(lines)) and not spoken(subtitle.text):
        findings.left_out.append(omitted(subtitle, "a sound, not speech", subtitle.text))
        return []
    if lines and not spoken(subtitle.text) and subtitle.text.strip():
        findings.left_out.append(omitted(subtitle, "a sound or a sign", subtitle.text))
        return []
    return [subtitle] if lines and subtitle.text.strip() else []


def _stands_alone(line: str) -> bool:
    """Whether a line looks like a sentence of its own."""
    bare = line.strip().lstrip("-–— ")
    return bare[:1].isupper() and bare[-1:] in ".!?…"


def _silent_colours(subtitles: Sequence[Subtitle], findings: Findings) -> frozenset[str]:
    """Return the colours that mean something other than speech in this file."""
    letters: Counter[str] = Counter()
    for subtitle in subtitles:
        for run in subtitle.runs:
            letters[run.colour] += len(run.text.strip())
    total = sum(letters.values())
    silent = set(_ROLES)
    for colour in _ROLES:
        if len(subtitles) >= _MANY and letters[colour] > _MOST_COLOURED * total:
            silent.discard(colour)
            share = round(100 * letters[colour] / total)
            findings.left_out.append(
                LeftOut(1, f"roles of colours: {share} % of the text is {colour}, cued as speech")
            )
    return frozenset(silent)


def _reason(run: TextRun, silent: frozenset[str], document: str) -> str:
    """Return the reason why a run is not spoken in French, "" if it is."""
    base = run.language.partition("-")[0].lower()
    if base not in ("", "fr") and run.language != document:
        from synth.language.subtitles.language import is_surely_french

        if not is_surely_french(run.text):
            return f"not French ({base[:3]})"
    if run.colour in silent:
        sung = run.colour == "magenta" and _SUNG.search(run.text) and spoken(run.text)
        return "" if sung else _ROLES[run.colour]
    return ""
