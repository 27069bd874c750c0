"""Reading a subtitle file: SubRip, WebVTT, ASS, EBU-TT-D / IMSC, EBU STL.

Unreadable cues and cues that must not be cued are skipped and reported: damage, other languages,
the credits of those who made the file.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from codec.errors import CueError
from synth.language.subtitles.ass import looks_like_ass, read_ass
from synth.language.subtitles.credits import is_credit
from synth.language.subtitles.encoding import decode
from synth.language.subtitles.findings import Findings, LeftOut
from synth.language.subtitles.language import FRENCH, french_lines, languages, native_lines
from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.mojibake import repaired
from synth.language.subtitles.roles import PROFILES, by_role, omitted
from synth.language.subtitles.rollup import unrolled
from synth.language.subtitles.spoken import spoken
from synth.language.subtitles.srt import read_srt
from synth.language.subtitles.start import programme_start_s
from synth.language.subtitles.stl import looks_like_stl, read_stl
from synth.language.subtitles.ttml import read_ttml
from synth.language.subtitles.vtt import read_vtt

LARGEST_BYTES = 8 << 20
"""Limit of a subtitle file, which a day of programme stays below: each MB takes seconds to read."""

OnLeftOut = Callable[[LeftOut], None]


@dataclass(frozen=True, slots=True)
class Terms:
    """On which terms a subtitle file is read.

    Attributes
    ----------
    strict : bool
        Whether the first fault of the file is an error, and only the formats' own spelling is
        accepted.
    offset_s : float or None
        Added to the file's times; None: the file's own hints give the programme's start.
    everything : bool
        Whether other languages and credits are cued all the same.
    profile : str
        What colours mean: ``fr-sdh``, subtitles for the deaf as French broadcasters write them,
        or ``plain``: nothing.

    Raises
    ------
    CueError
        If there is no such profile.

    Examples
    --------
    >>> Terms(profile="plain").profile
    'plain'
    """

    strict: bool = False
    offset_s: float | None = None
    everything: bool = False
    profile: str = PROFILES[0]

    def __post_init__(self) -> None:
        if self.profile not in PROFILES:
            raise CueError(f"profile is {self.profile!r}, not one of {', '.join(PROFILES)}")


USUAL = Terms()
"""Every choice as by default."""


def read_subtitles(
    path: str | Path,
    *,
    stream_s: float | None = None,
    player_s: float = 0.0,
    length_s: float | None = None,
    terms: Terms = USUAL,
    left_out: OnLeftOut = lambda item: None,
) -> list[Subtitle]:
    """Return the subtitles of a file, sorted by their start.

    Parameters
    ----------
    path : path
        The format follows from the content, not from the name.
    stream_s, player_s, length_s, terms, left_out
        As in `parse_subtitles`.

    Returns
    -------
    list of Subtitle

    Raises
    ------
    CueError
        If the file cannot be read, nothing of it can be cued, or it has a fault and the terms are
        strict; the message gives the file and the line.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "film.vtt"
    ...     lines = ["WEBVTT", "", "00:01.000 --> 00:02.500", "Bonjour !"]
    ...     _ = path.write_text(chr(10).join(lines))
    ...     [cue.text for cue in read_subtitles(path)]
    ['Bonjour !']
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise CueError(f"{path}: cannot read subtitles: {error.strerror}") from error
    try:
        return parse_subtitles(
            data,
            stream_s=stream_s,
            player_s=player_s,
            length_s=length_s,
            terms=terms,
            left_out=left_out,
        )
    except CueError as error:
        raise CueError(f"{path}: {error}") from error


def parse_subtitles(
    data: bytes,
    *,
    stream_s: float | None = None,
    player_s: float = 0.0,
    length_s: float | None = None,
    terms: Terms = USUAL,
    left_out: OnLeftOut = lambda item: None,
) -> list[Subtitle]:
    r"""Return the subtitles of the bytes of a file, sorted by their start.

    Parameters
    ----------
    data : bytes
    stream_s : float, optional
        As in `synth.language.subtitles.vtt.read_vtt`.
    player_s : float
        Time of the programme's clock's zero on the clock of a player. The file counts on that, as
        players show it, unless it has time codes: those count from the first picture.
    length_s : float, optional
        Length of the programme, where it is known.
    terms : Terms
    left_out : callable
        Receives each part of the file that is not cued, in the order of the file.

    Raises
    ------
    CueError
        If no subtitle can be read, or there is a fault and the terms are strict; the message
        begins with the line. A file whose subtitles must not be cued gives an empty list.

    Examples
    --------
    >>> parse_subtitles(b"00:01 --> 00:02.5\nOui.")
    [Subtitle(start_s=1.0, end_s=2.5, text='Oui.', line=1)]
    """
    if len(data) > LARGEST_BYTES:
        raise CueError(f"more than {LARGEST_BYTES} bytes of subtitles, the limit")
    if not data.strip():
        raise CueError("line 1: the file is empty")
    findings = Findings(strict=terms.strict)
    found = sorted(_parse(data, stream_s, findings), key=lambda s: (s.start_s, s.line))
    if not found:
        raise findings.none_left(1)
    found = _whole(found, findings)
    begin_s = 0.0
    if terms.offset_s is None:
        begin_s = programme_start_s(found, findings, length_s)
    if not begin_s and findings.start_s is None:
        begin_s = player_s
    found = _moved(found, (terms.offset_s or 0.0) - begin_s, findings)
    return _kept(found, findings, terms, left_out)


def cued_subtitles(
    found: Sequence[Subtitle], *, terms: Terms = USUAL, left_out: OnLeftOut = lambda item: None
) -> list[Subtitle]:
    """Return those of some subtitles that are cued, as `parse_subtitles` does for a file's.

    Parameters
    ----------
    found : sequence of Subtitle
        Sorted by start.
    terms : Terms
    left_out : callable
        Receives each subtitle, or part of one, that is not cued.
    """
    findings = Findings(strict=terms.strict)
    found = _moved(_whole(found, findings), terms.offset_s or 0.0, findings)
    return _kept(found, findings, terms, left_out)


def _kept(
    found: Sequence[Subtitle], findings: Findings, terms: Terms, left_out: OnLeftOut
) -> list[Subtitle]:
    kept = list(unrolled(_cued(found, findings, terms)))
    for item in sorted(findings.left_out, key=lambda item: item.line):
        left_out(item)
    return kept


def _parse(data: bytes, stream_s: float | None, findings: Findings) -> Iterator[Subtitle]:
    if looks_like_stl(data):
        return read_stl(data, findings)
    text = decode(data, strict=findings.strict).lstrip("\ufeff")
    text, twice = repaired(text)
    if twice:
        findings.leave_out(twice, "letters encoded twice, repaired")
    opening = text.lstrip()
    if opening.startswith("<") and twice:
        opening = re.sub(r"^<\?xml[^>]*\?>", "", opening)
        return read_ttml(opening.encode(), findings)
    if opening.startswith("<"):
        return read_ttml(data.lstrip(), findings)
    if opening.startswith("WEBVTT"):
        return read_vtt(text if findings.strict else opening, findings, stream_s=stream_s)
    if looks_like_ass(opening):
        return read_ass(text, findings)
    return read_srt(text, findings)


def _whole(subtitles: Sequence[Subtitle], findings: Findings) -> list[Subtitle]:
    """Return the subtitles whose letters can be read."""
    kept = []
    for subtitle in subtitles:
        if "\ufffd" in subtitle.text:
            findings.leave_out(subtitle.line, "its letters cannot be read")
        else:
            kept.append(subtitle)
    return kept


def _moved(subtitles: Sequence[Subtitle], offset_s: float, findings: Findings) -> list[Subtitle]:
    """Return the subtitles later by an offset, without those that end before the programme."""
    if not offset_s:
        return list(subtitles)
    moved: list[Subtitle] = []
    for s in subtitles:
        if s.end_s + offset_s <= 0:
            findings.leave_out(s.line, "over before the programme starts")
        else:
            start_s = max(0.0, s.start_s + offset_s)
            moved += findings.made(
                start_s, s.end_s + offset_s, s.text, s.line, s.runs, s.position, s.column
            )
    return moved


def _cued(subtitles: Sequence[Subtitle], findings: Findings, terms: Terms) -> Iterable[Subtitle]:
    """Return the subtitles that are French speech."""
    if terms.everything:
        return subtitles
    subtitles = by_role(subtitles, findings, terms.profile)
    declared = [
        next((r.language for r in s.runs if r.language), findings.language) for s in subtitles
    ]
    found = languages([spoken(s.text) for s in subtitles], declared)
    kept = []
    for subtitle, language in zip(subtitles, found, strict=True):
        if _told_credit(subtitle, findings):
            continue
        # A foreign subtitle may hold a French line and the reverse; one that is all of it is no
        # finding.
        if language != FRENCH and spoken(subtitle.text):
            lines = french_lines(subtitle.text)
            if len(lines) == len(subtitle.text.split("\n")):
                lines = []
        else:
            lines = native_lines(subtitle.text)
        others = [line for line in subtitle.text.split("\n") if line not in lines]
        if others:
            foreign = language if language != FRENCH else languages(others[:1], [""])[0]
            reason = f"not French ({foreign})"
            findings.left_out.append(omitted(subtitle, reason, " ".join(others)))
        if lines:
            kept.append(replace(subtitle, text="\n".join(lines)) if others else subtitle)
    return kept


def _told_credit(subtitle: Subtitle, findings: Findings) -> bool:
    credit = is_credit(subtitle.text)
    if credit:
        findings.left_out.append(
            LeftOut(subtitle.line, f"credits of the subtitles: {_short(subtitle.text)!r}")
        )
    return credit


def _short(text: str) -> str:
    return " ".join(text.split())[:40]
